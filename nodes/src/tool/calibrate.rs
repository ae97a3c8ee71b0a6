//! `tactflow calibrate`: logs in, a calibration file, a picture and a report out.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use tactflow_runtime::cli::clap::{self, Parser, ValueEnum};
use tactflow_runtime::cli::{NOT_LOADED, Shell};
use tactflow_runtime::signal::Unit;
use tactflow_runtime::source::SourceMap;
use tactflow_runtime::source::{Code, Diagnostic, Report as Mistakes};

use super::{may_replace, pair, positive};
use crate::calibration::log::Log;
use crate::calibration::report::{Report, Settings, State, calibrate};
use crate::calibration::samples::Load;
use crate::calibration::{Kind, file, plot};
use crate::recordings::{self, Assumed, Hints, Refusal};

/// Make a calibration file for a pad from logs with a reference force
#[derive(Parser)]
#[command(name = "calibrate")]
#[command(
    after_help = "A log is a recording that has a force [N] for each frame: a CSV file with the columns time, force and the tactels, \
or an .npz file with images and force. It begins unloaded. docs/calibration.md says more.

Examples:
  tactflow calibrate press.csv                          only the report
  tactflow calibrate press.csv -o pad.toml --svg pad.svg
  tactflow calibrate bladder1.npz bladder2.npz --load uniform --curve piecewise -o pad.toml

Exit codes: 0 all went well; 2 a log or a file cannot be used."
)]
pub(super) struct Calibrate {
    /// The logs, all of one pad
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Write the calibration file; one that is there is replaced, any other file is not
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// How the pad was loaded: a probe on one tactel at a time, or a bladder on all alike
    #[arg(long, value_enum, default_value_t = LoadArg::Probe)]
    load: LoadArg,
    /// Sort of the curves; the simplest that fits about as well as the best unless given
    #[arg(long, value_enum)]
    curve: Option<CurveArg>,
    /// Draw the curves of all tactels
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// A tactel whose reading rises by less than this is dead [unit of the reading]; 5 % of the greatest rise unless given
    #[arg(long, value_name = "READING", value_parser = positive, allow_hyphen_values = true)]
    dead_below: Option<f64>,
    /// How many tactels share the force of a uniform load; the live ones unless given
    #[arg(long, value_name = "COUNT")]
    bearing: Option<NonZeroUsize>,
    /// Report every tactel, not only the worst
    #[arg(long)]
    each: bool,
    /// Format of the logs; recognised unless given
    #[arg(long, value_name = "NAME")]
    format: Option<String>,
    /// Unit of the readings, where a log does not say it; raw unless given
    #[arg(long)]
    unit: Option<Unit>,
    /// Rows and columns, where a log does not say them: 16x16
    #[arg(long, value_name = "ROWSxCOLS", value_parser = pair::<NonZeroUsize>)]
    size: Option<[NonZeroUsize; 2]>,
}

#[derive(Clone, Copy, ValueEnum)]
enum LoadArg {
    Probe,
    Uniform,
}

#[derive(Clone, Copy, ValueEnum)]
enum CurveArg {
    Linear,
    Rational,
    Piecewise,
}

impl From<CurveArg> for Kind {
    fn from(curve: CurveArg) -> Self {
        match curve {
            CurveArg::Linear => Self::Linear,
            CurveArg::Rational => Self::Rational,
            CurveArg::Piecewise => Self::Piecewise,
        }
    }
}

/// A calibration need not know how far the tactels are apart, nor how fast the frames came.
const ASSUMED: Assumed = Assumed { unit: Unit::RAW, pitch: [0.005; 2], rate_hz: 100.0 };

/// Residual, as a part of the largest force, from which on a calibration is none.
const USELESS: f64 = 0.25;

/// Why it cannot be done.
enum Failure {
    Words(String),
    Places(Box<Mistakes>),
}

impl From<String> for Failure {
    fn from(words: String) -> Self {
        Self::Words(words)
    }
}

pub(super) fn run(args: Calibrate, shell: &Shell) -> u8 {
    match make(&args, shell) {
        Ok(()) => 0,
        Err(Failure::Words(words)) => {
            shell.error(words);
            NOT_LOADED
        }
        Err(Failure::Places(report)) => shell.complain(&report),
    }
}

fn make(args: &Calibrate, shell: &Shell) -> Result<(), Failure> {
    if args.bearing.is_some() && matches!(args.load, LoadArg::Probe) {
        return Err("`--bearing` means nothing without `--load uniform`: the force of a probe is on one tactel"
            .to_owned()
            .into());
    }
    // Before the work, not after it.
    args.out.as_deref().map_or(Ok(()), |path| may_replace(path, "calibration file", file::is_calibration))?;
    args.svg.as_deref().map_or(Ok(()), |path| may_replace(path, "SVG picture", |text| text.contains("<svg")))?;
    let logs = args.logs.iter().map(|path| read(path, args)).collect::<Result<Vec<Log>, Failure>>()?;
    for (path, log) in args.logs.iter().zip(&logs) {
        let (first, one) = (&logs[0], |log: &Log| format!("{} x {} tactels in {}", log.rows, log.cols, log.unit));
        if (log.rows, log.cols, log.unit) != (first.rows, first.cols, first.unit) {
            let message =
                format!("`{}` has {}, but `{}` has {}", path.display(), one(log), args.logs[0].display(), one(first));
            return Err(Failure::Words(message));
        }
    }
    let load = match args.load {
        LoadArg::Probe => Load::Probe,
        LoadArg::Uniform => Load::Uniform,
    };
    let bearing = args.bearing.map(NonZeroUsize::get);
    let settings = Settings { load, curve: args.curve.map(Kind::from), dead_below: args.dead_below, bearing };
    let report = calibrate(&logs, &settings)?;
    shell.say(report.text(args.each).trim_end());
    let residual = report.typical_residual();
    if residual > USELESS {
        let percent = 100.0 * residual;
        let message = format!(
            "the curves are off by {percent:.0} % of the range, so nothing is written; was the pad loaded as `--load` \
             says, and is `force` the force of the same frames?"
        );
        return Err(Failure::Words(message));
    }
    if let Some(path) = &args.out {
        write(path, &file::write(&report.calibration, &origin(args, &report)))?;
        shell.say(&format!("\nwrote {}: calibrate takes it as `file = \"…\"`", path.display()));
    }
    if let Some(path) = &args.svg {
        write(path, &plot::svg(&report))?;
        shell.say(&format!("wrote {}", path.display()));
    }
    Ok(())
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    std::fs::write(path, text).map_err(|error| format!("cannot write `{}`: {error}", path.display()))
}

/// What the file says of how it was made.
fn origin(args: &Calibrate, report: &Report) -> String {
    let names = args.logs.iter().map(|path| path.file_name().unwrap_or_default().to_string_lossy().into_owned());
    let load = match args.load {
        LoadArg::Probe => "a probe on one tactel at a time",
        LoadArg::Uniform => "a uniform load",
    };
    let residual = report.rms[report.kind() as usize];
    let left_out = report.in_state(State::Few).len() + report.in_state(State::Unfit).len();
    let left_out =
        if left_out > 0 { format!(" {left_out} of the dead could not be calibrated.") } else { String::new() };
    format!(
        "Made by `tactflow calibrate` from {}, {load}, up to {:.3} N a tactel.\nResidual {residual:.4} N (RMS).{left_out}",
        names.collect::<Vec<_>>().join(", "),
        report.most
    )
}

/// Reads one log.
fn read(path: &Path, args: &Calibrate) -> Result<Log, Failure> {
    let name = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|error| format!("cannot read `{name}`: {error}"))?;
    let hints = Hints {
        format: args.format.clone(),
        unit: args.unit,
        size: args.size.map(|size| size.map(NonZeroUsize::get)),
        assumed: Some(ASSUMED),
        ..Hints::default()
    };
    let recording = recordings::read(&bytes, &name, &hints).map_err(|refusal| refused(refusal, &name))?;
    Log::new(&recording).map_err(|message| Failure::Words(format!("`{name}` cannot be used: {message}")))
}

fn refused(refusal: Refusal, name: &str) -> Failure {
    match refusal {
        Refusal::Stranger => {
            format!("`{name}` is no recording of a known format; formats are {}", recordings::list()).into()
        }
        Refusal::Damaged { text, flaws } => {
            let mut sources = SourceMap::default();
            sources.add(name, text, "");
            let diagnostics = flaws.into_iter().map(|flaw| Diagnostic::new(Code::BadData, flaw.span, flaw.message));
            Failure::Places(Box::new(Mistakes::new(sources, diagnostics.collect())))
        }
        Refusal::Broken { message, help } => {
            let help = help.map_or_else(String::new, |help| format!("; {help}"));
            format!("`{name}`: {message}{help}").into()
        }
        Refusal::Silent { message, .. } => format!("`{name}`: {message}; give it, as `--size 16x16`").into(),
        Refusal::Contradicted { hint, message } => format!("`{name}`: `{hint}`: {message}").into(),
    }
}

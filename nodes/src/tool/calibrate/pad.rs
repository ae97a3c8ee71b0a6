//! `tactflow calibrate LOG…`: makes a calibration file, a picture and a report from logs.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use tactflow_runtime::cli::Shell;
use tactflow_runtime::cli::clap::{self, Args};
use tactflow_runtime::signal::Unit;
use tactflow_runtime::source::{Code, Diagnostic, Report, SourceMap};

use crate::calibration::log::Log;
use crate::calibration::report::{CalibrationReport, Settings, TactelStatus, calibrate};
use crate::calibration::samples::LoadKind;
use crate::calibration::{CurveKind, file, plot};
use crate::recordings::{self, Assumed, Hints, Refusal};
use crate::tool::arguments::{may_draw, may_replace, pair, positive, write};

/// The arguments of a calibration of the tactels.
#[derive(Args)]
pub(super) struct PadArgs {
    /// Logs of one pad
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Write the calibration file; replaces a calibration file, but no other file
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// How the pad was loaded: by a probe on one tactel at a time, or by a bladder on all equally
    #[arg(long, value_enum, default_value_t = LoadKind::Probe)]
    load: LoadKind,
    /// Kind of the curves; by default the simplest that fits about as well as the best
    #[arg(long, value_enum)]
    curve: Option<CurveKind>,
    /// Draw the curves of all tactels
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Minimum response of a live tactel [unit of the reading]; by default 5 % of the maximum response
    #[arg(long, value_name = "READING", value_parser = positive, allow_hyphen_values = true)]
    dead_below: Option<f64>,
    /// Number of tactels that share a uniform load; by default the live ones
    #[arg(long, value_name = "COUNT")]
    bearing: Option<NonZeroUsize>,
    /// Report every tactel instead of the worst only
    #[arg(long)]
    each: bool,
    /// Format of the logs; by default it is recognised
    #[arg(long, value_name = "NAME")]
    format: Option<String>,
    /// Unit of the readings, if a log does not give it; by default raw
    #[arg(long)]
    unit: Option<Unit>,
    /// The port with the reference force, if a log is a recording of a whole run (.mcap): truth.force
    #[arg(long, value_name = "PORT")]
    force: Option<String>,
    /// The role of the pad, if a log is a recording of a whole run with several pads
    #[arg(long, value_name = "ROLE")]
    pad: Option<String>,
    /// Rows and columns, if a log does not give them: 16x16
    #[arg(long, value_name = "ROWSxCOLS", value_parser = pair::<NonZeroUsize>)]
    size: Option<[NonZeroUsize; 2]>,
}

/// Defaults: a calibration depends neither on the pitch nor on the frame rate.
const ASSUMED: Assumed = Assumed { unit: Unit::RAW, pitch: [0.005; 2], rate_hz: 100.0 };

/// Maximum residual of a calibration that is written, as a fraction of the maximum force.
const MAX_RESIDUAL: f64 = 0.25;

pub(super) fn run(args: PadArgs, shell: &Shell) -> Result<u8, u8> {
    let refuse = |message: String| shell.refuse(message);
    check(&args).map_err(refuse)?;
    let logs: Vec<Log> = args.logs.iter().map(|path| read(path, &args, shell)).collect::<Result<_, _>>()?;
    make(&args, &logs, shell).map_err(refuse).map(|()| 0)
}

/// Checks the arguments and the files to write, before the long calculation.
fn check(args: &PadArgs) -> Result<(), String> {
    if args.bearing.is_some() && args.load == LoadKind::Probe {
        return Err("`--bearing` needs `--load uniform`: the force of a probe is on one tactel".into());
    }
    args.out.as_deref().map_or(Ok(()), |path| may_replace(path, "a calibration file", file::is_calibration))?;
    args.svg.as_deref().map_or(Ok(()), may_draw)
}

fn make(args: &PadArgs, logs: &[Log], shell: &Shell) -> Result<(), String> {
    for (path, log) in args.logs.iter().zip(logs) {
        let (first, describe) = (&logs[0], |log: &Log| format!("{} x {} tactels in {}", log.rows, log.cols, log.unit));
        if (log.rows, log.cols, log.unit) != (first.rows, first.cols, first.unit) {
            return Err(format!(
                "all logs must be of one pad, but `{}` has {} and `{}` has {}",
                path.display(),
                describe(log),
                args.logs[0].display(),
                describe(first)
            ));
        }
    }
    let bearing = args.bearing.map(NonZeroUsize::get);
    let settings = Settings { load: args.load, curve: args.curve, dead_below: args.dead_below, bearing };
    let report = calibrate(logs, &settings)?;
    shell.say(report.text(args.each).trim_end());
    let residual = report.typical_residual();
    if residual > MAX_RESIDUAL {
        let percent = 100.0 * residual;
        return Err(format!(
            "the residual of the curves is {percent:.0} % of the range, so no file is written; does `--load` match the \
             log, and does `force` belong to the same frames?"
        ));
    }
    if let Some(path) = &args.out {
        write(path, &file::write(&report.calibration, &origin(args, &report)))?;
        shell.say(&format!("\nwrote {}; the node `calibrate` reads it with `file = \"…\"`", path.display()));
    }
    if let Some(path) = &args.svg {
        write(path, &plot::svg(&report))?;
        shell.say(&format!("wrote {}", path.display()));
    }
    Ok(())
}

/// Returns the comment of the file: how it was made.
fn origin(args: &PadArgs, report: &CalibrationReport) -> String {
    let names = args.logs.iter().map(|path| path.file_name().unwrap_or_default().to_string_lossy().into_owned());
    let load = match args.load {
        LoadKind::Probe => "a probe on one tactel at a time",
        LoadKind::Uniform => "a uniform load",
    };
    let residual = report.rms[report.kind() as usize];
    let left_out = report.with_status(TactelStatus::Few).len() + report.with_status(TactelStatus::Unfit).len();
    let left_out = if left_out > 0 {
        format!(" {left_out} of the tactels under `dead` could not be calibrated.")
    } else {
        String::new()
    };
    format!(
        "Made by `tactflow calibrate` from {}, {load}, up to {:.3} N a tactel.\nResidual {residual:.4} N (RMS).{left_out}",
        names.collect::<Vec<_>>().join(", "),
        report.most
    )
}

/// Reads one log. Prints why it cannot be used, and returns the exit code.
fn read(path: &Path, args: &PadArgs, shell: &Shell) -> Result<Log, u8> {
    let name = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|error| shell.refuse(format_args!("cannot read `{name}`: {error}")))?;
    let hints = Hints {
        format: args.format.clone(),
        unit: args.unit,
        size: args.size.map(|size| size.map(NonZeroUsize::get)),
        force: args.force.clone(),
        pad: args.pad.clone(),
        assumed: Some(ASSUMED),
        ..Hints::default()
    };
    let recording = recordings::read(&bytes, &name, &hints).map_err(|refusal| refused(refusal, &name, shell))?;
    Log::new(&recording).map_err(|message| shell.refuse(format_args!("`{name}` cannot be used: {message}")))
}

/// Prints why a log is refused, and returns the exit code.
fn refused(refusal: Refusal, name: &str, shell: &Shell) -> u8 {
    shell.refuse(match refusal {
        Refusal::Stranger => format!("`{name}` has an unknown format; {}", recordings::list()),
        Refusal::Damaged { text, flaws } => {
            let mut sources = SourceMap::default();
            sources.add(name, text, "");
            let diagnostics = flaws.into_iter().map(|flaw| Diagnostic::new(Code::BadData, flaw.span, flaw.message));
            return shell.reject(&Report::new(sources, diagnostics.collect()));
        }
        Refusal::Broken { message, help } => {
            let help = help.map_or_else(String::new, |help| format!("; {help}"));
            format!("`{name}`: {message}{help}")
        }
        Refusal::Silent { message, .. } if message.contains(" pads: ") => {
            format!("`{name}`: {message}; select one with `--pad`")
        }
        Refusal::Silent { message, .. } => format!("`{name}`: {message}; add it, as `--size 16x16`"),
        Refusal::Contradicted { hint, message } => format!("`{name}`: `{hint}`: {message}"),
    })
}

//! `tactflow doctor`: connects to every device of a bench and says what it saw. Without `--move`, nothing moves.

mod arm;
mod clock;
mod host;
mod pad;
mod patient;
#[cfg(feature = "drivers")]
mod place;
#[cfg(feature = "drivers")]
mod press;
#[cfg(feature = "drivers")]
mod remedy;
mod stop;
#[cfg(feature = "drivers")]
mod symmetry;
mod timing;
#[cfg(feature = "drivers")]
mod touch;

use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use tactflow_runtime::cli::clap::{self, Parser};
use tactflow_runtime::cli::{FAULTED, Shell, duration};
use tactflow_runtime::device::{Driver, Silence};
use tactflow_runtime::engine::Interrupt;
use tactflow_runtime::graph::{BenchDevice, CommissionedDevice, OpenBench, open_bench};

use patient::Patient;
use stop::Arm;

/// Connect to every device of a bench, without moving it, and say what it does
#[derive(Parser)]
#[command(name = "doctor")]
#[command(
    after_help = "It prints for each live device: rate, jitter and age of its samples, the rate of its clock, lost and rejected frames,
the noise of a pad without a load, the joints of an arm and their order, and what the device does without commands. Nothing
moves.

Examples:
  tactflow doctor graphs/benches/lwr_fri.toml
  tactflow doctor cell.toml --for 30s
  tactflow doctor cell.toml --press
  tactflow doctor cell.toml --move

With `--press`, it asks you to press the four corners of each pad, one after the other, and names a flipped or swapped axis
with the line that corrects it. If the pad has a `mount`, the corners are named in the base of the arm, so that a mistake in
the mount shows too. Then also check that the pad faces the direction that it prints.

With `--move`, it also proves that each real arm stops by itself when its commands cease, and notes the proof in a file
beside the bench. Until then, `tactflow run` uses a tenth of the limits of speed and acceleration.

Exit codes: 0 no problem; 1 a device failed, sent nothing or would not move, or an axis of a pad is wrong; 2 the bench does
not load; 130 Ctrl-C ended `--press`. A turned image is a warning, with exit code 0, if its corners were not named in the base."
)]
pub(super) struct DoctorArgs {
    /// Bench file
    bench: PathBuf,
    /// How long to watch the devices: 3s, 500ms, 1min
    #[arg(long = "for", value_name = "TIME", value_parser = duration, default_value = "5s")]
    duration: f64,
    /// After a typed `yes`, move each real arm by some millimetres at 5 mm/s, send nothing more, and measure how it stops
    #[arg(long = "move")]
    moves: bool,
    #[cfg(feature = "drivers")]
    #[command(flatten)]
    press: press::PressArgs,
}

/// Time that a controller needs for a new session, after it has noticed the end of the last one.
const NEW_SESSION: Duration = Duration::from_millis(500);

/// What the doctor found, in the order of its severity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Severity {
    /// As it should be.
    Fine,
    /// Worth a look before the first run.
    Warning,
    /// A run would not work.
    Problem,
}

/// One line of the report.
#[derive(Debug, Clone, PartialEq)]
struct Finding {
    severity: Severity,
    text: String,
}

impl Finding {
    fn fine(text: impl Into<String>) -> Self {
        Self { severity: Severity::Fine, text: text.into() }
    }

    fn warning(text: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, text: text.into() }
    }

    fn problem(text: impl Into<String>) -> Self {
        Self { severity: Severity::Problem, text: text.into() }
    }
}

pub(super) fn run(args: DoctorArgs, shell: &Shell) -> Result<u8, u8> {
    let bench = open_bench(shell.catalogue(), &args.bench).map_err(|report| shell.reject(&report))?;
    let interrupt = Interrupt::catch();
    let interrupt = interrupt.map_err(|error| shell.refuse(format_args!("cannot watch for Ctrl-C: {error}")))?;
    let mut worst = print(shell, "this computer", &host::examine());
    let OpenBench { devices, bind } = bench;
    let roles = |device: &str| -> Vec<String> {
        let is_own = |word: &str| word.split_once('.').map_or(word, |(name, _)| name) == device;
        bind.iter().filter(|(_, word)| is_own(word)).map(|(role, _)| format!("`{role}`")).collect()
    };
    let (mut patients, mut arms) = (Vec::new(), Vec::new());
    #[cfg(feature = "drivers")]
    let described: Vec<_> = devices.iter().map(remedy::Described::of).collect();
    for BenchDevice { name, kind, opened, to_commission, .. } in devices {
        arms.extend(to_commission.map(|device| (device, opened.description.on_silence.clone())));
        let title = format!("{name}: {kind} as {}", roles(&name).join(", "));
        match opened.driver {
            Driver::Live(driver) => match Patient::admit(title.clone(), &name, opened.description, driver) {
                Ok(patient) => patients.push(patient),
                Err(error) => worst = worst.max(print(shell, &title, &[Finding::problem(error.to_string())])),
            },
            Driver::Stepped(_) | Driver::Lockstep(_) | Driver::Beside { .. } | Driver::Recorded { .. } => {
                let text = "it runs step by step with the graph, so there is nothing to measure";
                worst = worst.max(print(shell, &title, &[Finding::fine(text)]));
            }
        }
    }
    watch(&mut patients, args.duration, &interrupt);
    for patient in &patients {
        worst = worst.max(print(shell, patient.title(), &patient.findings(args.duration)));
    }
    for patient in patients {
        let title = patient.title().to_owned();
        if let Err(error) = patient.stop() {
            worst = worst.max(print(shell, &title, &[Finding::problem(error.to_string())]));
        }
    }
    #[cfg(feature = "drivers")]
    {
        worst = worst.max(args.press.examine(shell, &args.bench, args.duration, &described)?);
    }
    if args.moves && worst != Severity::Problem {
        worst = worst.max(prove(shell, &args.bench, &arms, &bind));
    } else if args.moves {
        shell.say("not moved, because of the problems above");
    }
    Ok(if worst == Severity::Problem { FAULTED } else { 0 })
}

/// Proves for each arm that must be commissioned that it stops by itself.
fn prove(
    shell: &Shell,
    bench: &Path,
    arms: &[(CommissionedDevice, Option<Silence>)],
    bind: &[(String, String)],
) -> Severity {
    let mut worst = Severity::Fine;
    for (device, silence) in arms {
        let role = bind.iter().find(|(_, word)| *word == device.name).map(|(role, _)| role.as_str());
        let (Some(role), Some(silence)) = (role, silence) else { continue };
        let arm = Arm { role, device, within: silence.within };
        let findings = match stop::is_allowed(shell, &arm) {
            true => {
                // The controller notices first that the session of the examination is over.
                thread::sleep(Duration::from_secs_f64(arm.within) + NEW_SESSION);
                stop::prove(shell, bench, &arm)
            }
            false => vec![Finding::warning("not moved")],
        };
        worst = worst.max(print(shell, &format!("{role}: the stop"), &findings));
    }
    if arms.is_empty() {
        shell.say("no arm of this bench must be commissioned");
    }
    worst
}

/// Prints findings under a title. Returns the worst severity.
fn print(shell: &Shell, title: &str, findings: &[Finding]) -> Severity {
    shell.say(title);
    for Finding { severity, text } in findings {
        let mark = match severity {
            Severity::Fine => "",
            Severity::Warning => "warning: ",
            Severity::Problem => "problem: ",
        };
        shell.say(&format!("  {mark}{text}"));
    }
    findings.iter().map(|finding| finding.severity).max().unwrap_or(Severity::Fine)
}

/// Receives the samples of all devices for a time [s], or until Ctrl-C.
fn watch(patients: &mut [Patient], time: f64, interrupt: &Interrupt) {
    /// Longest time between two looks at the devices, which wake this thread when they sample.
    const LOOK: Duration = Duration::from_millis(1);
    let end = Instant::now() + Duration::from_secs_f64(time);
    while !patients.is_empty() && Instant::now() < end && !interrupt.is_requested() {
        thread::park_timeout(LOOK);
        patients.iter_mut().for_each(Patient::look);
    }
}

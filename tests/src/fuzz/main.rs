//! `fuzz TARGET`: lets a parser read spoilt inputs until one fails.
//!
//! A target runs in a process of its own, which writes the number of each input to a file before it reads the input.
//! So the input is known even if the process dies of a stack that is full or of memory that is not there, or hangs.

use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, ExitStatus};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use tactflow_tests::fuzz::{Campaign, TARGETS, Target, target};
use tactflow_tests::workspace;

const USAGE: &str = "\
Lets the parsers of tactflow read spoilt inputs, and stops at the first that fails.

Usage: fuzz [TARGET] [--inputs N] [--seed S] [--only K]

Without a target it reads the inputs of all targets.

Options:
  --inputs N  Number of inputs of each target [default: 1000000]
  --seed S    Seed of the inputs [default: the time]
  --only K    Read only the input with this number

An input fails if its parser panics, breaks a promise, takes more than a second or too much memory. Then the exit code
is 1, and the input is written to a file in `target/fuzz`.

Targets:
";

/// Time after which a target that does not finish an input hangs.
const MAX_SILENCE: Duration = Duration::from_secs(60);
/// Stack of the thread that reads inputs: as much as the tool's own threads have [bytes].
const STACK: usize = 2 << 20;
/// Time between two reports.
const REPORT: Duration = Duration::from_secs(10);

/// What the command line asks for.
#[derive(Debug, Clone, Default)]
struct Arguments {
    target: String,
    inputs: u64,
    seed: u64,
    only: Option<u64>,
    /// The file for the number of the input; given to the process that reads the inputs.
    number: Option<PathBuf>,
}

fn main() -> ExitCode {
    let given: Vec<String> = std::env::args().skip(1).collect();
    if given.iter().any(|word| word == "--help" || word == "-h") {
        let list = TARGETS.iter().map(|target| format!("  {:<16} {}\n", target.name, target.title));
        let _ = write!(std::io::stdout(), "{USAGE}{}", list.collect::<String>());
        return ExitCode::SUCCESS;
    }
    let arguments = match read_arguments(&given) {
        Ok(arguments) => arguments,
        Err(why) => {
            say(&format!("error: {why}; `fuzz --help` lists what there is"));
            return ExitCode::from(2);
        }
    };
    let chosen: Vec<&Target> = match &*arguments.target {
        "all" => TARGETS.iter().collect(),
        name => target(name).into_iter().collect(),
    };
    if let (Some(file), [target]) = (&arguments.number, &*chosen) {
        return read_inputs(target, &arguments, file);
    }
    let failed = chosen.iter().filter(|target| !supervise(target, &arguments)).count();
    if failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn read_arguments(given: &[String]) -> Result<Arguments, String> {
    let time = SystemTime::now().duration_since(UNIX_EPOCH).map_or(1, |time| time.as_secs());
    let mut arguments = Arguments { inputs: 1_000_000, seed: time, ..Arguments::default() };
    let mut words = given.iter();
    while let Some(word) = words.next() {
        let mut value = || words.next().ok_or(format!("`{word}` needs a value"));
        let number = |text: &String| text.parse().map_err(|_| format!("`{text}` is not a whole number"));
        match &**word {
            "--inputs" => arguments.inputs = number(value()?)?,
            "--seed" => arguments.seed = number(value()?)?,
            "--only" => arguments.only = Some(number(value()?)?),
            "--number-file" => arguments.number = Some(value()?.into()),
            name if arguments.target.is_empty() && (name == "all" || target(name).is_some()) => {
                name.clone_into(&mut arguments.target)
            }
            other => return Err(format!("`{other}` is neither a target nor an option")),
        }
    }
    if arguments.target.is_empty() {
        arguments.target = "all".to_owned();
    }
    Ok(arguments)
}

/// Nobody may listen any more.
fn say(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

fn measure(run: &mut dyn FnMut()) -> u64 {
    allocation_counter::measure(run).bytes_max
}

/// Reads the inputs of a target, in a thread with the stack of any other.
fn read_inputs(target: &'static Target, arguments: &Arguments, file: &Path) -> ExitCode {
    let (arguments, file) = (arguments.clone(), file.to_owned());
    let thread = std::thread::Builder::new().stack_size(STACK).spawn(move || read_each(target, &arguments, &file));
    thread.ok().and_then(|thread| thread.join().ok()).unwrap_or(ExitCode::FAILURE)
}

fn read_each(target: &Target, arguments: &Arguments, file: &Path) -> ExitCode {
    let campaign = Campaign::new(target, arguments.seed, measure);
    let mut file = match File::create(file) {
        Ok(file) => file,
        Err(why) => {
            say(&format!("error: {}: {why}", file.display()));
            return ExitCode::FAILURE;
        }
    };
    let numbers = arguments.only.map_or(0..arguments.inputs, |only| only..only + 1);
    let (start, mut reported) = (Instant::now(), Instant::now());
    let done = campaign.read_corpus().and_then(|good| {
        let tally = campaign.run(numbers, |number| {
            // A lost number only costs the report of a process that dies.
            let _ = file.seek(SeekFrom::Start(0)).and_then(|_| file.write_all(&number.to_le_bytes()));
            if reported.elapsed() > REPORT {
                reported = Instant::now();
                say(&format!("{}: {number} inputs in {:.0} s", target.name, start.elapsed().as_secs_f64()));
            }
        })?;
        Ok((good, tally))
    });
    match done {
        Ok((good, tally)) => {
            say(&format!(
                "{}: {} inputs in {:.1} s, {:.1} % accepted; {} of {} good ones",
                target.name,
                tally.inputs,
                start.elapsed().as_secs_f64(),
                100.0 * tally.accepted as f64 / tally.inputs.max(1) as f64,
                good.accepted,
                good.inputs
            ));
            ExitCode::SUCCESS
        }
        Err(failure) => {
            report(target, arguments, failure.number, &failure.input, &failure.why);
            ExitCode::FAILURE
        }
    }
}

/// Prints what fails, and writes the input to a file.
fn report(target: &Target, arguments: &Arguments, number: u64, input: &[u8], why: &str) {
    let folder = workspace().join("target/fuzz");
    let path = folder.join(format!("{}-{}-{number}.bin", target.name, arguments.seed));
    let written = fs::create_dir_all(&folder).and_then(|()| fs::write(&path, input));
    let place = written.map_or_else(|why| format!("not written: {why}"), |()| path.display().to_string());
    let (name, seed) = (target.name, arguments.seed);
    say(&format!(
        "{name}: input {number} of seed {seed} fails: {why}\n  {place}\n  again: fuzz {name} --seed {seed} --only {number}"
    ));
}

/// Runs a target in a process of its own. Returns whether all inputs were read.
fn supervise(target: &Target, arguments: &Arguments) -> bool {
    let file = std::env::temp_dir().join(format!("tactflow-fuzz-{}", std::process::id()));
    let seed = arguments.seed.to_string();
    say(&format!("{}: seed {seed}", target.name));
    let child = std::env::current_exe().and_then(|program| {
        let mut command = Command::new(program);
        command.args([target.name, "--seed", &seed, "--inputs", &arguments.inputs.to_string(), "--number-file"]);
        command.arg(&file);
        if let Some(only) = arguments.only {
            command.args(["--only", &only.to_string()]);
        }
        command.spawn()
    });
    let outcome = child.and_then(|child| wait(child, &file));
    let number = last_number(&file);
    let _ = fs::remove_file(&file);
    let why = match outcome {
        Ok(Some(status)) if status.success() => return true,
        // The process has reported it.
        Ok(Some(status)) if status.code() == Some(1) => return false,
        Ok(Some(status)) => format!("the process ends with {status}"),
        Ok(None) => format!("no end after {} s", MAX_SILENCE.as_secs()),
        Err(why) => {
            say(&format!("error: {}: {why}", target.name));
            return false;
        }
    };
    let Some(number) = number else {
        say(&format!("{}: {why}, before the first input", target.name));
        return false;
    };
    let input = Campaign::new(target, arguments.seed, measure).input(number);
    report(target, arguments, number, &input, &why);
    false
}

/// Waits for the end of a process. Returns `None`, and ends it, if it hangs.
fn wait(mut child: Child, file: &Path) -> std::io::Result<Option<ExitStatus>> {
    let (mut last, mut changed) = (None, Instant::now());
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        let number = last_number(file);
        if number != last {
            (last, changed) = (number, Instant::now());
        }
        if changed.elapsed() > MAX_SILENCE {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

fn last_number(file: &Path) -> Option<u64> {
    let mut bytes = [0; 8];
    File::open(file).and_then(|mut file| file.read_exact(&mut bytes)).ok()?;
    Some(u64::from_le_bytes(bytes))
}

//! A cell that a person guides by hand: its devices send, nothing is sent to an arm, and questions are asked on the
//! terminal.

mod arm;
pub(super) mod mount;
mod tables;
mod toml_file;
pub(super) mod vectors;

use std::io::BufRead;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

use tactflow_runtime::cli::{FAULTED, INTERRUPTED, Shell};
use tactflow_runtime::device::{Attached, Driver, Output};
use tactflow_runtime::engine::Interrupt;
use tactflow_runtime::graph::{BenchDevice, OpenBench, open_bench};
use tactflow_runtime::signal::Signal;
use tactflow_runtime::source::quoted;

pub(super) use arm::{GuidedArm, StillPosture, chain};
pub(super) use tables::headed;
pub(super) use toml_file::{TomlFile, joint_numbers, numbers};

/// Longest time between two looks at the devices, which wake the thread when they sample.
const LOOK: Duration = Duration::from_millis(1);

/// Why a dialogue ended before its last answer.
#[derive(Debug)]
pub(super) enum Left {
    /// Ctrl-C or another signal.
    Interrupted,
    /// The standard input has ended.
    InputEnded,
    /// A device ended, or does not send.
    Failed(String),
}

impl Left {
    /// Prints why the dialogue ended, and returns the exit code. Nothing was written.
    pub(super) fn report(self, shell: &Shell) -> u8 {
        match self {
            Self::Interrupted => {
                shell.say("interrupted; nothing is written");
                return INTERRUPTED;
            }
            Self::InputEnded => shell.error("the standard input has ended before the last answer; nothing is written"),
            Self::Failed(why) => shell.error(why),
        }
        FAULTED
    }
}

/// An output of a device of the cell.
pub(super) struct CellPort<T> {
    device: usize,
    output: Output<T>,
}

impl<T> Clone for CellPort<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for CellPort<T> {}

impl<T: Signal> CellPort<T> {
    /// Returns the output in the description of its device.
    pub(super) const fn output(self) -> Output<T> {
        self.output
    }
}

/// A role that the bench binds, and the device that fills it.
#[derive(Debug, Clone)]
pub(super) struct BoundRole {
    pub(super) role: String,
    /// Name of the device in the bench.
    pub(super) device: String,
    /// Side of the device, if it has several.
    pub(super) side: Option<String>,
}

/// The live devices of a bench. All of them are mute: nothing moves.
pub(super) struct GuidedCell<'s> {
    shell: &'s Shell,
    devices: Vec<(String, Attached)>,
    /// Devices that step with a graph, so nobody can guide them.
    stepped: Vec<String>,
    bound: Vec<BoundRole>,
    interrupt: Interrupt,
    /// Lines of the standard input, from the first question on.
    lines: Option<Receiver<String>>,
}

impl<'s> GuidedCell<'s> {
    /// Opens a bench and connects to its live devices.
    ///
    /// # Errors
    /// The exit code; why it failed is printed.
    pub(super) fn open(shell: &'s Shell, path: &Path) -> Result<Self, u8> {
        let bench = open_bench(shell.catalogue(), path).map_err(|report| shell.reject(&report))?;
        let interrupt =
            Interrupt::catch().map_err(|error| shell.refuse(format_args!("cannot watch for Ctrl-C: {error}")))?;
        let OpenBench { devices, bind } = bench;
        let (mut started, mut stepped) = (Vec::new(), Vec::new());
        for BenchDevice { name, opened, .. } in devices {
            let Driver::Live(driver) = opened.driver else {
                stepped.push(name);
                continue;
            };
            let attached = Attached::listen(&name, opened.description, driver)
                .map_err(|error| shell.refuse(format_args!("cannot start device `{name}`: {error}")))?;
            started.push((name, attached));
        }
        let bound = bind.into_iter().map(|(role, word)| bound_role(role, &word)).collect();
        Ok(Self { shell, devices: started, stepped, bound, interrupt, lines: None })
    }

    pub(super) const fn shell(&self) -> &'s Shell {
        self.shell
    }

    /// Returns the role `wanted`, or the only role whose device has an output of that name and kind.
    ///
    /// # Errors
    /// If there is none, or if there are several and none is wanted; `option` is the option that names one.
    pub(super) fn role<T: Signal>(
        &self,
        output: &str,
        what: &str,
        wanted: Option<&str>,
        option: &str,
    ) -> Result<(BoundRole, CellPort<T>), String> {
        let fitting: Vec<_> =
            self.bound.iter().filter_map(|bound| Some((bound.clone(), self.port::<T>(bound, output)?))).collect();
        if fitting.is_empty() {
            return Err(self.none_of(what));
        }
        choose(fitting, what, wanted, option)
    }

    /// Returns an output of the device that fills a role, if it is live and has one of that name and kind.
    pub(super) fn port<T: Signal>(&self, bound: &BoundRole, output: &str) -> Option<CellPort<T>> {
        let device = self.devices.iter().position(|(name, _)| *name == bound.device)?;
        let output = self.devices[device].1.description().output_on(bound.side.as_deref(), output)?;
        Some(CellPort { device, output })
    }

    /// Returns the roles that the bench binds.
    pub(super) fn bound(&self) -> &[BoundRole] {
        &self.bound
    }

    /// Returns the device of a port.
    pub(super) fn device<T>(&self, port: CellPort<T>) -> &Attached {
        &self.devices[port.device].1
    }

    /// Returns the newest value of a port, or `None` while it is absent.
    pub(super) fn read<T: Signal>(&self, port: CellPort<T>) -> Option<&T> {
        self.device(port).read(port.output)
    }

    /// Returns how often a port was written.
    pub(super) fn writes<T: Signal>(&self, port: CellPort<T>) -> u64 {
        self.device(port).writes(port.output)
    }

    fn none_of(&self, what: &str) -> String {
        match self.stepped.as_slice() {
            [] => format!("the bench binds no live device with {what}"),
            [name, ..] => format!(
                "the bench binds no live device with {what}: device `{name}` runs step by step with a graph, so nobody can \
                 guide it"
            ),
        }
    }

    /// Asks a question and returns the next line of the standard input, without spaces around it.
    ///
    /// # Errors
    /// If the dialogue ends first.
    pub(super) fn ask(&mut self, question: &str) -> Result<String, Left> {
        self.shell.say(question);
        loop {
            if let Some(line) = self.answer()? {
                return Ok(line);
            }
        }
    }

    /// Prints the changes of a bench file and writes them after a typed `yes`. Changes with which the bench does not load
    /// are refused without a question. Returns the exit code.
    ///
    /// # Errors
    /// If the dialogue ends first.
    pub(super) fn write_after_yes(&mut self, bench: &TomlFile) -> Result<u8, Left> {
        if bench.is_unchanged() {
            self.shell.say("nothing was measured, so nothing is written");
            return Ok(0);
        }
        let (path, changes) = (bench.path().display(), bench.changes());
        if let Err(why) = bench.check(self.shell.catalogue()) {
            self.shell.say(&format!("\n{changes}\n"));
            self.shell.error(why);
            return Ok(FAULTED);
        }
        let answer = self.ask(&format!("\n{changes}\n\nType `yes` to write these lines into {path}:"))?;
        if answer != "yes" {
            self.shell.say("nothing is written");
            return Ok(0);
        }
        Ok(match bench.write() {
            Ok(()) => {
                self.shell.say(&format!("wrote {path}"));
                0
            }
            Err(why) => {
                self.shell.error(why);
                FAULTED
            }
        })
    }

    /// Waits for `time` [s], and calls `each` after each look at the devices until it returns a value.
    ///
    /// # Errors
    /// If the dialogue ends first.
    pub(super) fn watch<R>(&mut self, time: f64, mut each: impl FnMut(&Self) -> Option<R>) -> Result<Option<R>, Left> {
        let end = Instant::now() + Duration::from_secs_f64(time);
        while Instant::now() < end {
            thread::park_timeout(LOOK);
            self.look()?;
            if let Some(result) = each(self) {
                return Ok(Some(result));
            }
        }
        Ok(None)
    }

    /// Receives what the devices have sent, and the next line of the standard input, if there is one.
    fn answer(&mut self) -> Result<Option<String>, Left> {
        self.look()?;
        match self.lines.get_or_insert_with(read_lines).recv_timeout(LOOK) {
            Ok(line) => Ok(Some(line.trim().to_owned())),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(Left::InputEnded),
        }
    }

    fn look(&mut self) -> Result<(), Left> {
        if self.interrupt.is_requested() {
            return Err(Left::Interrupted);
        }
        for i in 0..self.devices.len() {
            self.devices[i].1.receive();
            if self.devices[i].1.has_ended() {
                let (name, attached) = self.devices.swap_remove(i);
                let why = attached.stop("it has ended").err().map_or_else(String::new, |error| format!(": {error}"));
                return Err(Left::Failed(format!("device `{name}` has ended{why}")));
            }
        }
        Ok(())
    }
}

/// Splits the word that a bench binds: a device, perhaps with its side.
pub(super) fn bound_role(role: String, word: &str) -> BoundRole {
    let (device, side) = word.split_once('.').map_or((word, None), |(device, side)| (device, Some(side.to_owned())));
    BoundRole { role, device: device.to_owned(), side }
}

/// Returns the role `wanted` among those that have `what`, or the only one; `option` is the option that names one.
///
/// # Errors
/// If there is no such role, or if there are several and none is wanted.
pub(super) fn choose<T>(
    mut fitting: Vec<(BoundRole, T)>,
    what: &str,
    wanted: Option<&str>,
    option: &str,
) -> Result<(BoundRole, T), String> {
    let names = quoted(fitting.iter().map(|(bound, _)| &bound.role));
    // A device that fills several roles is the same arm in each.
    let is_one = fitting.windows(2).all(|two| (&two[0].0.device, &two[0].0.side) == (&two[1].0.device, &two[1].0.side));
    let index = match wanted {
        None if is_one => 0,
        None => return Err(format!("the bench binds several roles with {what}: name one of {names} with `{option}`")),
        Some(wanted) => fitting.iter().position(|(bound, _)| bound.role == wanted).ok_or_else(|| {
            format!("the bench binds no role `{wanted}` with {what}: write `{option}` with one of {names}")
        })?,
    };
    Ok(fitting.swap_remove(index))
}

/// Reads the standard input on a thread of its own, so that Ctrl-C and the devices are noticed meanwhile.
fn read_lines() -> Receiver<String> {
    let (sender, receiver) = channel();
    thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    receiver
}

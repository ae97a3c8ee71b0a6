//! A program in virtual time: the tick waits for each answer, so two runs are the same.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use tactflow_runtime::device::{Commands, DeviceError, Samples, Stepped};
use tokio::runtime::Runtime;

use super::launch::Launch;
use super::ports::Ports;
use super::session::Session;
use super::wire::{Question, Value};

/// Time between two looks at whether the operator ends the run.
const LOOK: Duration = Duration::from_millis(20);

/// A program that answers in lockstep.
pub(super) struct InLockstep {
    launch: Arc<Launch>,
    ports: Ports,
    /// The program, once there was a question.
    session: Option<(Runtime, Session)>,
    is_ending: Option<&'static AtomicBool>,
}

impl InLockstep {
    pub(super) fn new(launch: Arc<Launch>, ports: Ports) -> Self {
        Self { launch, ports, session: None, is_ending: None }
    }

    fn answer(&mut self, question: Question, commands: &Commands) -> Result<Vec<Value>, String> {
        let is_ending = self.is_ending;
        if self.session.is_none() {
            let inputs = self.ports.shapes(commands, &self.launch.signature);
            let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build();
            let runtime = runtime.map_err(|error| error.to_string())?;
            let started = runtime.block_on(until_ended(is_ending, Session::start(&self.launch, inputs)))?;
            self.session = Some((runtime, started));
        }
        let Some((runtime, session)) = &mut self.session else { return Err("it has not started".to_owned()) };
        runtime.block_on(until_ended(is_ending, session.ask(question)))
    }
}

/// Waits for something, but no longer than the run goes on.
async fn until_ended<T>(
    is_ending: Option<&'static AtomicBool>,
    wanted: impl Future<Output = Result<T, String>>,
) -> Result<T, String> {
    tokio::pin!(wanted);
    loop {
        if let Ok(got) = tokio::time::timeout(LOOK, &mut wanted).await {
            return got;
        }
        if is_ending.is_some_and(|flag| flag.load(Ordering::Relaxed)) {
            return Err("the run ends before it has answered".to_owned());
        }
    }
}

impl Stepped for InLockstep {
    fn next(&self) -> Option<i64> {
        // It never ends a run.
        Some(i64::MAX)
    }

    fn exchange(&mut self, now: i64, commands: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        // The inputs are those of the last tick.
        let Some(question) = self.ports.question(commands, now - 1) else { return Ok(()) };
        let (number, stamp) = (question.number, question.stamp);
        let values = self.answer(question, commands).inspect_err(|_| self.session = None)?;
        self.ports.write(&values, stamp, number, samples);
        Ok(())
    }

    fn watch(&mut self, is_ending: &'static AtomicBool) {
        self.is_ending = Some(is_ending);
    }

    fn finish(&mut self, _: &str) {
        if let Some((_, session)) = &mut self.session {
            session.dismiss();
        }
        self.session = None;
    }
}

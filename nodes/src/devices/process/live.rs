//! A program in real time: it gets the newest values when it has answered, and a tick never waits for it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use async_trait::async_trait;
use tactflow_runtime::device::{DeviceError, Link, Live};

use super::launch::Launch;
use super::ports::Ports;
use super::session::Session;

/// Nominal periods after which a sample is too old, where the graph says nothing else.
const MAX_PERIODS: u32 = 5;
/// Shortest time between two warnings.
const WARN: Duration = Duration::from_secs(5);

/// A program beside the tick.
pub(super) struct Beside {
    launch: Arc<Launch>,
    ports: Ports,
    warned: Option<Instant>,
}

impl Beside {
    pub(super) fn new(launch: Arc<Launch>, ports: Ports) -> Self {
        Self { launch, ports, warned: None }
    }

    /// Counts an answer that took so long that its values become too old before the next ones come, and says what to write
    /// instead. By then they are as old as two answers take.
    fn judge(&mut self, took: Duration, link: &mut Link) {
        let Launch { signature, period, .. } = &*self.launch;
        if 2 * took <= MAX_PERIODS * *period {
            return;
        }
        link.count("slow answers");
        if self.warned.is_none_or(|at| at.elapsed() >= WARN) {
            self.warned = Some(Instant::now());
            let [took, period] = [took, *period].map(|time| time.as_secs_f64() * 1e3);
            tracing::warn!(
                "an answer of `{}` took {took:.0} ms, so its values are older than {MAX_PERIODS} times `period_ms` ({period} ms) \
                 before the next ones come, and too old unless the graph says otherwise: write the time that an answer \
                 takes as `period_ms`",
                signature.name
            );
        }
    }
}

#[async_trait]
impl Live for Beside {
    async fn run(mut self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        let stopped = link.stopped();
        tokio::pin!(stopped);
        let inputs = self.ports.shapes(link.commands(), &self.launch.signature);
        let mut session = tokio::select! {
            biased;
            () = &mut stopped => return Ok(()),
            session = Session::start(&self.launch, inputs) => session?,
        };
        loop {
            let commanded = link.commanded();
            tokio::select! {
                biased;
                () = &mut stopped => break,
                received = session.frame() => {
                    received?;
                    return Err("it sends an answer, and nothing was asked".into());
                }
                () = commanded => {}
            }
            let now = link.stamp(Instant::now());
            let Some(question) = self.ports.question(link.commands(), now) else { continue };
            link.count_each(&[("questions", 1), ("skipped inputs", self.ports.skipped())]);
            let (number, stamp) = (question.number, question.stamp);
            let asked = Instant::now();
            let values = tokio::select! {
                biased;
                () = &mut stopped => break,
                values = session.ask(question) => values?,
            };
            self.judge(asked.elapsed(), &mut link);
            link.publish(|samples| self.ports.write(&values, stamp, number, samples));
        }
        session.dismiss();
        Ok(())
    }
}

//! A program in real time: it gets the newest values when it has answered, and a tick never waits for it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use async_trait::async_trait;
use tactflow_runtime::device::{DeviceError, Link, Live};
use tactflow_runtime::graph::DEFAULT_MAX_AGE_PERIODS;

use super::launch::Launch;
use super::ports::Ports;
use super::session::Session;
use crate::devices::seldom::Seldom;

/// A program beside the tick.
pub(super) struct Beside {
    launch: Arc<Launch>,
    ports: Ports,
    warnings: Seldom,
}

impl Beside {
    pub(super) fn new(launch: Arc<Launch>, ports: Ports) -> Self {
        Self { launch, ports, warnings: Seldom::default() }
    }

    /// Counts an answer that took so long that its values become too old before the next ones come, and says what to write
    /// instead. By then they are as old as two answers take.
    fn judge(&mut self, took: Duration, link: &mut Link) {
        let [took, period] = [took, self.launch.period].map(|time| time.as_secs_f64() * 1e3);
        if 2.0 * took <= DEFAULT_MAX_AGE_PERIODS * period {
            return;
        }
        link.count("slow answers");
        if self.warnings.is_due() {
            tracing::warn!(
                "an answer of `{}` took {took:.0} ms, so its values are older than {DEFAULT_MAX_AGE_PERIODS} times \
                 `period_ms` ({period} ms) before the next ones come, and too old unless the graph says otherwise: write the \
                 time that an answer takes as `period_ms`",
                self.launch.signature.name
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

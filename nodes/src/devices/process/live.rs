//! A program in real time: it gets the newest values when it has answered, and a tick never waits for it.

use std::sync::Arc;
use std::time::Instant;

use async_trait::async_trait;
use tactflow_runtime::device::{DeviceError, Link, Live};

use super::launch::Launch;
use super::ports::Ports;
use super::session::Session;

/// A program beside the tick.
pub(super) struct Beside {
    launch: Arc<Launch>,
    ports: Ports,
}

impl Beside {
    pub(super) fn new(launch: Arc<Launch>, ports: Ports) -> Self {
        Self { launch, ports }
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
            let values = tokio::select! {
                biased;
                () = &mut stopped => break,
                values = session.ask(question) => values?,
            };
            link.publish(|samples| self.ports.write(&values, stamp, number, samples));
        }
        session.dismiss();
        Ok(())
    }
}

//! A program as a pad: it sends frames by itself.

use std::sync::Arc;

use async_trait::async_trait;
use tactflow_runtime::device::{DeviceError, Link, Live, Output};
use tactflow_runtime::signal::{Image, VectorImage};

use super::child::Received;
use super::launch::Launch;
use super::session::Session;
use super::wire::{self, Frame, Value};

/// The stamp of a frame of a program that has no clock of its own.
const NO_CLOCK: i64 = i64::MIN;

/// Most frames that are skipped at once, so that a program that sends without a pause is heard too.
const MAX_SKIPPED: usize = 1000;

/// A program that is a pad.
pub(super) struct PadProcess {
    launch: Arc<Launch>,
    image: Output<Image>,
    /// Of a pad with three axes.
    vectors: Option<Output<VectorImage>>,
}

impl PadProcess {
    pub(super) const fn new(launch: Arc<Launch>, image: Output<Image>, vectors: Option<Output<VectorImage>>) -> Self {
        Self { launch, image, vectors }
    }

    fn publish(&self, frame: &Frame, link: &mut Link) -> Result<(), String> {
        let values = wire::values(frame, &self.launch.signature)?;
        let stamp = if frame.stamp == NO_CLOCK { link.arrival() } else { link.stamp_of(frame.stamp) };
        let number = frame.number;
        link.publish(|samples| match (&values[..], self.vectors) {
            ([Value::Image(cells)], None) => {
                samples.write(self.image, stamp, number).cells_mut().copy_from_slice(cells);
            }
            ([Value::VectorImage(cells)], Some(vectors)) => {
                samples.write(vectors, stamp, number).cells_mut().copy_from_slice(cells);
                let image = samples.write(self.image, stamp, number).cells_mut();
                image.iter_mut().zip(cells).for_each(|(normal, [_, _, z])| *normal = *z);
            }
            (_, vectors) => {
                samples.clear(self.image, stamp, number);
                vectors.into_iter().for_each(|vectors| samples.clear(vectors, stamp, number));
            }
        });
        Ok(())
    }
}

#[async_trait]
impl Live for PadProcess {
    async fn run(self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        let stopped = link.stopped();
        tokio::pin!(stopped);
        let mut session = tokio::select! {
            biased;
            () = &mut stopped => return Ok(()),
            session = Session::start(&self.launch, Vec::new()) => session?,
        };
        loop {
            let received = tokio::select! {
                biased;
                () = &mut stopped => break,
                received = tokio::time::timeout(self.launch.timeout, session.frame()) => received,
            };
            let silent = |_| format!("no frame for {} ms (`timeout_ms`)", self.launch.timeout.as_millis());
            let mut frame = received.map_err(silent)??;
            // The newest one: a program that sends too much must not fill the tick with old frames.
            for _ in 0..MAX_SKIPPED {
                let Some(received) = session.waiting() else { break };
                link.count("skipped frames");
                match received {
                    Received::Frame(newer) => frame = newer,
                    Received::Broken(why) => return Err(why.into()),
                    Received::Line(_) => return Err("it states its signature twice".into()),
                }
            }
            self.publish(&frame, &mut link)?;
        }
        session.dismiss();
        Ok(())
    }
}

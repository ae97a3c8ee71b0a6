//! Live devices: an async driver on one side, preallocated latest-value slots, and the tick on the other side.

use std::borrow::Cow;
use std::sync::Arc;
use std::time::Instant;

use async_trait::async_trait;
use tokio::sync::{Notify, watch};
use triple_buffer::TripleBuffer;

use super::{Commands, DeviceError, Output, Samples};
use crate::signal::Signal;

/// A device that runs on its own, in real time.
///
/// The driver of a real robot declares a command timeout of its own. Only this timeout stops the arm after something
/// that the process cannot observe, such as `kill -9` or a loss of power.
#[async_trait]
pub trait Live: Send {
    /// Runs until [`Link::stopped`] or a failure.
    ///
    /// # Errors
    /// When the device fails; the run ends.
    async fn run(self: Box<Self>, link: Link) -> Result<(), DeviceError>;
}

/// A live device's end of the link to the graph.
pub struct Link {
    staging: Samples,
    samples: triple_buffer::Input<Samples>,
    commands: triple_buffer::Output<Commands>,
    sampled: Arc<Notify>,
    commanded: Arc<Notify>,
    stop: watch::Receiver<bool>,
    epoch: Instant,
}

impl Link {
    /// A moment in the graph's clock [ns].
    #[must_use]
    pub fn stamp(&self, at: Instant) -> i64 {
        at.saturating_duration_since(self.epoch).as_nanos() as i64
    }

    /// Writes samples and publishes them; the graph sees the newest of each port.
    pub fn publish(&mut self, write: impl FnOnce(&mut Samples)) {
        self.hand_over(write);
        self.sampled.notify_one();
    }

    /// Makes a port absent until it is written again; see [`Samples::lost`]. The driver goes on, to reconnect for
    /// example.
    pub fn lost<T: Signal>(&mut self, port: Output<T>, why: impl Into<Cow<'static, str>>) {
        self.hand_over(|samples| samples.lost(port, why));
    }

    /// Counts something for the summary of the run, as a plural noun: `"bad frames"`.
    pub fn count(&mut self, what: &'static str) {
        self.hand_over(|samples| samples.count(what));
    }

    fn hand_over(&mut self, write: impl FnOnce(&mut Samples)) {
        write(&mut self.staging);
        self.samples.input_buffer_mut().copy_from(&self.staging);
        self.samples.publish();
    }

    /// The newest commands.
    pub fn commands(&mut self) -> &Commands {
        self.commands.read()
    }

    /// Waits for the next commands. The future does not borrow the link.
    pub fn commanded(&self) -> impl Future<Output = ()> + Send + use<> {
        let commanded = Arc::clone(&self.commanded);
        async move { commanded.notified().await }
    }

    /// Waits for the end of the run. The future does not borrow the link.
    pub fn stopped(&self) -> impl Future<Output = ()> + Send + use<> {
        let mut stop = self.stop.clone();
        async move {
            // An error means that the graph's end is gone, which is an end too.
            let _ = stop.wait_for(|stop| *stop).await;
        }
    }
}

/// The graph's end of the link to a live device.
pub(crate) struct Linked {
    pub(crate) samples: triple_buffer::Output<Samples>,
    pub(crate) commands: triple_buffer::Input<Commands>,
    pub(crate) sampled: Arc<Notify>,
    pub(crate) commanded: Arc<Notify>,
    pub(crate) stop: watch::Sender<bool>,
}

pub(crate) fn link(samples: &Samples, commands: &Commands, epoch: Instant) -> (Link, Linked) {
    let (samples_in, samples_out) = TripleBuffer::new(samples).split();
    let (commands_in, commands_out) = TripleBuffer::new(commands).split();
    let (sampled, commanded) = (Arc::new(Notify::new()), Arc::new(Notify::new()));
    let (stop, stopping) = watch::channel(false);
    let link = Link {
        staging: samples.clone(),
        samples: samples_in,
        commands: commands_out,
        sampled: Arc::clone(&sampled),
        commanded: Arc::clone(&commanded),
        stop: stopping,
        epoch,
    };
    (link, Linked { samples: samples_out, commands: commands_in, sampled, commanded, stop })
}

impl Linked {
    /// Hands over the commands.
    pub(crate) fn send(&mut self, commands: &Commands) {
        self.commands.input_buffer_mut().copy_from(commands);
        self.commands.publish();
        self.commanded.notify_one();
    }

    /// Takes the newest samples. Buffers rotate; nothing is copied. Returns whether the device has sampled.
    pub(crate) fn receive(&mut self, samples: &mut Samples) -> bool {
        let before = samples.writes;
        if self.samples.update() {
            std::mem::swap(samples, self.samples.output_buffer_mut());
        }
        samples.writes != before
    }
}

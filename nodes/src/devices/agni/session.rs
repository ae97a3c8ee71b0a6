//! A session with a device: the handshake, and then its messages.

use std::time::Duration;

use tokio::time::{Instant, timeout_at};

use super::messages::{
    ASK_CONFIG, ASK_SERIAL, ASK_TOPOLOGY, Config, Fault, Message, Messages, START, STOP, set_period,
};
use crate::devices::link::Connection;

/// Time without a byte after which a stopped device has nothing more to say.
const QUIET: Duration = Duration::from_millis(30);
/// Longest time to wait for this silence.
const MAX_FLUSH: Duration = Duration::from_millis(300);
/// Time to wait for the configuration, and how often it is asked for.
const CONFIG_TIMEOUT: Duration = Duration::from_millis(500);
const CONFIG_TRIALS: usize = 3;
/// Time to wait for what a device need not answer.
const OPTIONAL_TIMEOUT: Duration = Duration::from_millis(100);

/// What a device has said in the handshake.
#[derive(Debug, Default)]
pub(super) struct Identity {
    pub(super) config: Config,
    /// Its serial number; `None` if it does not answer.
    pub(super) serial: Option<String>,
}

/// A connection to a device.
pub(super) struct Session {
    port: Connection,
    /// The bytes that have arrived last.
    arrived: Vec<u8>,
    pub(super) messages: Messages,
    /// The last error that the device has reported.
    pub(super) fault: Option<Fault>,
}

impl Session {
    /// Begins a session on a port.
    pub(super) fn new(port: Connection) -> Self {
        Self { port, arrived: Vec::new(), messages: Messages::default(), fault: None }
    }

    /// Stops the device, and asks what it is: the configuration, the serial number and the topology.
    ///
    /// # Errors
    /// If the port breaks, or no configuration comes.
    pub(super) async fn greet(&mut self) -> Result<Identity, String> {
        self.send(&STOP).await?;
        self.flush().await?;
        let config = self.config().await?;
        self.messages.configure(&config);
        self.send(&ASK_SERIAL).await?;
        let serial = self.answer(OPTIONAL_TIMEOUT, |message| match message {
            Message::Serial(serial) => Some(serial),
            _ => None,
        });
        let serial = serial.await?;
        // Whatever comes is read, so that it does not stand before the first frame.
        self.send(&ASK_TOPOLOGY).await?;
        self.answer(OPTIONAL_TIMEOUT, |message| (message == Message::Other).then_some(())).await?;
        self.fault = None;
        Ok(Identity { config, serial })
    }

    async fn config(&mut self) -> Result<Config, String> {
        for _ in 0..CONFIG_TRIALS {
            self.send(&ASK_CONFIG).await?;
            let config = self.answer(CONFIG_TIMEOUT, |message| match message {
                Message::Config(config) => Some(config),
                _ => None,
            });
            if let Some(config) = config.await? {
                return Ok(config);
            }
        }
        let fault = self.fault.take().map_or_else(String::new, |fault| format!("; it reports {fault}"));
        Err(format!("the device does not send its configuration{fault}"))
    }

    /// Sets the time between two frames [0.1 ms], if it is given, and starts all sensors.
    ///
    /// # Errors
    /// If the port breaks.
    pub(super) async fn start(&mut self, sensors: impl Iterator<Item = u8>, tenths: Option<u16>) -> Result<(), String> {
        if let Some(tenths) = tenths {
            for sensor in sensors {
                self.send(&set_period(sensor, tenths)).await?;
            }
        }
        self.send(&START).await
    }

    /// Waits for bytes, for a time. Returns whether some have come; [`Messages`] has them.
    ///
    /// # Errors
    /// If the port breaks.
    pub(super) async fn receive(&mut self, until: Instant) -> Result<bool, String> {
        match timeout_at(until, self.port.receive(&mut self.arrived)).await {
            Ok(received) => {
                received?;
                self.messages.push(&self.arrived);
                Ok(true)
            }
            Err(_) => Ok(false),
        }
    }

    /// Stops the device at the end of a run, if it still listens.
    pub(super) async fn stop(&mut self) {
        let _ = self.send(&STOP).await;
    }

    async fn send(&mut self, message: &[u8]) -> Result<(), String> {
        self.port.send(message).await
    }

    /// Reads what is on its way until the device is silent.
    async fn flush(&mut self) -> Result<(), String> {
        let end = Instant::now() + MAX_FLUSH;
        while Instant::now() < end && self.receive(end.min(Instant::now() + QUIET)).await? {
            self.messages.clear();
        }
        self.messages.clear();
        Ok(())
    }

    /// Waits for a message that `pick` takes, and keeps the last error of the device.
    async fn answer<T>(
        &mut self,
        limit: Duration,
        pick: impl Fn(Message<'_>) -> Option<T>,
    ) -> Result<Option<T>, String> {
        let end = Instant::now() + limit;
        loop {
            while let Some(message) = self.messages.next() {
                match message {
                    Message::Fault(fault) => self.fault = Some(fault),
                    other => {
                        if let Some(picked) = pick(other) {
                            return Ok(Some(picked));
                        }
                    }
                }
            }
            if !self.receive(end).await? {
                return Ok(None);
            }
        }
    }
}

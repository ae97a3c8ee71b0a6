//! The connection that the state of the robot comes from: RTDE, protocol version 2.

use std::io::{self, ErrorKind};
use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::timeout;

use super::packet::{self, Splitter};
use super::recipe::{Output, Recipe, Refusal, State};
use super::template::Version;

/// Number of bytes that are received at once.
pub(super) const RECEIVED_BYTES: usize = 1 << 14;
/// Version of the protocol.
const PROTOCOL: u16 = 2;
/// Number of packets that may come before an answer. A stream that another session left is longer.
const MAX_OTHERS: usize = 10_000;

/// Why there is no stream of states.
#[derive(Debug)]
pub(super) enum Failure {
    /// Another attempt can succeed.
    Again(String),
    /// No attempt can succeed.
    Final(String),
    /// The controller does not know these outputs.
    Without(Vec<Output>),
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Again(error.to_string())
    }
}

/// What the driver asks of the controller.
#[derive(Debug, Clone)]
pub(super) struct Request {
    /// Where the controller listens, as `host:port`.
    pub(super) address: String,
    /// Samples per second [Hz].
    pub(super) rate_hz: f64,
    /// Longest time of the connection and of each answer.
    pub(super) patience: Duration,
    /// Whether the version of the controller's software is needed.
    pub(super) needs_version: bool,
}

/// A connection on which states arrive.
#[derive(Debug)]
pub(super) struct Stream {
    stream: TcpStream,
    splitter: Splitter,
    chunk: Box<[u8]>,
    recipe: Option<Recipe>,
    /// Version of the controller's software, if it was asked for.
    pub(super) version: Option<Version>,
    /// Packets that are no sample and no text.
    pub(super) bad_packets: u64,
}

impl Stream {
    /// Connects and starts the stream. Outputs that an old controller does not know are left out.
    ///
    /// # Errors
    /// Why there is no stream, and whether another attempt can succeed.
    pub(super) async fn open(request: &Request) -> Result<Self, Failure> {
        let mut outputs = Output::all().to_vec();
        loop {
            // A controller that refuses outputs is asked on a new connection.
            match Self::start(request, &outputs).await {
                Err(Failure::Without(unknown)) if unknown.iter().any(|output| outputs.contains(output)) => {
                    outputs.retain(|output| !unknown.contains(output));
                }
                other => return other,
            }
        }
    }

    async fn start(request: &Request, outputs: &[Output]) -> Result<Self, Failure> {
        let late = |_| Failure::Again(format!("no answer for {:?}", request.patience));
        let stream = timeout(request.patience, TcpStream::connect(&request.address)).await.map_err(late)??;
        stream.set_nodelay(true)?;
        let mut stream = Self {
            stream,
            splitter: Splitter::new(RECEIVED_BYTES),
            chunk: vec![0; RECEIVED_BYTES].into(),
            recipe: None,
            version: None,
            bad_packets: 0,
        };
        timeout(request.patience, stream.shake_hands(request, outputs)).await.map_err(late)??;
        Ok(stream)
    }

    async fn shake_hands(&mut self, request: &Request, outputs: &[Output]) -> Result<(), Failure> {
        let version = packet::packet(packet::VERSION, &PROTOCOL.to_be_bytes());
        if self.ask(&version, packet::VERSION).await? != [1] {
            let why = "it refuses version 2 of RTDE: it needs PolyScope 3.3 (CB3), or any version of the e-Series";
            return Err(Failure::Final(why.into()));
        }
        if request.needs_version {
            let answer = self.ask(&packet::packet(packet::CONTROLLER, &[]), packet::CONTROLLER).await?;
            self.version = controller_version(&answer);
        }
        let names: Vec<&str> = outputs.iter().map(|output| output.name()).collect();
        let answer = self.ask(&packet::outputs_request(request.rate_hz, &names), packet::OUTPUTS).await?;
        self.recipe = Some(Recipe::read(outputs, &answer).map_err(|refusal| match refusal {
            Refusal::Without(outputs) => Failure::Without(outputs),
            Refusal::Final(why) => Failure::Final(why),
        })?);
        if self.ask(&packet::packet(packet::START, &[]), packet::START).await? != [1] {
            return Err(Failure::Again("it refuses to start its stream of states".into()));
        }
        Ok(())
    }

    /// Sends a packet and waits for the answer with a command. Texts are logged, and other packets are passed over.
    async fn ask(&mut self, request: &[u8], command: u8) -> Result<Vec<u8>, Failure> {
        self.stream.write_all(request).await?;
        for _ in 0..MAX_OTHERS {
            while let Some((found, payload)) = self.splitter.take().map_err(Failure::Again)? {
                if found == command {
                    return Ok(payload.to_vec());
                }
                log(found, payload);
            }
            let count = self.stream.read(&mut self.chunk).await?;
            if count == 0 {
                return Err(Failure::Again(closed(&self.splitter)));
            }
            self.splitter.feed(&self.chunk[..count]);
        }
        Err(Failure::Again("it sends other packets instead of an answer".into()))
    }

    /// Waits until bytes have arrived, or the connection is broken.
    pub(super) async fn readable(&self) -> io::Result<()> {
        self.stream.readable().await
    }

    /// Reads what has arrived. Calls `state` for each state, in order.
    ///
    /// # Errors
    /// Why the connection has ended.
    pub(super) fn receive(&mut self, mut state: impl FnMut(State)) -> Result<(), String> {
        let Some(recipe) = &self.recipe else { return Ok(()) };
        // A bound, so that a peer that floods us does not keep the driver from its other work.
        for _ in 0..16 {
            let count = match self.stream.try_read(&mut self.chunk) {
                Ok(0) => return Err(closed(&self.splitter)),
                Ok(count) => count,
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(error) => return Err(error.to_string()),
            };
            self.splitter.feed(&self.chunk[..count]);
            while let Some((command, payload)) = self.splitter.take()? {
                let found = (command == packet::SAMPLE).then(|| recipe.state(payload)).flatten();
                match found {
                    Some(found) => state(found),
                    None => self.bad_packets += u64::from(!log(command, payload)),
                }
            }
        }
        Ok(())
    }

    /// Returns our address, as the robot sees it.
    pub(super) fn own_address(&self) -> io::Result<IpAddr> {
        self.stream.local_addr().map(|address: SocketAddr| address.ip())
    }

    /// Returns the address of the robot.
    pub(super) fn peer_address(&self) -> io::Result<IpAddr> {
        self.stream.peer_addr().map(|address: SocketAddr| address.ip())
    }
}

fn closed(splitter: &Splitter) -> String {
    let middle = if splitter.is_in_a_packet() { " in the middle of a packet" } else { "" };
    format!("the robot has closed the connection{middle}")
}

/// Logs a text of the controller. Returns whether the packet is one.
fn log(command: u8, payload: &[u8]) -> bool {
    let Some(text) = (command == packet::TEXT).then(|| packet::text(payload)).flatten() else { return false };
    let (source, words) = (text.source, text.text);
    match text.level {
        0 | 1 => tracing::error!("the robot ({source}): {words}"),
        2 => tracing::warn!("the robot ({source}): {words}"),
        _ => tracing::info!("the robot ({source}): {words}"),
    }
    true
}

/// Reads a version of the controller's software: major, minor, bugfix and build, each a `u32`.
pub(super) fn controller_version(answer: &[u8]) -> Option<Version> {
    let (numbers, _) = answer.as_chunks::<4>();
    let [major, minor, bugfix, ..] = numbers else { return None };
    Some([major, minor, bugfix].map(|number| u32::from_be_bytes(*number)))
}

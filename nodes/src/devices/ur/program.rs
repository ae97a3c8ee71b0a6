//! The program on the robot: how it gets there, and the connection that it opens to us.

use std::io::{self, ErrorKind};
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tokio::time::timeout;

use super::message;

/// Longest line with which a node of External Control asks for its program [bytes].
const MAX_REQUEST: usize = 256;
/// Longest time that such a request, or the sending of a program, may take.
const MAX_EXCHANGE: Duration = Duration::from_secs(5);

/// The ports on which we listen.
#[derive(Debug)]
pub(super) struct Listeners {
    reverse: TcpListener,
    /// For nodes of External Control that ask for their program.
    request: Option<Arc<TcpListener>>,
    trajectory: u16,
    command: u16,
    tasks: Vec<JoinHandle<()>>,
    /// Requests from elsewhere than the robot, not counted yet.
    strangers: Arc<AtomicU64>,
    serving: Option<JoinHandle<()>>,
}

/// The ports of the parameters; 0 is any free one.
#[derive(Debug, Clone, Copy)]
pub(super) struct PortNumbers {
    pub(super) reverse: u16,
    /// `None` if no node asks for its program.
    pub(super) request: Option<u16>,
    /// The two ports that only the maker's program opens; `None` without it.
    pub(super) vendor: Option<[u16; 2]>,
}

impl Listeners {
    /// Listens on all ports.
    ///
    /// # Errors
    /// The port that cannot be used.
    pub(super) async fn open(ports: PortNumbers) -> Result<Self, String> {
        let reverse = listen(ports.reverse).await?;
        let request = match ports.request {
            Some(port) => Some(Arc::new(listen(port).await?)),
            None => None,
        };
        let (mut vendor, mut tasks) = ([0; 2], Vec::new());
        for (port, found) in ports.vendor.iter().flatten().zip(&mut vendor) {
            let listener = listen(*port).await?;
            *found = number(&listener);
            tasks.push(tokio::spawn(keep(listener)));
        }
        let [trajectory, command] = vendor;
        Ok(Self { reverse, request, trajectory, command, tasks, strangers: Arc::default(), serving: None })
    }

    /// Returns the ports that the program connects to: velocities, trajectories, commands.
    pub(super) fn ports(&self) -> [u16; 3] {
        [number(&self.reverse), self.trajectory, self.command]
    }

    /// Waits for a connection, and returns where it comes from.
    pub(super) async fn accept(&self) -> io::Result<(TcpStream, SocketAddr)> {
        self.reverse.accept().await
    }

    /// Returns the number of requests from elsewhere than the robot since the last call.
    pub(super) fn take_strangers(&self) -> u64 {
        self.strangers.swap(0, Ordering::Relaxed)
    }

    /// Gives `program` to each node of External Control that asks for it from now on, at the address of the robot.
    pub(super) fn serve(&mut self, program: Arc<str>, robot: IpAddr) {
        self.stop_serving();
        if let Some(listener) = &self.request {
            self.serving = Some(tokio::spawn(serve(Arc::clone(listener), program, robot, Arc::clone(&self.strangers))));
        }
    }

    fn stop_serving(&mut self) {
        self.serving.take().iter().for_each(JoinHandle::abort);
    }
}

impl Drop for Listeners {
    fn drop(&mut self) {
        self.stop_serving();
        self.tasks.iter().for_each(JoinHandle::abort);
    }
}

async fn listen(port: u16) -> Result<TcpListener, String> {
    TcpListener::bind(("0.0.0.0", port)).await.map_err(|error| {
        format!("cannot listen on port {port}, to which the robot connects: {error}; end the other program, or write another port")
    })
}

fn number(listener: &TcpListener) -> u16 {
    listener.local_addr().map_or(0, |address| address.port())
}

/// Accepts connections and reads what comes. The maker's program wants these connections, but no velocity needs them.
async fn keep(listener: TcpListener) {
    while let Ok((mut stream, _)) = listener.accept().await {
        tokio::spawn(async move { drain(&mut stream).await });
    }
}

async fn drain(stream: &mut TcpStream) {
    let mut rest = [0; 4096];
    while stream.read(&mut rest).await.is_ok_and(|count| count > 0) {}
}

/// Whether a connection comes from the robot. If not, logs it.
pub(super) fn is_from(peer: SocketAddr, robot: IpAddr) -> bool {
    let is_robot = peer.ip().to_canonical() == robot.to_canonical();
    if !is_robot {
        tracing::warn!(
            "a connection from {} is closed: the robot is at {robot}; if it is the robot, write `robot_host`",
            peer.ip()
        );
    }
    is_robot
}

async fn serve(listener: Arc<TcpListener>, program: Arc<str>, robot: IpAddr, strangers: Arc<AtomicU64>) {
    while let Ok((stream, peer)) = listener.accept().await {
        if !is_from(peer, robot) {
            strangers.fetch_add(1, Ordering::Relaxed);
            continue;
        }
        match timeout(MAX_EXCHANGE, answer(stream, &program)).await {
            Ok(Ok(())) => tracing::info!("the robot at {} has got its program", peer.ip()),
            Ok(Err(error)) => tracing::warn!("a request for a program from {} failed: {error}", peer.ip()),
            Err(_) => tracing::warn!("a request for a program from {} took too long", peer.ip()),
        }
    }
}

/// Reads a line, and answers with the program.
async fn answer(mut stream: TcpStream, program: &str) -> io::Result<()> {
    let mut line = Vec::with_capacity(MAX_REQUEST);
    while !line.contains(&b'\n') {
        if line.len() >= MAX_REQUEST {
            return Err(io::Error::other("the line is too long"));
        }
        let mut chunk = [0; MAX_REQUEST];
        let count = stream.read(&mut chunk).await?;
        if count == 0 {
            return Err(ErrorKind::UnexpectedEof.into());
        }
        line.extend_from_slice(&chunk[..count]);
    }
    if line.trim_ascii() != b"request_program" {
        return Err(io::Error::other("the line is not `request_program`"));
    }
    stream.write_all(program.as_bytes()).await?;
    stream.write_all(b"\n").await?;
    stream.shutdown().await
}

/// A program on its way to the controller.
///
/// The connection stays open and is read until this is dropped, or for a while: one that is closed with bytes to read
/// could lose the program.
#[derive(Debug)]
pub(super) struct Sending {
    task: JoinHandle<()>,
    failure: oneshot::Receiver<String>,
}

impl Sending {
    /// Begins to send a program to the controller at `host:port`.
    pub(super) fn begin(address: String, program: String) -> Self {
        let (fails, failure) = oneshot::channel();
        let task = tokio::spawn(async move {
            if let Err(error) = send(&address, &program).await {
                let _ = fails.send(format!("cannot send the program to {address}: {error}"));
            }
        });
        Self { task, failure }
    }

    /// Returns why the program could not be sent, once.
    pub(super) fn failure(&mut self) -> Option<String> {
        self.failure.try_recv().ok()
    }
}

impl Drop for Sending {
    fn drop(&mut self) {
        self.task.abort();
    }
}

async fn send(address: &str, program: &str) -> io::Result<()> {
    let mut stream = timeout(MAX_EXCHANGE, TcpStream::connect(address)).await??;
    timeout(MAX_EXCHANGE, stream.write_all(program.as_bytes())).await??;
    drop(timeout(MAX_EXCHANGE, drain(&mut stream)).await);
    Ok(())
}

/// The connection that the program on the robot has opened.
#[derive(Debug)]
pub(super) struct Reverse {
    stream: TcpStream,
    /// The rest of a message that the connection has not taken yet. At most one message waits.
    rest: Vec<u8>,
}

impl Reverse {
    /// Takes a connection.
    ///
    /// # Errors
    /// If it is already broken.
    pub(super) fn new(stream: TcpStream) -> io::Result<Self> {
        stream.set_nodelay(true)?;
        Ok(Self { stream, rest: Vec::with_capacity(message::SIZE) })
    }

    /// Sends a message, unless the last one still waits. Returns whether the connection has taken it.
    ///
    /// # Errors
    /// If the connection is broken.
    pub(super) fn send(&mut self, message: &[u8; message::SIZE]) -> io::Result<bool> {
        if !self.flush()? {
            return Ok(false);
        }
        self.rest.extend_from_slice(message);
        self.flush()?;
        Ok(true)
    }

    fn flush(&mut self) -> io::Result<bool> {
        while !self.rest.is_empty() {
            match self.stream.try_write(&self.rest) {
                Ok(count) => _ = self.rest.drain(..count),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(false),
                Err(error) => return Err(error),
            }
        }
        Ok(true)
    }

    /// Waits until the program closes the connection, and passes over what it sends.
    pub(super) async fn closed(&self) {
        let mut rest = [0; 256];
        while self.stream.readable().await.is_ok() {
            match self.stream.try_read(&mut rest) {
                Ok(1..) => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Ok(0) | Err(_) => return,
            }
        }
    }

    /// Closes the connection at once, so that the program ends when it reads on.
    ///
    /// A program that is paused keeps its last velocity, and messages that have arrived before. When it goes on, it may
    /// run a few steps of this velocity until it reads that the connection is closed.
    pub(super) fn abort(self) {
        let _ = self.stream.set_zero_linger();
    }
}

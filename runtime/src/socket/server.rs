//! The thread of the socket: it accepts clients of the same user, and answers their requests.

use std::io;
use std::os::unix::net::UnixListener as BlockingListener;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use nix::unistd::Uid;
use serde::Serialize;
use tokio::io::{AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::UnixListener;
use tokio::net::unix::{OwnedReadHalf, OwnedWriteHalf};
use tokio::sync::{Semaphore, mpsc, oneshot};
use tokio::task::LocalSet;
use tokio::time::{sleep, timeout};

use super::asks::{Answer, Ask, RunEnd};
use super::described::{Described, RunFacts};
use super::feed::{Feed, Wishes, feed};
use super::folder::bind;
use super::frames::FeedReader;
use super::hub::Hub;
use super::lines::{Line, MAX_LINE, read_line};
use crate::engine::{ChangeRequest, Engine, RunRequests};

/// Maximum number of clients.
const MAX_CLIENTS: usize = 64;
/// Maximum number of further clients, each of which may stop the run and do nothing else.
const MAX_STOPPING: usize = 8;
/// Time that such a client has for its request.
const STOP_TIME: Duration = Duration::from_millis(100);
/// Maximum number of changes that wait for their check.
const MAX_CHANGES: usize = 16;
/// A client that asks nothing for this time is disconnected.
const MAX_IDLE: Duration = Duration::from_secs(60);
/// A client that does not read its answer for this time is disconnected.
const MAX_WRITE: Duration = Duration::from_secs(10);
/// Pause after a line that is no request, so that garbage costs no processor.
const REST: Duration = Duration::from_millis(10);
/// Pause after each request, so that a flood of them leaves the processor to the ticks.
const PAUSE: Duration = Duration::from_millis(1);
/// Pause after a client could not be accepted.
const RETRY: Duration = Duration::from_millis(100);
/// Time in which watchers can read the last samples of a run.
const LAST: Duration = Duration::from_millis(200);

/// The socket of a run. It is closed when it is dropped.
pub struct RunSocket {
    thread: Option<JoinHandle<()>>,
    over: Option<oneshot::Sender<Option<RunEnd>>>,
    end: Option<RunEnd>,
    path: PathBuf,
}

/// An open socket, and its ends in the run.
pub struct OpenedSocket {
    /// Closes the socket when it is dropped.
    pub socket: RunSocket,
    /// Gets every tick.
    pub feed: Feed,
    /// The stops and tares that clients request.
    pub requests: Arc<RunRequests>,
    /// The changes that clients request.
    pub changes: Receiver<ChangeRequest>,
}

/// What the thread works with.
struct Shared {
    listener: BlockingListener,
    facts: Described,
    ring: (Arc<Wishes>, FeedReader),
    requests: Arc<RunRequests>,
    changes: std::sync::mpsc::SyncSender<ChangeRequest>,
}

/// Opens the socket of a run, which a thread of its own serves.
///
/// # Errors
/// If the socket or its thread cannot be made.
pub fn open(engine: &Engine, facts: RunFacts) -> Result<OpenedSocket, String> {
    let (listener, path) = bind()?;
    let (feed, reader, wishes) = feed(engine);
    let (requested, changes) = sync_channel(MAX_CHANGES);
    let requests = RunRequests::of(engine);
    let facts = Described::of(engine, facts);
    let shared =
        Shared { listener, facts, ring: (wishes, reader), requests: Arc::clone(&requests), changes: requested };
    let (over, is_over) = oneshot::channel();
    let work = move || {
        if let Err(error) = serve(shared, is_over) {
            tracing::warn!("the socket of the run is closed: {error}");
        }
    };
    let thread = std::thread::Builder::new().name("socket".into()).spawn(work);
    // From here on, the file is removed at the end.
    let mut socket = RunSocket { thread: None, over: Some(over), end: None, path };
    socket.thread = Some(thread.map_err(|error| format!("cannot start a thread: {error}"))?);
    Ok(OpenedSocket { socket, feed, requests, changes })
}

impl RunSocket {
    /// Returns the path of the socket.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Notes how the run has ended, for those who follow it.
    pub fn end(&mut self, reason: String, is_fault: bool) {
        self.end = Some(RunEnd { reason, is_fault });
    }
}

impl Drop for RunSocket {
    fn drop(&mut self) {
        // It may be gone with the folder.
        let _ = std::fs::remove_file(&self.path);
        if let Some(over) = self.over.take() {
            // The thread has ended before if its socket failed.
            let _ = over.send(self.end.take());
        }
        if let Some(thread) = self.thread.take() {
            // A panic of the thread was printed when it happened.
            let _ = thread.join();
        }
    }
}

/// Serves clients until the run is over.
fn serve(shared: Shared, over: oneshot::Receiver<Option<RunEnd>>) -> io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    LocalSet::new().block_on(&runtime, async move {
        let listener = UnixListener::from_std(shared.listener)?;
        let hub = Rc::new(Hub::new(shared.facts, shared.ring, shared.requests, shared.changes));
        let worker = Rc::clone(&hub);
        tokio::task::spawn_local(async move { worker.work().await });
        let places = [MAX_CLIENTS, MAX_STOPPING].map(|places| Arc::new(Semaphore::new(places)));
        let end = tokio::select! {
            () = accept(&listener, &hub, &places) => None,
            end = over => end.ok().flatten(),
        };
        hub.end(end.as_ref());
        let is_read = async {
            while hub.is_watched() {
                sleep(REST).await;
            }
        };
        // A watcher that does not read loses its last samples.
        let _ = timeout(LAST, is_read).await;
        Ok(())
    })
}

/// Accepts clients for ever.
async fn accept(listener: &UnixListener, hub: &Rc<Hub>, places: &[Arc<Semaphore>; 2]) {
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            // For example without a free file descriptor.
            sleep(RETRY).await;
            continue;
        };
        let is_own = stream.peer_cred().is_ok_and(|peer| peer.uid() == Uid::effective().as_raw());
        if !is_own {
            continue;
        }
        let [place, to_stop] = places.each_ref().map(Arc::clone);
        let place = place.try_acquire_owned();
        let to_stop = place.is_err().then(|| to_stop.try_acquire_owned());
        let hub = Rc::clone(hub);
        tokio::task::spawn_local(async move {
            let (read, mut write) = stream.into_split();
            // A client that has gone needs no answer.
            let _ = match (place, to_stop) {
                (Ok(_place), _) => talk(read, &mut write, &hub).await,
                (Err(_), Some(Ok(_place))) => stop(read, &mut write, &hub).await,
                (Err(_), _) => answer::<()>(&mut write, Err(full())).await,
            };
        });
    }
}

fn full() -> String {
    format!("the run has {MAX_CLIENTS} clients already: end one of them")
}

/// Takes one request of a client for which there is no place: a stop is never refused for that.
async fn stop(read: OwnedReadHalf, write: &mut OwnedWriteHalf, hub: &Hub) -> io::Result<()> {
    let mut reader = BufReader::new(read);
    let line = match timeout(STOP_TIME, read_line(&mut reader)).await {
        Ok(Ok(Line::Whole(line))) => line,
        _ => return answer::<()>(write, Err(full())).await,
    };
    match serde_json::from_slice(&line) {
        Ok(Ask::Send { word }) => answer(write, hub.send(&word)).await,
        _ => answer::<()>(write, Err(full())).await,
    }
}

/// Answers the requests of a client.
async fn talk(read: OwnedReadHalf, write: &mut OwnedWriteHalf, hub: &Hub) -> io::Result<()> {
    let mut reader = BufReader::new(read);
    loop {
        let Ok(line) = timeout(MAX_IDLE, read_line(&mut reader)).await else { return Ok(()) };
        let line = match line? {
            Line::Whole(line) => line,
            Line::TooLong => return answer::<()>(write, Err(format!("a line is longer than {MAX_LINE} bytes"))).await,
            Line::End => return Ok(()),
        };
        match serde_json::from_slice(&line) {
            Err(error) => {
                answer::<()>(write, Err(format!("this line is no request: {error}; docs/live.md lists them"))).await?;
                sleep(REST).await;
            }
            Ok(Ask::About {}) => {
                let about = hub.whole().await.map(|both| hub.described.about(&both.0, &both.1));
                answer(write, about).await?;
            }
            Ok(Ask::Get { pattern }) => {
                let whole = hub.whole().await;
                let got = whole.and_then(|both| hub.described.got(&both.0, &both.1, pattern.as_deref()));
                answer(write, got).await?;
            }
            Ok(Ask::Set { values }) => answer(write, hub.set(values.into_iter().collect()).await).await?,
            Ok(Ask::Send { word }) => answer(write, hub.send(&word)).await?,
            Ok(Ask::Tare {}) => answer(write, hub.tare().await).await?,
            Ok(Ask::Watch { ports, count }) => match hub.watch(&ports, count) {
                Ok(lines) => return stream((), lines, (&mut reader, write), hub).await,
                Err(why) => return answer::<()>(write, Err(why)).await,
            },
            Ok(Ask::Follow { ports, period_ms }) => match hub.follow(&ports, period_ms) {
                Ok((facts, lines)) => return stream(facts, lines, (&mut reader, write), hub).await,
                Err(why) => return answer::<()>(write, Err(why)).await,
            },
        }
        sleep(PAUSE).await;
    }
}

/// Answers, and sends lines until there are no more, the client sends something or goes, or the run ends.
async fn stream<T: Serialize>(
    first: T,
    mut lines: mpsc::Receiver<String>,
    (reader, write): (&mut BufReader<OwnedReadHalf>, &mut OwnedWriteHalf),
    hub: &Hub,
) -> io::Result<()> {
    let _watching = hub.begin_watching();
    answer(write, Ok(first)).await?;
    loop {
        let mut byte = [0];
        tokio::select! {
            line = lines.recv() => match line {
                Some(line) => write.write_all(line.as_bytes()).await?,
                None => return Ok(()),
            },
            _ = reader.read(&mut byte) => return Ok(()),
        }
    }
}

/// Writes an answer. A client that does not read it in time is given up.
async fn answer<T: Serialize>(write: &mut OwnedWriteHalf, result: Result<T, String>) -> io::Result<()> {
    let line = Answer::from(result).line();
    timeout(MAX_WRITE, write.write_all(line.as_bytes())).await.unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()))
}

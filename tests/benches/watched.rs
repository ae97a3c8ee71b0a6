//! The time that watchers take of a tick: the hybrid task in contact and recorded, with five watchers of which two never
//! read, and a client that sends garbage.

use std::hint::black_box;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, Instant};

use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::socket::{RunFacts, open};

use crate::recorded::in_contact;

/// Ticks of a round, which the rings take without waiting.
const TICKS: u32 = 20;
/// Rounds of which the median is taken.
const ROUNDS: usize = 201;
/// Pause after a round, in which the threads empty the rings.
const PAUSE: Duration = Duration::from_millis(20);

/// Returns the time of a tick with a recording, of the same tick with nobody on the socket, and with watchers \[ns\]: the
/// medians of interleaved rounds.
pub(crate) fn watched() -> [f64; 3] {
    let request = Request::file(concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/hybrid.toml"));
    let mut engines = [0; 3].map(|_| in_contact(&request, true));
    let mut sockets = Vec::new();
    for (engine, _) in &engines[1..] {
        let plan = compile(&tactflow_nodes::catalogue(), &request).expect("the graph has no mistake");
        sockets.push(open(engine, RunFacts::of(&plan, &request.graph, true)).expect("there is a folder for sockets"));
    }
    // The socket of a process has one name, which is that of the last one.
    let path = sockets[1].socket.path().to_owned();
    let _stuck: Vec<UnixStream> = (0..2).map(|_| watcher(&path)).collect();
    for client in (0..3).map(|_| watcher(&path)) {
        std::thread::spawn(move || BufReader::new(client).lines().map_while(Result::ok).for_each(drop));
    }
    let mut garbage = UnixStream::connect(&path).expect("somebody listens");
    std::thread::spawn(
        move || while garbage.write_all(&[0xa5; 997]).and_then(|()| garbage.write_all(b"\n")).is_ok() {},
    );
    let mut times = [Vec::new(), Vec::new(), Vec::new()];
    for _ in 0..ROUNDS {
        for (i, ((engine, recorder), times)) in engines.iter_mut().zip(&mut times).enumerate() {
            let begin = Instant::now();
            for _ in 0..TICKS {
                engine.refresh();
                // Joints that are commanded and do not move are a fault after a while, which changes nothing here.
                let _ = black_box(&mut *engine).step();
                recorder.iter_mut().for_each(|recorder| recorder.record(engine, || false));
                if let Some(opened) = i.checked_sub(1).map(|socket| &mut sockets[socket]) {
                    opened.feed.publish(engine);
                }
            }
            times.push(begin.elapsed().as_nanos() as f64 / f64::from(TICKS));
            std::thread::sleep(PAUSE);
        }
    }
    times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[ROUNDS / 2]
    })
}

/// Connects a client that watches all features and twists.
fn watcher(path: &Path) -> UnixStream {
    let mut client = UnixStream::connect(path).expect("somebody listens");
    let ask = b"{\"ask\":\"watch\",\"ports\":[\"touch.*\",\"pid.*\",\"error.*\",\"sum.*\"]}\n";
    client.write_all(ask).expect("somebody reads");
    client
}

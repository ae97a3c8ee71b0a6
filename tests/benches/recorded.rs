//! The time that the recording of a whole run takes of a tick: the hybrid task in contact, images included.

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::record::OutputFile;
use tactflow_runtime::recording::{RecordRequest, RunRecorder};

/// Ticks until the task is in contact.
const CONTACT: u64 = 500;
/// Ticks of a round, which the ring takes without waiting.
const TICKS: u32 = 100;
/// Rounds of which the median is taken.
const ROUNDS: usize = 41;

/// Returns the time that the recording of a tick takes [ns]: the median of rounds with the hybrid task in contact, less
/// that of the same ticks without a recording. The engine presents the last samples again and again, as in the other
/// measurements.
pub(crate) fn recording() -> f64 {
    let request = Request::file(concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/hybrid.toml"));
    let mut engines = [false, true].map(|is_recorded| in_contact(&request, is_recorded));
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..ROUNDS {
        for ((engine, recorder), times) in engines.iter_mut().zip(&mut times) {
            let begin = Instant::now();
            for _ in 0..TICKS {
                engine.refresh();
                // Joints that are commanded and do not move are a fault after a while, which changes nothing here.
                let _ = black_box(&mut *engine).step();
                recorder.iter_mut().for_each(|recorder| recorder.record(engine, || false));
            }
            times.push(begin.elapsed().as_nanos() as f64 / f64::from(TICKS));
            // The writer empties the ring.
            std::thread::sleep(std::time::Duration::from_millis(60));
        }
    }
    let lost: u64 = engines.iter().filter_map(|(_, recorder)| recorder.as_ref()).map(RunRecorder::lost).sum();
    assert_eq!(lost, 0, "the ring has room for a round");
    let [plain, recorded] = times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[ROUNDS / 2]
    });
    recorded - plain
}

/// Returns an engine of the task in contact.
pub(crate) fn in_contact(request: &Request, is_recorded: bool) -> (Engine, Option<RunRecorder>) {
    let plan = compile(&tactflow_nodes::catalogue(), request).expect("the graph has no mistake");
    let mut engine = Engine::new(plan);
    let record = RecordRequest { request, is_real: true, seed: None, path: None };
    let mut recorder = is_recorded.then(|| {
        let file = OutputFile::create(Path::new("/dev/null")).expect("there is a null device");
        RunRecorder::start(file, &mut engine, &record).expect("it can be recorded")
    });
    while let Some(now) = engine.next().filter(|_| engine.ticks() < CONTACT) {
        engine.tick(now).expect("nothing fails");
        recorder.iter_mut().for_each(|recorder| recorder.record(&engine, || true));
    }
    (engine, recorder)
}

//! What a tick does not do, recorded or not: allocate, or call the operating system.

#[cfg(unix)]
use std::io::{BufRead, BufReader, Write};
#[cfg(unix)]
use std::os::unix::net::UnixStream;
use std::path::Path;

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::engine::{Changer, Engine};
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::record::OutputFile;
use tactflow_runtime::recording::{RecordRequest, RunRecorder};
#[cfg(unix)]
use tactflow_runtime::socket::{Feed, OpenedSocket, RunFacts, RunSocket};
use tactflow_tests::examples::graph_of_all;
use tactflow_tests::{catalogue, shipped_graphs, workspace};

/// Every shipped graph, and one of the examples of all nodes: by name, how to load it.
fn graphs() -> Vec<(String, Request)> {
    let shipped = shipped_graphs().into_iter().map(|graph| (graph.display().to_string(), Request::file(graph)));
    shipped.chain([("all examples".into(), Request::text(graph_of_all(&tactflow_nodes::catalogue())))]).collect()
}

fn engine(request: &Request) -> Engine {
    let plan = compile(&catalogue(), request);
    Engine::new(plan.unwrap_or_else(|report| panic!("{}", report.render(false))))
}

/// Records an engine as a run in real time does.
fn recorder(engine: &mut Engine, request: &Request, path: &Path) -> RunRecorder {
    let record = RecordRequest { request, is_real: true, seed: None, path: None };
    RunRecorder::start(OutputFile::create(path).unwrap(), engine, &record).unwrap()
}

#[test]
fn the_tick_neither_allocates_nor_frees_in_any_shipped_graph() {
    let folder = tempfile::tempdir().unwrap();
    for (graph, request) in graphs() {
        let (mut engine, mut plain) = (engine(&request), engine(&request));
        let mut recorder = recorder(&mut engine, &request, &folder.path().join("run.mcap"));
        let mut ticks = 0;
        while let Some(now) = engine.next().filter(|_| ticks < 1800) {
            // A device may allocate. The log of its samples does not.
            let [logged, unlogged] = [&mut engine, &mut plain]
                .map(|engine| allocation_counter::measure(|| engine.exchange(now).unwrap()).count_total);
            assert_eq!(logged, unlogged, "{graph} in the exchange of tick {}", engine.ticks());
            plain.step().unwrap();
            // From latch to commit: contact comes, flickers and goes in every graph, and states are reset.
            let counted = allocation_counter::measure(|| {
                engine.step().unwrap();
                recorder.record(&engine, || false);
            });
            assert_eq!(counted.count_total, 0, "{graph} in tick {}", engine.ticks());
            ticks += 1;
        }
        let recorded = recorder.finish(|_| true);
        assert!(recorded.error.is_none() && recorded.ticks + recorded.lost == ticks, "{graph}: {recorded:?}");
        assert!(ticks > 300, "{graph}: {ticks} ticks");
    }
}

/// Moves the first parameter that a graph lists in `[live]` to the end of its range, if it lists one.
fn change<'c>(engine: &mut Engine, catalogue: &'c Catalogue, request: &Request) -> Option<Changer<'c>> {
    let (name, max) = engine.live_values().next().map(|live| (live.param.name.clone(), live.param.max))?;
    let mut changer = Changer::new(engine, request, move |request| compile(catalogue, request).map(drop)).unwrap();
    changer.set(&name, max).unwrap();
    changer.prepare().unwrap();
    Some(changer)
}

#[test]
fn a_parameter_changes_without_allocating_or_freeing_in_the_tick() {
    let (request, catalogue) = (Request::file(workspace().join("graphs/hybrid.toml")), catalogue());
    let folder = tempfile::tempdir().unwrap();
    let (mut engine, mut plain) = (engine(&request), engine(&request));
    let mut recorder = recorder(&mut engine, &request, &folder.path().join("run.mcap"));
    let mut changer = change(&mut engine, &catalogue, &request).unwrap();
    let mut changed = 0;
    while let Some(now) = engine.next().filter(|_| engine.ticks() < 300) {
        changer.prepare().unwrap();
        let before = engine.live_values().next().map(|live| live.value);
        // A device may allocate; that of the other engine does the same.
        let [changing, still] = [&mut engine, &mut plain].map(|engine| {
            let counted = allocation_counter::measure(|| engine.exchange(now).unwrap());
            (counted.count_total, counted.count_current)
        });
        assert_eq!(changing, still, "in the exchange of tick {}", engine.ticks());
        plain.step().unwrap();
        let counted = allocation_counter::measure(|| {
            engine.step().unwrap();
            recorder.record(&engine, || false);
        });
        assert_eq!((counted.count_total, counted.count_current), (0, 0), "in tick {}", engine.ticks());
        changed += u32::from(before != engine.live_values().next().map(|live| live.value));
    }
    assert!(changed > 50, "{changed} ticks changed the parameter");
    assert!(recorder.finish(|_| true).error.is_none());
}

/// The socket of an engine, of which one client watches everything, one follows everything, and another one asks again and
/// again.
#[cfg(unix)]
struct Watched {
    feed: Feed,
    _socket: RunSocket,
    watcher: BufReader<UnixStream>,
}

#[cfg(unix)]
impl Watched {
    fn new(engine: &Engine) -> Self {
        let plan =
            compile(&catalogue(), &Request::file(workspace().join("graphs/hybrid.toml"))).unwrap_or_else(|_| panic!());
        let facts = RunFacts::of(&plan, Path::new("graphs/hybrid.toml"), true);
        let OpenedSocket { socket, feed, .. } = tactflow_runtime::socket::open(engine, facts).unwrap();
        let path = socket.path().to_owned();
        let mut watcher = BufReader::new(UnixStream::connect(&path).unwrap());
        watcher.get_mut().write_all(b"{\"ask\":\"watch\",\"ports\":[\"*\"]}\n").unwrap();
        let mut answer = String::new();
        watcher.read_line(&mut answer).unwrap();
        // A graph of images alone has no number.
        assert!(answer == "{\"ok\":null}\n" || answer.contains("no number of a port"), "{answer}");
        let mut follower = BufReader::new(UnixStream::connect(&path).unwrap());
        follower.get_mut().write_all(b"{\"ask\":\"follow\",\"ports\":[\"*\"],\"period_ms\":5}\n").unwrap();
        follower.read_line(&mut answer).unwrap();
        assert!(answer.contains("\"kind\":\"image\""), "{answer}");
        std::thread::spawn(move || follower.lines().map_while(Result::ok).for_each(drop));
        let mut asker = BufReader::new(UnixStream::connect(&path).unwrap());
        std::thread::spawn(move || {
            let mut answer = String::new();
            while asker.get_mut().write_all(b"{\"ask\":\"get\"}\n").is_ok() && asker.read_line(&mut answer).is_ok() {
                answer.clear();
            }
        });
        Self { feed, _socket: socket, watcher }
    }
}

/// One process has one socket, so one test of this process opens it.
#[cfg(unix)]
#[test]
fn a_watched_tick_neither_allocates_nor_frees() {
    let request = Request::file(workspace().join("graphs/hybrid.toml"));
    let mut engine = engine(&request);
    let mut watched = Watched::new(&engine);
    while let Some(now) = engine.next().filter(|_| engine.ticks() < 400) {
        engine.tick(now).unwrap();
        let counted = allocation_counter::measure(|| watched.feed.publish(&engine));
        assert_eq!(counted.count_total, 0, "in tick {}", engine.ticks());
        // The thread of the socket asks for all values meanwhile.
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    let mut line = String::new();
    watched.watcher.read_line(&mut line).unwrap();
    assert!(line.starts_with("{\"t\":0.0,") && line.contains("\"move.joints.stuck\":"), "{line}");
}

#[test]
fn the_counter_counts() {
    let counted = allocation_counter::measure(|| drop(std::hint::black_box(vec![1_u8; 100])));
    assert_eq!(counted.count_total, 1);
}

/// A thread that may only do what [`ALLOWED`] lists runs every tick of every shipped graph; any other call to the
/// operating system would end this process at once, so it is done in a process of its own.
#[cfg(target_os = "linux")]
#[test]
fn the_tick_makes_no_system_call() {
    let test = std::env::current_exe().unwrap();
    let run = |mode: &str| {
        let mut command = std::process::Command::new(&test);
        command.args(["--exact", "tick::in_a_jail", "--ignored", "--nocapture"]).env("TACTFLOW_JAIL", mode);
        command.output().unwrap()
    };
    let inside = run("ticks");
    let said = String::from_utf8_lossy(&inside.stdout).into_owned();
    assert!(
        said.contains("every tick ran"),
        "{:?}\n{said}\n{}",
        inside.status,
        String::from_utf8_lossy(&inside.stderr)
    );
    let outside = run("escape");
    assert!(!outside.status.success(), "the jail holds nobody");
}

/// What the jailed thread runs; only of use to the test above.
#[cfg(target_os = "linux")]
#[test]
#[ignore = "run by `the_tick_makes_no_system_call` in a process of its own"]
fn in_a_jail() {
    let mode = std::env::var("TACTFLOW_JAIL").expect("run by another test");
    let started = graphs().into_iter().map(|(_, request)| {
        let mut engine = engine(&request);
        let recorder = recorder(&mut engine, &request, Path::new("/dev/null"));
        (engine, recorder)
    });
    let mut engines: Vec<(Engine, RunRecorder)> = started.collect();
    // The steps of a change wait in the ring, so that the ticks below take them.
    let catalogue = catalogue();
    let changers: Vec<Option<Changer<'_>>> = engines
        .iter_mut()
        .zip(graphs())
        .map(|((engine, _), (_, request))| change(engine, &catalogue, &request))
        .collect();
    assert!(changers.iter().any(Option::is_some), "no shipped graph lists a parameter in [live]");
    // Somebody watches every port of every graph, and wants all values now and then.
    let mut sockets: Vec<Watched> = engines.iter().map(|(engine, _)| Watched::new(engine)).collect();
    // Whatever a first panic or a first float would set up lazily is set up by the first tick.
    for (engine, recorder) in &mut engines {
        let now = engine.next().unwrap();
        engine.tick(now).unwrap();
        recorder.record(engine, || false);
    }
    jail();
    if mode == "escape" {
        // Any call that is not allowed.
        let _ = std::fs::metadata("/");
    }
    for ((engine, recorder), watched) in engines.iter_mut().zip(&mut sockets) {
        let mut ticks = 0;
        while let Some(now) = engine.next().filter(|_| ticks < 1000) {
            engine.tick(now).unwrap();
            recorder.record(engine, || false);
            watched.feed.publish(engine);
            ticks += 1;
        }
    }
    std::io::Write::write_all(&mut std::io::stdout(), b"every tick ran\n").unwrap();
    std::process::exit(0);
}

/// From here on this thread may write, free memory and end; anything else kills the process.
#[cfg(target_os = "linux")]
fn jail() {
    use seccompiler::{BpfProgram, SeccompAction, SeccompFilter, TargetArch, apply_filter};

    /// `write`, `munmap`, `exit_group`, `sigaltstack`, `exit` on x86-64: what saying the last word and ending takes.
    #[cfg(target_arch = "x86_64")]
    const ALLOWED: [i64; 5] = [1, 11, 231, 131, 60];
    #[cfg(target_arch = "aarch64")]
    const ALLOWED: [i64; 5] = [64, 215, 94, 132, 93];
    let rules = ALLOWED.iter().map(|call| (*call, vec![])).collect();
    let arch = TargetArch::try_from(std::env::consts::ARCH).expect("a known architecture");
    let filter = SeccompFilter::new(rules, SeccompAction::KillProcess, SeccompAction::Allow, arch).unwrap();
    let program: BpfProgram = filter.try_into().unwrap();
    apply_filter(&program).unwrap();
}

//! Parameters that a graph lists in `[live]` change while the arm moves: not faster than declared, through a change of
//! mode, and the same in a replay.

use std::collections::BTreeSet;

use tactflow_runtime::engine::{Changer, End, Engine, RunOptions, ScheduledChanges, run_changing};
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::random::Random;
use tactflow_runtime::signal::Features;
use tactflow_tests::{catalogue, workspace};

use crate::replay::{recorded, ticks_of_replay};
use crate::tool::say;

const KP: &str = "pid.gains.x.kp";

/// The shipped graph that lists `pid.gains.y.kp`, which lists the gain of `x` too. A mode builds `pid` again, so that the
/// node has two configurations.
fn hybrid() -> Request {
    let path = workspace().join("graphs/hybrid.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let text = text.replace("[modes.servo]\n", "[modes.servo]\nset.pid.gains.pressure.ki = 0.11\n");
    // The control is the gain times the error from the first tick on.
    let text = text.replace("gains.x = { kp = 3.0, rise = 0.25 }", "gains.x = { kp = 3.5 }");
    Request { text: Some(text + "pid.gains.x.kp = { min = 0.5, max = 5.0, rate = 2.0 }\n"), ..Request::file(path) }
}

fn engine(request: &Request) -> Engine {
    Engine::new(compile(&catalogue(), request).unwrap_or_else(|report| panic!("{}", report.render(false))))
}

/// The value of a parameter, and that toward which it moves.
fn value(engine: &Engine, name: &str) -> [f64; 2] {
    let live = engine.live_values().find(|live| live.param.name == name).unwrap();
    [live.value, live.target]
}

/// The first feature of a port.
fn first(engine: &Engine, port: &str) -> Option<f64> {
    engine.get::<Features>(port)?.values().next()?
}

/// The limits that have acted in the last tick.
fn acting(engine: &Engine) -> Vec<String> {
    engine.limits().filter(|(_, scale)| *scale < 1.0).map(|(name, _)| name.to_owned()).collect()
}

#[test]
fn a_gain_walks_to_its_value_and_the_law_uses_it_in_every_mode() {
    let (request, catalogue) = (hybrid(), catalogue());
    let mut engine = engine(&request);
    let mut changer = Changer::new(&mut engine, &request, |request| compile(&catalogue, request).map(drop)).unwrap();
    let (mut last, mut compared, mut reached) = (3.5, BTreeSet::new(), None);
    while let Some(now) = engine.next().filter(|now| *now < 4_000_000_000) {
        if engine.ticks() == 10 {
            changer.set(KP, 1.25).unwrap();
        }
        changer.prepare().unwrap();
        let before = engine.now();
        engine.tick(now).unwrap();
        let ([kp, target], dt) = (value(&engine, KP), (now - before) as f64 * 1e-9);
        assert!((kp - last).abs() <= 2.0 * dt + 1e-12, "{last} to {kp} in {dt} s");
        if kp == 1.25 && reached.is_none() {
            reached = Some(engine.now() as f64 * 1e-9);
        }
        // The law of the node: proportional in x, so the control is the gain times the error of this tick.
        let is_new = engine.mark("pid.control").changed_in(engine.ticks());
        if let (Some(control), Some(error), true) =
            (first(&engine, "pid.control"), first(&engine, "error.error"), is_new)
            && error != 0.0
        {
            assert!((control / error - kp).abs() < 1e-12, "tick {}: {} and {kp}", engine.ticks(), control / error);
            compared.insert(engine.mode().unwrap().to_owned());
        }
        assert_eq!(target, if engine.ticks() > 10 { 1.25 } else { 3.5 });
        last = kp;
    }
    let reached = reached.unwrap();
    // 2.25 at 2 per second is 1.125 s at least, and a regular clock takes 1/0.8 of that.
    assert!((1.125..1.6).contains(&reached), "{reached} s");
    assert!(compared.contains("servo"), "{compared:?}");
    assert_eq!(engine.value_changes().len(), 1);
    assert_eq!((engine.value_changes()[0].from, engine.value_changes()[0].to), (3.5, 1.25));
}

#[test]
fn random_changes_in_contact_jump_nowhere_and_touch_no_other_limit() {
    let request = hybrid();
    let catalogue = catalogue();
    let (mut engine, mut plain) = (engine(&request), engine(&request));
    let mut changer = Changer::new(&mut engine, &request, |request| compile(&catalogue, request).map(drop)).unwrap();
    let (mut random, mut sent, mut last) = (Random::new(18, 0), 0, [3.5, 4.0]);
    let (mut acted, mut allowed) = (BTreeSet::new(), BTreeSet::new());
    while let Some(now) = engine.next().filter(|now| *now < 8_000_000_000) {
        if engine.mode() == Some("servo") && engine.ticks() % 15 == 0 {
            let name = if random.uniform(0.0, 1.0) < 0.5 { KP } else { "pid.gains.y.kp" };
            changer.set(name, random.uniform(0.5, 5.0)).unwrap();
            sent += 1;
        }
        changer.prepare().unwrap();
        let before = engine.now();
        engine.tick(now).unwrap();
        plain.tick(now).unwrap();
        let (values, dt) = ([value(&engine, KP)[0], value(&engine, "pid.gains.y.kp")[0]], (now - before) as f64 * 1e-9);
        for (old, new) in last.iter().zip(values) {
            assert!((old - new).abs() <= 2.0 * dt + 1e-12, "{old} to {new} in {dt} s");
        }
        last = values;
        acted.extend(acting(&engine));
        allowed.extend(acting(&plain));
    }
    assert!(sent >= 50 && engine.value_changes().len() > 40, "{sent} sent");
    assert!(acted.is_subset(&allowed), "{acted:?} act, and without changes {allowed:?}");
    assert!(engine.halts().is_empty());
}

#[test]
fn a_change_that_the_end_of_the_run_cuts_is_a_warning() {
    let run = say(&["run", "graphs/hybrid.toml", "--for", "2s", "--quiet", "--change", "1.9s:pid.gains.y.kp=1"]);
    assert_eq!(run.code, 0, "{}", run.err);
    let line = run.err.lines().find(|line| line.contains("`pid.gains.y.kp` was ")).unwrap_or_default();
    assert!(line.ends_with("at the end, on its way to 1"), "{}", run.err);
}

#[test]
fn a_check_of_a_change_that_panics_ends_the_changes_and_not_the_run() {
    let request = hybrid();
    let mut engine = engine(&request);
    let changer = Changer::new(&mut engine, &request, |_| panic!("a lint with a fault")).unwrap();
    let mut changes = ScheduledChanges::new(changer, &[(0.1, KP.to_owned(), 2.0)]).unwrap();
    let options = RunOptions { duration: Some(0.4), is_realtime: true, ..RunOptions::default() };
    let outcome = run_changing(&mut engine, &options, &mut changes, &mut |_| ()).unwrap();
    assert!(outcome.end == End::Duration && outcome.ticks > 50, "{:?} after {} ticks", outcome.end, outcome.ticks);
    assert_eq!(value(&engine, KP), [3.5, 3.5]);
}

#[test]
fn a_change_is_in_the_summary_and_comes_again_in_a_replay() {
    let change = ["--for", "4s", "--change", "1.2s:pid.gains.y.kp=2", "--change", "1.4s:pid.gains.y.kp=3"];
    let args = [&["run", "graphs/hybrid.toml"], &change[..]].concat();
    let run = say(&args);
    assert_eq!(run.code, 0, "{}", run.err);
    for line in ["`pid.gains.y.kp` changed from 4 to 2 at 1.200 s", " to 3 at 1.4"] {
        assert!(run.out.contains(line), "{line}\n{}", run.out);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = recorded(folder.path(), &[&["graphs/hybrid.toml"], &change[..]].concat());
    assert_eq!(ticks_of_replay(&path), Ok(1001));
    let event = "`pid.gains.y.kp` changes from 4 to 2";
    let bytes = std::fs::read(&path).unwrap();
    assert!(bytes.windows(event.len()).any(|window| window == event.as_bytes()), "the log has no event");
    // Another graph that does not list the parameter cannot repeat the run, and says so.
    let other = folder.path().join("other.toml");
    let text = std::fs::read_to_string(workspace().join("graphs/hybrid.toml")).unwrap();
    let text = text.split("[live]").next().unwrap();
    let graphs = workspace().join("graphs").display().to_string();
    let text =
        text.replace("\"parts/", &format!("\"{graphs}/parts/")).replace("\"benches/", &format!("\"{graphs}/benches/"));
    std::fs::write(&other, text).unwrap();
    let replay = say(&["replay", path.to_str().unwrap(), "-q", "--graph", other.to_str().unwrap()]);
    assert_ne!(replay.code, 0);
    assert!(
        replay.err.contains("the run changes `pid.gains.y.kp`, which the graph does not list in [live]"),
        "{}",
        replay.err
    );
}

#[test]
fn what_cannot_change_is_refused_before_the_run() {
    let cases = [
        ("graphs/hybrid.toml", "1s:pid.gains.y.kp=7", "`pid.gains.y.kp` cannot be 7: [live] allows 0.5 to 6"),
        ("graphs/hybrid.toml", "1s:pid.gains.y.kp=nan", "`pid.gains.y.kp` cannot be NaN: [live] allows 0.5 to 6"),
        ("graphs/hybrid.toml", "1s:pid.gains.x.ki=1", "[live] does not list it"),
        ("graphs/force.toml", "1s:pid.gains.x.kp=1", "the graph lists no parameter in [live]"),
        ("graphs/hybrid.toml", "pid.gains.x.kp=1", "give a time, a parameter and a number"),
    ];
    for (graph, change, message) in cases {
        let run = say(&["run", graph, "--for", "1s", "--change", change]);
        assert_eq!(run.code, 2, "{change}: {}", run.err);
        assert!(run.err.contains(message), "{change}: {}", run.err);
        assert!(run.out.is_empty(), "{}", run.out);
    }
}

#[test]
fn a_change_after_the_end_is_reported() {
    let run = say(&["run", "graphs/hybrid.toml", "--for", "1s", "--change", "2s:pid.gains.y.kp=2"]);
    assert_eq!(run.code, 0);
    assert!(run.err.contains("`pid.gains.y.kp` was not changed: the run ended before 2 s"), "{}", run.err);
}

#[test]
fn a_run_in_real_time_changes_too_and_comes_again() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["graphs/hybrid.toml", "--for", "2s", "--realtime", "--change", "0.2s:pid.gains.y.kp=3.5"];
    let path = recorded(folder.path(), &args);
    assert_eq!(ticks_of_replay(&path), Ok(501));
    let run = say(&[&["run"], &args[..]].concat());
    assert!(run.out.contains("`pid.gains.y.kp` changed from 4 to 3.5 at 0.2"), "{}", run.out);
    assert!(!run.out.contains("on its way"), "{}", run.out);
}

//! What the operator says: which word counts, what is heard, and when nobody is left to say one.

use tactflow_runtime::engine::{End, Engine, RunOptions, run};
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::harness::GraphRig;
use tactflow_tests::catalogue;
use tactflow_tests::nodes::length_by_hand;

use crate::tool::say;

const HYBRID: &str = "graphs/hybrid.toml";
const MOCK: &str = "--bench=graphs/benches/mock.toml";

#[test]
fn a_stop_overtakes_the_words_around_it() {
    // What is said at once, before a stop and after one, and whether all is stopped then.
    let cases: [(&[&str], bool); 6] = [
        (&["stop"], true),
        (&["resume"], false),
        (&["stop", "resume"], true),
        (&["resume", "stop"], true),
        (&["stop", "resume", "stop"], true),
        (&["resume", "STOP", "resume"], true),
    ];
    for (words, is_stopped) in cases {
        for before in [None, Some("stop")] {
            let text = "[graph]\nclock = \"a\"\n[roles]\na = \"length\"\n";
            let mut rig = GraphRig::new(catalogue(), text, vec![length_by_hand("a")]).unwrap();
            before.into_iter().for_each(|word| rig.send(word));
            for tick in 0..4 {
                if tick == 1 {
                    for (i, word) in words.iter().enumerate() {
                        let is_void =
                            *word == "resume" && words[..i].iter().any(|word| word.eq_ignore_ascii_case("stop"));
                        let why = "`resume` has no effect: it came before `stop` was carried out";
                        let expected = if is_void { Err(why.to_owned()) } else { Ok(()) };
                        assert_eq!(rig.engine.send(word), expected, "{words:?}");
                    }
                }
                rig.feed("a.value", f64::from(tick) * 10.0, 1.0);
                rig.tick(f64::from(tick) * 10.0).unwrap();
            }
            assert_eq!(rig.engine.is_stopped(), is_stopped, "{words:?} after {before:?}");
        }
    }
}

#[test]
fn a_stop_voids_the_word_of_a_mode_before_it_and_after_it() {
    let text = "[graph]\nclock = \"a\"\nstart = \"one\"\n[roles]\na = \"length\"\n[modes.one]\n\
                go = { to = \"two\", on = \"next\" }\n[modes.two]\n";
    for words in [["next", "stop"], ["stop", "next"]] {
        let mut rig = GraphRig::new(catalogue(), text, vec![length_by_hand("a")]).unwrap();
        for word in words {
            let is_void = words[0] == "stop" && word == "next";
            assert_eq!(rig.engine.send(word).is_err(), is_void, "{words:?}");
        }
        for tick in 0..5 {
            rig.feed("a.value", f64::from(tick) * 10.0, 1.0);
            if tick == 1 {
                rig.send("resume");
            }
            rig.tick(f64::from(tick) * 10.0).unwrap();
        }
        assert_eq!((rig.engine.is_stopped(), rig.engine.mode()), (false, Some("one")), "{words:?}");
    }
}

#[test]
fn a_stop_overtakes_a_word_for_the_same_moment() {
    for order in [["1s:resume", "1s:stop"], ["1s:stop", "1s:resume"]] {
        let args = ["run", HYBRID, MOCK, "--send", order[0], "--send", order[1], "--for", "1.5s"];
        let said = say(&args);
        assert_eq!(said.code, 1, "{order:?}: {}", said.err);
        assert!(said.err.contains("`resume` has no effect: it came before `stop` was carried out"), "{}", said.err);
    }
}

#[test]
fn a_stop_is_told_from_its_beginning_to_its_end() {
    let text = "[graph]\nclock = \"a\"\n[roles]\na = \"length\"\n";
    let mut rig = GraphRig::new(catalogue(), text, vec![length_by_hand("a")]).unwrap();
    for (ms, word) in [(0.0, None), (10.0, Some("stop")), (20.0, None), (30.0, Some("resume")), (40.0, None)] {
        word.into_iter().for_each(|word| rig.send(word));
        rig.feed("a.value", ms, 1.0);
        rig.tick(ms).unwrap();
    }
    let halts: Vec<(String, Option<i64>)> =
        rig.engine.halts().iter().map(|halt| (halt.fault.to_string(), halt.until)).collect();
    assert_eq!(halts, [("the operator sent `stop` in tick 2 at 0.010 s".to_owned(), Some(30_000_000))]);
}

/// Two pads that end after half a second; one of them is unplugged at 0.1 s.
const PADS: &str = "
[graph]
clock = 'kept'
[policy]
device = 'hold'
stale = 'count'
[roles]
kept = 'tactile_pad'
lost = 'tactile_pad'
[bind]
kept = 'a'
lost = 'b'
[devices.a]
type = 'mock_pad'
for_s = 0.5
[devices.b]
type = 'mock_pad'
for_s = 0.5
glitch = [{ at_s = 0.1, for_s = 1.0, kind = 'unplug' }]
";

#[test]
fn what_is_left_of_the_devices_plays_to_its_end() {
    let request = Request::text(PADS);
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    let outcome = run(&mut engine, &RunOptions::default(), &mut |_| {}).unwrap();
    assert_eq!(outcome.end, End::Finished);
    assert!(outcome.time > 450_000_000, "{} ns", outcome.time);
    assert!(
        engine.halts()[0].fault.to_string().starts_with("device `b` failed: a `glitch` with `unplug` disconnected it")
    );
}

#[test]
fn a_stop_that_nobody_can_end_says_so_and_what_would() {
    let stop = say(&["run", HYBRID, MOCK, "--send", "0.2s:stop"]);
    let expected = "error: the operator sent `stop` in tick 51 at 0.200 s; every command went to zero; the run ended \
                    because nothing can send `resume`: add `--send 2s:resume`, or add `--realtime --listen` and type \
                    it\n";
    assert_eq!(stop.code, 1);
    assert!(stop.err.ends_with(expected), "{}", stop.err);
}

#[test]
fn words_for_times_of_the_graph_give_the_same_run_twice() {
    let args = ["run", HYBRID, MOCK, "--for", "1s", "--send", "0.2s:stop", "--send", "0.5s:resume"];
    let [first, second] = [say(&args), say(&args)];
    assert_eq!(first.code, 0, "{}", first.err);
    assert!(first.out.contains("stopped for 0.300 s: the operator sent `stop` in tick 51 at 0.200 s"), "{}", first.out);
    let halt = |text: &str| text.lines().find(|line| line.contains("stopped for")).unwrap().to_owned();
    assert_eq!(halt(&first.out), halt(&second.out));
}

#[test]
fn a_word_that_nothing_waits_for_is_told() {
    let text = "[graph]\nclock = \"a\"\nstart = \"one\"\n[roles]\na = \"length\"\n[modes.one]\n\
                go = { to = \"two\", on = \"back\" }\n[modes.two]\n";
    let mut rig = GraphRig::new(catalogue(), text, vec![length_by_hand("a")]).unwrap();
    assert_eq!(rig.engine.send("bakc"), Err("no mode has a condition on `bakc`: did you mean `back`?".into()));
    assert_eq!(rig.engine.send("STOP"), Ok(()), "in any case");
    rig.tick(0.0).unwrap();
    assert!(rig.engine.is_stopped());
    let why = "`back` has no effect while the commands are stopped: send `resume` first";
    assert_eq!(rig.engine.send("back"), Err(why.into()));
    let refused = say(&["run", HYBRID, MOCK, "--send", "1s:bck"]);
    assert_eq!((refused.code, refused.out.as_str()), (2, ""));
    assert!(
        refused.err.contains("error: unknown word `bck`\nhelp: this graph accepts `resume`, `stop`, `tare`"),
        "{}",
        refused.err
    );
    let late = say(&["run", HYBRID, MOCK, "--for", "1s", "--send", "9s:stop"]);
    assert_eq!(late.code, 0);
    assert!(late.err.contains("`stop` was not sent: the run ended before 9 s"), "{}", late.err);
}

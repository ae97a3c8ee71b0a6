//! Modes: what ends one, what stays through a switch, and what a load says of them.

use tactflow_runtime::fault::Cause;
use tactflow_runtime::harness::GraphRig;
use tactflow_tests::catalogue;
use tactflow_tests::nodes::length_by_hand;

/// A graph on one length, that adds what its mode says and counts.
fn rig(modes: &str) -> Result<GraphRig, String> {
    let text = format!(
        "[graph]\nclock = \"a\"\nstart = \"one\"\n[roles]\na = \"length\"\n[nodes.plus]\ntype = \"plus\"\n\
         in.value = \"a.value\"\nby = 0.0\n[nodes.count]\ntype = \"count\"\nin.value = \"plus.value\"\n{modes}"
    );
    GraphRig::new(catalogue(), &text, vec![length_by_hand("a")]).map_err(|report| report.render(false))
}

fn good(modes: &str) -> GraphRig {
    rig(modes).unwrap_or_else(|report| panic!("{report}"))
}

/// The mode after one tick every 10 ms, with a sample in those that have a value.
fn course(modes: &str, samples: &[Option<f64>]) -> String {
    let mut rig = good(modes);
    let mut course = String::new();
    for (i, sample) in samples.iter().enumerate() {
        let ms = 10.0 * i as f64;
        if let Some(value) = sample {
            rig.feed("a.value", ms, *value);
        }
        rig.tick(ms).unwrap();
        course.push(rig.engine.mode().unwrap().chars().next().unwrap());
    }
    course
}

#[test]
fn what_ends_a_mode() {
    let new = |values: &[f64]| values.iter().map(|value| Some(*value)).collect::<Vec<_>>();
    let (lo, hi) = (1.0, 3.0);
    // What ends mode `one`, the samples, and the mode after each tick: o(ne) or t(wo).
    let cases = [
        ("when = 'a.value', above = 2.0", new(&[lo, lo, hi, lo]), "oott"),
        ("when = 'a.value', below = 2.0", new(&[hi, hi, lo, hi]), "oott"),
        ("when = 'a.value', within = 2.0", new(&[hi, -hi, -lo, hi]), "oott"),
        ("when = 'a.value', above = 2.0, below = 4.0", new(&[lo, 5.0, hi]), "oot"),
        ("when = 'a.value', above = 2.0", new(&[2.0, 2.0]), "oo"),
        ("when = 'a.value', above = 2.0, for_ms = 20", new(&[hi, hi, hi, lo]), "oott"),
        ("when = 'a.value', above = 2.0, for_ms = 20", new(&[hi, lo, hi, hi, hi]), "oooot"),
        ("when = 'a.value', above = 2.0, for_ms = 20, hysteresis = 1.5", new(&[hi, lo, hi]), "oot"),
        ("when = 'a.value', above = 2.0, for_ms = 20, hysteresis = 0.5", new(&[hi, lo, hi]), "ooo"),
        ("when = 'a.value', is = 'new'", vec![None, None, Some(lo)], "oot"),
        ("when = 'a.value', is = 'absent'", vec![Some(lo), None, None], "ooo"),
        ("when = 'a.value', is = 'absent', for_ms = 20", vec![None, None, None, None], "oott"),
        ("when = 'a.value', is = 'present'", vec![None, Some(lo)], "ot"),
        ("after_ms = 20", vec![None, None, None, None], "oott"),
    ];
    for (condition, samples, expected) in cases {
        let modes = format!("[modes.one]\ngo = {{ to = 'two', {condition} }}\n[modes.two]");
        assert_eq!(course(&modes, &samples), expected, "{condition}");
    }
}

#[test]
fn for_ms_starts_anew_in_each_mode() {
    let high = "when = 'a.value', above = 2.0, for_ms = 20";
    let modes = format!(
        "[modes.one]\ngo = {{ to = 'two', {high} }}\n[modes.two]\ngo = {{ to = 'next', {high} }}\n[modes.next]"
    );
    assert_eq!(course(&modes, &[Some(3.0); 6]), "ootttn", "the value has been high for 50 ms");
}

#[test]
fn a_sensor_that_has_stopped_decides_nothing() {
    let modes = "[modes.one]\ngo = { to = 'two', when = 'a.value', above = 2.0, for_ms = 20 }\n[modes.two]";
    let stopped = [Some(3.0), None, None, None, None, None];
    assert_eq!(course(modes, &stopped), "oooooo", "what is held does not last");
    let again = [Some(3.0), None, None, None, Some(3.0)];
    assert_eq!(course(modes, &again), "oooot", "the next sample says that it has lasted");
}

#[test]
fn a_signal_is_lost_when_it_is_silent_or_says_no() {
    let modes = "[modes.one]\non_lost = { of = 'a.value', after_ms = 30, to = 'two' }\n[modes.two]";
    let s = Some(1.0);
    assert_eq!(course(modes, &[s, s, None, None, None, s]), "oooott", "30 ms after the last sample");
    assert_eq!(course(modes, &[s, None, None, s, None, None, s]), "ooooooo", "flicker is no loss");
    assert_eq!(course(modes, &[None, None, None, None]), "ooot", "what never came is lost too");
    assert_eq!(course(modes, &[s, s, s, s, s, s]), "oooooo");
}

#[test]
fn what_is_set_holds_in_its_mode_alone_and_state_goes_on() {
    let mut rig = good(
        "[modes.one]\nset.plus.by = 10.0\ngo = { to = 'two', when = 'a.value', above = 2.0 }\n\
         [modes.two]\ngo = { to = 'three', when = 'a.value', above = 4.0 }\n[modes.three]\nset.plus.by = 20.0",
    );
    let mut seen = Vec::new();
    for (i, value) in [1.0, 3.0, 3.0, 5.0, 5.0].into_iter().enumerate() {
        let ms = 10.0 * i as f64;
        rig.feed("a.value", ms, value);
        rig.tick(ms).unwrap();
        seen.push((*rig.get::<f64>("plus.value").unwrap(), *rig.get::<f64>("count.steps").unwrap()));
    }
    assert_eq!(seen, [(11.0, 1.0), (13.0, 2.0), (3.0, 3.0), (5.0, 4.0), (25.0, 5.0)]);
    let changes = rig.engine.changes();
    let told: Vec<_> = changes.iter().map(|c| (c.time / 1_000_000, c.mode.as_str(), c.reason.as_str())).collect();
    let expected = [(0, "one", ""), (10, "two", "`a.value` is above 2"), (30, "three", "`a.value` is above 4")];
    assert_eq!(told, expected);
}

#[test]
fn in_one_tick_the_sorts_have_their_order() {
    // The key of the exit that shall win comes last in the file.
    let ways = [
        ("go", "go = { to = 'two', after_ms = 20 }"),
        ("done", "done = { after_ms = 20 }"),
        ("on_lost", "on_lost = { of = 'a.value', after_ms = 20, to = 'two' }"),
        ("fail", "fail = { after_ms = 20 }"),
    ];
    for (i, (winner, way)) in ways.iter().enumerate() {
        let others: Vec<&str> = ways[..i].iter().map(|(_, way)| *way).collect();
        let mut rig =
            good(&format!("[modes.one]\n{}\n{way}\n[modes.two]\ngo = {{ to = 'one', on = 'x' }}", others.join("\n")));
        let mut result = Ok(());
        for i in 0..3 {
            result = rig.tick(10.0 * f64::from(i));
        }
        let said = match result {
            Err(fault) if matches!(fault.cause, Cause::Mode(_)) => "fail",
            Ok(()) if rig.engine.is_done() => "done",
            Ok(()) if rig.engine.mode() == Some("two") => {
                if rig.engine.changes()[1].reason.contains("lost") {
                    "on_lost"
                } else {
                    "go"
                }
            }
            other => panic!("{winner}: {other:?}"),
        };
        assert_eq!(said, *winner);
    }
}

#[test]
fn the_greater_priority_wins() {
    let modes = "[modes.one]\ngo = [{ to = 'two', after_ms = 20 }, { to = 'three', after_ms = 20, priority = 1 }]\n\
                 [modes.two]\n[modes.three]";
    let mut rig = good(modes);
    (0..3).for_each(|i| rig.tick(10.0 * f64::from(i)).unwrap());
    assert_eq!(rig.engine.mode(), Some("three"));
}

#[test]
fn a_failure_names_the_mode_its_reason_and_its_line() {
    let mut rig = good("[modes.one]\nfail = { after_ms = 15 }");
    rig.tick(0.0).unwrap();
    rig.tick(10.0).unwrap();
    let fault = rig.tick(20.0).unwrap_err();
    let expected = "a `fail` condition of mode `one` holds: 15 ms have passed in tick 3 at 0.020 s (graph.toml:14:8)";
    assert_eq!(fault.to_string(), expected);
}

#[test]
fn a_switch_acts_at_once_and_does_not_wait_for_the_next_sample() {
    let mut rig = good("[modes.one]\nset.plus.by = 10.0\ngo = { to = 'two', after_ms = 20 }\n[modes.two]");
    rig.feed("a.value", 0.0, 1.0);
    let mut seen = Vec::new();
    for i in 0..5 {
        rig.tick(10.0 * f64::from(i)).unwrap();
        seen.push(*rig.get::<f64>("plus.value").unwrap());
    }
    assert_eq!(seen, [11.0, 11.0, 11.0, 1.0, 1.0], "the sensor is silent, and the mode is another");
    assert!((rig.age_ms("plus.value") - 40.0).abs() < 1e-9, "what it gives is as old as its sample");
}

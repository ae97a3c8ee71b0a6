//! The semantics of time and absence, one test a sentence.

use tactflow_runtime::harness::GraphRig;
use tactflow_runtime::signal::{Freshness, Scalar};
use tactflow_tests::catalogue;
use tactflow_tests::nodes::length_by_hand;

/// A graph of roles a, b, … clocked by the first, with the blocks of `nodes`.
fn rig(roles: &[&'static str], nodes: &str) -> GraphRig {
    let declared: String = roles.iter().map(|role| format!("{role} = \"length\"\n")).collect();
    let text = format!("[graph]\nclock = \"{}\"\n[roles]\n{declared}{nodes}", roles[0]);
    let sources = roles.iter().map(|role| length_by_hand(role));
    GraphRig::new(catalogue(), &text, sources).unwrap_or_else(|report| panic!("{}", report.render(false)))
}

fn number(rig: &GraphRig, port: &str) -> Option<f64> {
    rig.get::<Scalar>(port).copied()
}

const COUNT: &str = "[nodes.count]\ntype = \"count\"\nin.value = \"a.value\"\n";

#[test]
fn a_node_steps_when_its_trigger_is_new_and_its_outputs_are_held_otherwise() {
    let mut rig = rig(&["a"], COUNT);
    assert_eq!(rig.freshness("count.steps"), Freshness::Absent);
    rig.feed("a.value", 0.0, 1.0);
    for (ms, steps, freshness) in [(0.0, 1.0, Freshness::New), (10.0, 1.0, Freshness::Held)] {
        rig.tick(ms).unwrap();
        assert_eq!((number(&rig, "count.steps"), rig.freshness("count.steps")), (Some(steps), freshness));
    }
}

#[test]
fn a_repeated_frame_is_not_new() {
    let mut rig = rig(&["a"], COUNT);
    for (ms, sequence) in [(0.0, 1), (10.0, 2), (20.0, 2), (30.0, 3)] {
        rig.feed_as("a.value", ms, ms, sequence, 1.0);
        rig.tick(ms).unwrap();
    }
    assert_eq!(number(&rig, "count.steps"), Some(3.0));
    let counters = rig.engine.counters().next().unwrap();
    assert_eq!((counters.new, counters.repeated, counters.went_back), (3, 1, 0));
}

#[test]
fn a_frame_with_the_stamp_of_the_last_is_not_new_either() {
    let mut rig = rig(&["a"], COUNT);
    for (ms, sequence) in [(0.0, 1), (10.0, 2)] {
        rig.feed_as("a.value", ms, 0.0, sequence, 1.0);
        rig.tick(ms).unwrap();
    }
    assert_eq!(number(&rig, "count.steps"), Some(1.0));
}

#[test]
fn a_stamp_that_goes_back_is_dropped_and_counted() {
    let mut rig = rig(&["a"], COUNT);
    for (ms, stamp, sequence, value) in
        [(0.0, 0.0, 1, 1.0), (10.0, 10.0, 2, 2.0), (20.0, 5.0, 3, 99.0), (30.0, 30.0, 4, 4.0)]
    {
        rig.feed_as("a.value", ms, stamp, sequence, value);
        rig.tick(ms).unwrap();
        assert_ne!(number(&rig, "a.value"), Some(99.0));
    }
    assert_eq!((number(&rig, "count.steps"), number(&rig, "count.time")), (Some(3.0), Some(0.03)));
    assert_eq!(rig.engine.counters().next().unwrap().went_back, 1);
}

#[test]
fn a_slow_source_is_a_slower_rate() {
    let nodes = "[nodes.fast]\ntype = \"count\"\nin.value = \"a.value\"\n[nodes.slow]\ntype = \"count\"\nin.value = \"b.value\"\n";
    let mut rig = rig(&["a", "b"], nodes);
    for i in 0..=40 {
        let ms = f64::from(i) * 10.0;
        rig.feed("a.value", ms, 1.0);
        if i % 4 == 0 {
            rig.feed("b.value", ms, 1.0);
        }
        rig.tick(ms).unwrap();
    }
    assert_eq!((number(&rig, "fast.steps"), number(&rig, "slow.steps")), (Some(41.0), Some(11.0)));
    let (fast, slow) = (number(&rig, "fast.time").unwrap(), number(&rig, "slow.time").unwrap());
    assert!((fast - 0.4).abs() < 1e-12 && (slow - 0.4).abs() < 1e-12, "{fast} and {slow} s have passed");
}

#[test]
fn a_gap_longer_than_max_gap_is_no_time_between_samples() {
    let mut rig = rig(&["a"], COUNT);
    for (ms, time) in [(0.0, 0.0), (50.0, 0.05), (1000.0, 0.05), (1050.0, 0.1)] {
        rig.feed("a.value", ms, 1.0);
        rig.tick(ms).unwrap();
        assert_eq!(number(&rig, "count.time"), Some(time), "{ms} ms; the graph's max_gap is five periods");
    }
}

/// `value` is absent whenever contact is: a label without a region.
const PAIR: &str = "
[nodes.pair]
type = \"pair\"
in.required = \"a.value\"
in.sampled = \"b.value\"
in.trigger = \"c.value\"
in.optional = \"d.value\"
";

#[test]
fn each_sort_of_input_wakes_as_it_says() {
    let mut rig = rig(&["a", "b", "c", "d"], PAIR);
    let mut steps = Vec::new();
    let feeds: [&[&str]; 9] = [&["a"], &["b"], &["a"], &["b"], &["d"], &["c"], &[], &["a"], &["c", "d"]];
    for (ms, roles) in (0..).map(|i| f64::from(i) * 10.0).zip(feeds) {
        for role in roles {
            rig.feed(&format!("{role}.value"), ms, 1.0);
        }
        rig.tick(ms).unwrap();
        steps.push(number(&rig, "pair.steps"));
    }
    let expected = [None, None, Some(1.0), Some(1.0), Some(1.0), Some(2.0), Some(2.0), Some(3.0), Some(4.0)];
    assert_eq!(steps, expected, "`sampled` that comes alone wakes nobody, nor does `optional`");
    assert_eq!((number(&rig, "pair.sum"), number(&rig, "pair.there")), (Some(4.0), Some(2.0)));
}

#[test]
fn a_command_is_as_old_as_the_oldest_of_its_triggers() {
    let mut rig = rig(&["a", "b", "c", "d"], PAIR);
    for (role, ms) in [("b", 0.0), ("a", 10.0), ("c", 20.0)] {
        rig.feed(&format!("{role}.value"), ms, 1.0);
    }
    rig.tick(25.0).unwrap();
    assert_eq!(rig.age_ms("pair.sum"), 15.0, "`b` is older, but only sampled");
}

#[test]
fn a_clock_device_that_misses_three_periods_is_replaced_by_a_timer() {
    let mut rig = rig(&["a"], COUNT);
    let ms = |rig: &GraphRig| rig.engine.next().map(|nanos| nanos as f64 * 1e-6).unwrap();
    rig.feed("a.value", 0.0, 1.0);
    let mut ticks = Vec::new();
    for i in 0..6 {
        let next = ms(&rig);
        if i == 4 {
            rig.feed("a.value", next + 3.0, 1.0);
        }
        let next = ms(&rig);
        rig.tick(next).unwrap();
        ticks.push(next);
    }
    assert_eq!(ticks, [0.0, 30.0, 40.0, 50.0, 60.0, 63.0]);
    assert_eq!(rig.age_ms("count.steps"), 0.0);
}

#[test]
fn what_is_downstream_of_a_dead_clock_grows_old() {
    let mut rig = rig(&["a"], COUNT);
    rig.feed("a.value", 0.0, 1.0);
    for _ in 0..5 {
        let next = rig.engine.next().unwrap() as f64 * 1e-6;
        rig.tick(next).unwrap();
    }
    assert_eq!((rig.freshness("count.steps"), rig.age_ms("count.steps")), (Freshness::Held, 60.0));
}

#[test]
fn a_loop_through_a_delay_reads_what_the_last_tick_left() {
    let nodes = "
[nodes.sum]
type = \"pair\"
in.required = \"a.value\"
in.sampled = \"a.value\"
in.trigger = \"delay.value\"
[nodes.delay]
type = \"unit_delay\"
in.value = \"sum.sum\"
";
    let mut rig = rig(&["a"], nodes);
    let mut sums = Vec::new();
    for i in 0..4 {
        let ms = f64::from(i) * 10.0;
        rig.feed("a.value", ms, 0.5);
        rig.tick(ms).unwrap();
        sums.push(number(&rig, "sum.sum").unwrap());
    }
    assert_eq!(sums, [1.0, 2.0, 3.0, 4.0], "an accumulator");
    assert_eq!(number(&rig, "delay.value"), Some(3.0));
}

#[test]
fn a_loop_without_a_delay_does_not_load() {
    let nodes = "
[nodes.one]
type = \"count\"
in.value = \"two.steps\"
[nodes.two]
type = \"count\"
in.value = \"one.steps\"
";
    let text = format!("[graph]\nrate_hz = 100\n{nodes}");
    let Err(report) = GraphRig::new(catalogue(), &text, vec![]) else { panic!("it loads") };
    let text = report.render(false);
    assert!(text.contains("`one.steps` -> `two.value`") && text.contains("`two.steps` -> `one.value`"), "{text}");
}

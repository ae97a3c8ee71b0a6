//! Measurements, in one run and interleaved: these machines are shared, so ratios count and times do not.
#![allow(clippy::print_stdout, reason = "a bench prints what it measured")]

mod chain;
mod finger_press;
mod fused;
mod hand;
mod recorded;
#[cfg(unix)]
mod watched;

use std::hint::black_box;
use std::time::Instant;

use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Request, compile};
use tactflow_tests::large::FAMILIES;

/// Rounds of which the median is taken.
const ROUNDS: usize = 61;

/// Median time of one call of each function [ns]: a few calls of each in turn, again and again.
fn medians(functions: &mut [&mut dyn FnMut()], calls: u32) -> Vec<f64> {
    let mut times = vec![Vec::new(); functions.len()];
    for _ in 0..ROUNDS {
        for (function, times) in functions.iter_mut().zip(&mut times) {
            let start = Instant::now();
            (0..calls).for_each(|_| function());
            times.push(start.elapsed().as_nanos() as f64 / f64::from(calls));
        }
    }
    times.iter_mut().for_each(|times| times.sort_by(f64::total_cmp));
    times.iter().map(|times| times[ROUNDS / 2]).collect()
}

fn chains() {
    let lengths = [0, 1, 8, 64, 512];
    let mut rigs = lengths.map(chain::chain);
    let mut ticks = rigs.each_mut().map(|rig| {
        move || {
            rig.engine.refresh();
            black_box(&mut rig.engine).step_bare();
        }
    });
    let [a, b, c, d, e] = ticks.each_mut();
    let medians = medians(&mut [a, b, c, d, e], 2000);
    println!("a tick without a node: {:.1} ns", medians[0]);
    for (length, median) in lengths.iter().zip(&medians).skip(1) {
        let each = (median - medians[0]) / *length as f64;
        let verdict = if each <= MOST_NODE { "good" } else { "TOO MUCH" };
        println!(
            "chain of {length:3} scalar nodes: {median:7.1} ns, {each:5.2} ns a node, at most {MOST_NODE}: {verdict}"
        );
    }
}

/// Greatest time of a scalar node [ns].
const MOST_NODE: f64 = 10.0;

/// Greatest ratio of the graph's bare tick to the same arithmetic fused by hand.
const MOST_BARE: f64 = 1.25;
/// The same with finite checks, sampled timing and the net that catches a panic.
const MOST: f64 = 1.4;
/// Greatest ratio of the time to record a tick of the hybrid task to the finger press fused by hand.
const MOST_RECORDED: f64 = 1.7;

/// Compares the graph with the fused function on the whole recording.
fn same_bits() {
    let mut whole = finger_press::Pair::new();
    let same = (0..whole.frames()).filter(|_| whole.step()).count();
    println!("joint velocities of graph and fused function have the same bits in {same} of {} ticks", whole.frames());
    assert_eq!(same, whole.frames());
}

fn finger_press() {
    same_bits();
    // In the middle of a press.
    const FRAME: usize = 150;
    let mut pair = finger_press::Pair::new();
    (0..=FRAME).for_each(|_| assert!(pair.step()));
    let (cells, arm) = (pair.cells(FRAME).to_vec(), pair.arm());
    let mut guarded = finger_press::Pair::resting();
    (0..=FRAME).for_each(|_| _ = guarded.step());
    let finger_press::Pair { engine, fused, .. } = &mut pair;
    let mut out = [0.0; 7];
    let mut bare = || {
        engine.refresh();
        black_box(&mut *engine).step_bare();
    };
    let mut graph = || {
        guarded.engine.refresh();
        black_box(&mut guarded.engine).step().expect("the recording is sound");
    };
    let mut by_hand = || {
        black_box(fused.tick(black_box(&cells), black_box([&arm[0][..], &arm[1][..]]), 0.1, 0.1, &mut out));
        black_box((fused.sum, fused.peak, fused.is_stuck, out));
    };
    let medians = medians(&mut [&mut by_hand, &mut bare, &mut graph], 500);
    println!("finger press, a tick fused by hand: {:.0} ns", medians[0]);
    for (what, time, most) in [("bare", medians[1], MOST_BARE), ("guarded and timed", medians[2], MOST)] {
        let ratio = time / medians[0];
        let verdict = if ratio <= most { "good" } else { "TOO MUCH" };
        println!(
            "finger press, a tick of the graph, {what}: {time:.0} ns, ratio {ratio:.3}, at most {most}: {verdict}"
        );
    }
}

/// Compares the time to record a tick of the hybrid task with the finger press fused by hand.
fn recorded() {
    const FRAME: usize = 150;
    let mut pair = finger_press::Pair::new();
    (0..=FRAME).for_each(|_| assert!(pair.step()));
    let (cells, arm) = (pair.cells(FRAME).to_vec(), pair.arm());
    let fused = &mut pair.fused;
    let mut out = [0.0; 7];
    let mut by_hand = || {
        black_box(fused.tick(black_box(&cells), black_box([&arm[0][..], &arm[1][..]]), 0.1, 0.1, &mut out));
        black_box((fused.sum, fused.peak, fused.is_stuck, out));
    };
    let fused = medians(&mut [&mut by_hand], 500)[0];
    let time = recorded::recording();
    let ratio = time / fused;
    let verdict = if ratio <= MOST_RECORDED { "good" } else { "TOO MUCH" };
    println!(
        "hybrid, recording a tick: {time:.0} ns, {ratio:.3} of the finger press fused by hand ({fused:.0} ns), at most {MOST_RECORDED}: {verdict}"
    );
}

/// Greatest ratio of a tick that is watched to one that is recorded alone.
#[cfg(unix)]
const MOST_WATCHED: f64 = 1.2;

/// Compares the time of a tick with watchers to that without.
#[cfg(unix)]
fn watched() {
    let [recorded, open, watched] = watched::watched();
    for (what, time) in [("an open socket", open), ("five watchers and garbage", watched)] {
        let ratio = time / recorded;
        let verdict = if ratio <= MOST_WATCHED { "good" } else { "TOO MUCH" };
        println!(
            "hybrid, a recorded tick with {what}: {time:.0} ns, ratio {ratio:.3} to {recorded:.0} ns, at most {MOST_WATCHED}: {verdict}"
        );
    }
}

/// Runs one of the two alone, for a tool that counts instructions: `tick -- graph 1000`.
fn count(what: &str, ticks: u32) {
    const FRAME: usize = 150;
    let mut pair = if what == "guarded" { finger_press::Pair::resting() } else { finger_press::Pair::new() };
    // The function fused by hand has the gains of the file.
    (0..=FRAME).for_each(|_| assert!(pair.step() || what == "guarded"));
    let (cells, arm) = (pair.cells(FRAME).to_vec(), pair.arm());
    let mut out = [0.0; 7];
    for _ in 0..ticks {
        match what {
            "graph" => {
                pair.engine.refresh();
                pair.engine.step_bare();
            }
            "guarded" => {
                pair.engine.refresh();
                pair.engine.step().expect("the recording is sound");
            }
            "fused" => {
                black_box(pair.fused.tick(
                    black_box(&cells),
                    black_box([&arm[0][..], &arm[1][..]]),
                    0.1,
                    0.1,
                    &mut out,
                ));
            }
            other => panic!("`{other}` is none of `graph`, `guarded` and `fused`"),
        }
    }
}

/// Loads a large graph and runs its first tick, for a tool that counts instructions: `tick -- load chain 1000`.
fn load(family: &str, nodes: usize) {
    let (_, graph) = FAMILIES.iter().find(|(name, _)| *name == family).expect("a family of large graphs");
    let plan = compile(&tactflow_nodes::catalogue(), &Request::text(graph(nodes))).expect("the graph has no mistake");
    let mut engine = Engine::new(plan);
    let now = engine.next().expect("there is a first sample");
    engine.tick(now).expect("the first tick has no fault");
}

/// Runs the hand with that many pads, for a tool that counts instructions: `tick -- hand 6 1000`.
fn count_hand(pads: usize, ticks: u32) {
    let mut engine = hand::hand(pads);
    for _ in 0..ticks {
        engine.refresh();
        engine.step().expect("nothing fails");
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.as_slice() {
        [what, family, nodes] if what == "load" => load(family, nodes.parse().expect("a number of nodes")),
        [what, pads, ticks] if what == "hand" => {
            count_hand(pads.parse().expect("a number of pads"), ticks.parse().expect("a number of ticks"));
        }
        [what] if what == "same" => same_bits(),
        [what] if what == "recorded" => recorded(),
        #[cfg(unix)]
        [what] if what == "watched" => watched(),
        [what, ticks] => count(what, ticks.parse().expect("a number of ticks")),
        _ => {
            chains();
            finger_press();
        }
    }
}

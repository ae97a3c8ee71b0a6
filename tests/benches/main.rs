//! Measurements, in one run and interleaved: these machines are shared, so ratios count and times do not.
#![allow(clippy::print_stdout, reason = "a bench prints what it measured")]

mod chain;

use std::hint::black_box;
use std::time::Instant;

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
    let lengths = [1, 8, 64, 512];
    let mut rigs = lengths.map(chain::chain);
    let [a, b, c, d] = rigs.each_mut();
    let mut ticks = [a, b, c, d].map(|rig| move || black_box(&mut rig.engine).tick_bare());
    let [a, b, c, d] = ticks.each_mut();
    let medians = medians(&mut [a, b, c, d], 2000);
    for (length, median) in lengths.iter().zip(&medians) {
        println!("chain of {length:3} scalar nodes: {median:8.1} ns a tick, {:5.2} ns a node", median / *length as f64);
    }
    let per_node = (medians[3] - medians[0]) / (lengths[3] - lengths[0]) as f64;
    println!("one more node costs {per_node:.2} ns");
}

fn main() {
    chains();
}

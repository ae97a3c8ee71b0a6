//! A few spoilt inputs for every parser. `.ci/fuzz` reads a million of each.

use std::time::{Duration, Instant};

use tactflow_tests::fuzz::{Campaign, TARGETS};

/// Time for one target.
const TIME: Duration = Duration::from_millis(400);
/// Most inputs of one target.
const INPUTS: u64 = 2000;
const SEED: u64 = 2026;

fn measure(run: &mut dyn FnMut()) -> u64 {
    allocation_counter::measure(run).bytes_max
}

#[test]
fn no_spoilt_input_makes_a_parser_panic_hang_or_take_too_much_memory() {
    for target in TARGETS {
        let campaign = Campaign::new(target, SEED, measure);
        let good = campaign.read_corpus().unwrap_or_else(|failure| panic!("{}, good: {failure}", target.name));
        assert!(good.accepted > 0, "{}: {good:?}", target.name);
        let (start, mut number) = (Instant::now(), 0);
        while number < INPUTS && start.elapsed() < TIME {
            let tally = campaign.run(number..number + 50, |_| {});
            tally.unwrap_or_else(|failure| panic!("{}, seed {SEED}: {failure}", target.name));
            number += 50;
        }
    }
}

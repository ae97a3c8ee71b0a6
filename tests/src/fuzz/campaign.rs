//! Inputs of one target, one after the other, up to the first that fails.

use std::any::Any;
use std::fmt;
use std::hint::black_box;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use tactflow_runtime::random::Random;

use super::mutate::Mutator;
use super::{Subject, Target};

/// Longest time for one input.
const LONGEST: Duration = Duration::from_secs(1);
/// How often an input is read that takes too long: other work of the machine does not hold it up each time.
const TRIALS: usize = 3;

/// Runs a function, and returns how much memory it had in use at once [bytes].
pub type Measure = fn(&mut dyn FnMut()) -> u64;

/// The spoilt inputs of a target. An input follows from the name of the target, the seed and its number.
pub struct Campaign {
    subject: Subject,
    seed: u64,
    measure: Measure,
    longest: Duration,
}

/// How many inputs were read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    /// Number of inputs.
    pub inputs: u64,
    /// How many of them were accepted.
    pub accepted: u64,
}

/// An input that fails.
#[derive(Debug, Clone)]
pub struct Failure {
    /// Its number.
    pub number: u64,
    /// The input.
    pub input: Vec<u8>,
    /// What is wrong.
    pub why: String,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "input {} of {} bytes: {}", self.number, self.input.len(), self.why)
    }
}

impl Campaign {
    /// Prepares the inputs of a target.
    #[must_use]
    pub fn new(target: &Target, seed: u64, measure: Measure) -> Self {
        // Targets of one seed do not share their random numbers.
        let seed = target.name.bytes().fold(seed, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
        Self { subject: (target.open)(), seed, measure, longest: LONGEST }
    }

    /// Returns the input with a number.
    #[must_use]
    pub fn input(&self, number: u64) -> Vec<u8> {
        Mutator { corpus: &self.subject.corpus, random: Random::new(self.seed, number) }.make()
    }

    /// Reads the good inputs. Returns how many are accepted.
    ///
    /// # Errors
    /// The first that fails. Its number is that in the corpus.
    pub fn read_corpus(&self) -> Result<Tally, Failure> {
        let mut tally = Tally::default();
        for (number, input) in (0..).zip(&self.subject.corpus) {
            let taken = self.take(number, input, &mut tally);
            taken.map_err(|failure| Failure { why: format!("a good input: {}", failure.why), ..failure })?;
        }
        Ok(tally)
    }

    /// Reads the inputs with these numbers. `watch` gets each number before its input is read.
    ///
    /// # Errors
    /// The first input that fails.
    pub fn run(&self, numbers: Range<u64>, mut watch: impl FnMut(u64)) -> Result<Tally, Failure> {
        let mut tally = Tally::default();
        for number in numbers {
            watch(number);
            self.take(number, &self.input(number), &mut tally)?;
        }
        Ok(tally)
    }

    fn take(&self, number: u64, input: &[u8], tally: &mut Tally) -> Result<(), Failure> {
        let accepted = self.read(input).map_err(|why| Failure { number, input: input.to_vec(), why })?;
        tally.inputs += 1;
        tally.accepted += u64::from(accepted);
        Ok(())
    }

    /// Reads an input. Returns whether it is accepted.
    ///
    /// # Errors
    /// Why it fails.
    pub fn read(&self, input: &[u8]) -> Result<bool, String> {
        let mut accepted = false;
        let mut fastest = Duration::MAX;
        for _ in 0..TRIALS {
            let start = Instant::now();
            let mut outcome = Ok(false);
            let memory = (self.measure)(&mut || {
                outcome = catch_unwind(AssertUnwindSafe(|| black_box((self.subject.read)(black_box(input)))));
            });
            fastest = fastest.min(start.elapsed());
            accepted = outcome.map_err(|panic| format!("panic: {}", message(&*panic)))?;
            let bound = (self.subject.max_memory)(input);
            if memory > bound {
                return Err(format!("{memory} bytes of memory were in use, and the bound is {bound}"));
            }
            if fastest <= self.longest {
                return Ok(accepted);
            }
        }
        Err(format!("it takes {} ms, accepted: {accepted}", fastest.as_millis()))
    }
}

fn message(panic: &(dyn Any + Send)) -> &str {
    match (panic.downcast_ref::<String>(), panic.downcast_ref::<&str>()) {
        (Some(text), _) => text,
        (None, Some(text)) => text,
        (None, None) => "without a message",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measure(run: &mut dyn FnMut()) -> u64 {
        run();
        0
    }

    fn campaign(read: fn(&[u8]) -> bool, measure: Measure) -> Campaign {
        let subject = Subject { corpus: vec![b"good".to_vec()], read: Box::new(read), max_memory: |_| 100 };
        Campaign { subject, seed: 1, measure, longest: Duration::from_millis(100) }
    }

    #[test]
    fn a_panic_and_a_waste_of_memory_are_failures_that_repeat() {
        let shy = campaign(
            |input| {
                assert!(!input.contains(&b'0'), "a zero");
                true
            },
            measure,
        );
        let failure = shy.run(0..1000, |_| {}).unwrap_err();
        assert!(failure.input.contains(&b'0') && failure.why == "panic: a zero", "{failure}");
        assert_eq!(shy.input(failure.number), failure.input);
        let last = shy.run(0..failure.number, |_| {}).unwrap();
        assert_eq!(last, Tally { inputs: failure.number, accepted: failure.number });
        let greedy = campaign(
            |_| false,
            |run| {
                run();
                101
            },
        );
        assert_eq!(greedy.read(b"").unwrap_err(), "101 bytes of memory were in use, and the bound is 100");
        assert_eq!(campaign(|_| false, measure).run(0..9, |_| {}).unwrap(), Tally { inputs: 9, accepted: 0 });
    }

    #[test]
    fn an_input_that_takes_too_long_is_a_failure() {
        let slow = campaign(
            |_| {
                std::thread::sleep(Duration::from_millis(101));
                true
            },
            measure,
        );
        assert!(slow.read(b"").unwrap_err().starts_with("it takes 1"));
    }
}

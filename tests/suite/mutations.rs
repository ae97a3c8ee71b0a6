//! Seeded mutations of one token of the shipped graphs, their parts and their benches: each is told of, or means the
//! same, or is another graph that somebody could have meant.
//!
//! Whether it means the same is decided by a run: every recorded bit of every tick. Whether it could have been meant is
//! decided by what changed in the tree of values, so narrowly that a name that is wrong never passes.

mod lexer;
mod meant;
mod messages;

use std::collections::BTreeMap;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::Duration;

use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::random::Random;
use tactflow_tests::{catalogue, workspace};

use crate::course::{Course, course};
use crate::growth::processor_time;
use lexer::{Token, tokens};
use meant::{Meant, could_be_meant};

/// Number of seeds. `TACTFLOW_SEEDS` sets another one: `.ci/edge` takes more.
const SEEDS: u64 = 2;
/// Mutants a seed and a graph.
const MUTANTS: usize = 300;
/// Ticks of a run at most: a mutant may run for ever.
const TICKS: usize = 1100;
/// On the processor: the time on the wall depends on what else runs.
const LONGEST: Duration = Duration::from_secs(1);

/// What is done to a token, or to its line.
#[derive(Debug, Clone, Copy)]
enum Operation {
    Delete,
    Double,
    Swap,
    Replace,
    DeleteLine,
    DuplicateLine,
    Case,
    Plural,
    DropQuote,
    SwapTokens,
}

impl Operation {
    const ALL: [Self; 10] = [
        Self::Delete,
        Self::Double,
        Self::Swap,
        Self::Replace,
        Self::DeleteLine,
        Self::DuplicateLine,
        Self::Case,
        Self::Plural,
        Self::DropQuote,
        Self::SwapTokens,
    ];
}

/// A text with the token at `index` mutated; none if that changes nothing.
fn mutate(text: &str, tokens: &[Token], index: usize, operation: Operation, random: &mut Random) -> Option<String> {
    let token = &tokens[index];
    let mut chars: Vec<char> = text[token.span.clone()].chars().collect();
    let at = random.below(chars.len());
    match operation {
        Operation::Delete => drop(chars.remove(at)),
        Operation::Double => chars.insert(at, chars[at]),
        Operation::Swap => {
            let next = (at + 1).min(chars.len() - 1);
            chars.swap(at, next);
        }
        Operation::Case => chars = chars.into_iter().flat_map(char::to_uppercase).collect(),
        Operation::Plural => match chars.iter().rposition(|c| c.is_ascii_alphabetic())? {
            last if chars[last] == 's' => drop(chars.remove(last)),
            last => chars.insert(last + 1, 's'),
        },
        Operation::DropQuote => {
            let quote = if random.below(2) == 0 { 0 } else { chars.len() - 1 };
            if chars[quote] != '"' {
                return None;
            }
            chars.remove(quote);
        }
        Operation::SwapTokens => {
            let next = tokens.get(index + 1)?;
            let (one, other) = (&text[token.span.clone()], &text[next.span.clone()]);
            let between = &text[token.span.end..next.span.start];
            let mutant = [&text[..token.span.start], other, between, one, &text[next.span.end..]].concat();
            return (!between.contains('\n') && mutant != text).then_some(mutant);
        }
        Operation::Replace => chars = text[tokens[random.below(tokens.len())].span.clone()].chars().collect(),
        Operation::DeleteLine | Operation::DuplicateLine => {
            let start = text[..token.span.start].rfind('\n').map_or(0, |end| end + 1);
            let end = text[token.span.end..].find('\n').map_or(text.len(), |end| token.span.end + end + 1);
            let line = if matches!(operation, Operation::DeleteLine) { "" } else { &text[start..end] };
            return Some([&text[..start], line, line, &text[end..]].concat());
        }
    }
    let mutant = [&text[..token.span.start], &String::from_iter(chars), &text[token.span.end..]].concat();
    (mutant != text).then_some(mutant)
}

/// A number of the environment.
fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|number| number.parse().ok()).unwrap_or(default)
}

/// A copy of the shipped graphs that may be broken.
struct Copy {
    folder: tempfile::TempDir,
}

impl Copy {
    fn new() -> Self {
        fn copy(from: &Path, to: &Path) {
            fs::create_dir_all(to).unwrap();
            for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
                let to = to.join(entry.file_name());
                if entry.path().is_dir() {
                    copy(&entry.path(), &to);
                } else {
                    fs::copy(entry.path(), to).unwrap();
                }
            }
        }
        let folder = tempfile::tempdir().unwrap();
        copy(&workspace().join("graphs"), folder.path());
        // Thousands of runs: on the bench that does as it is told.
        let hybrid = folder.path().join("hybrid.toml");
        let text = fs::read_to_string(&hybrid).unwrap();
        assert!(text.contains("benches/ball.toml"));
        fs::write(hybrid, text.replace("benches/ball.toml", "benches/mock.toml")).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

/// What became of a mutant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Fate {
    /// It does not load, or a warning is given, or its run ends in a fault.
    Told,
    /// It loads and does the same.
    Same,
    /// It is another graph that could be meant.
    Meant(Meant),
    /// It is another graph, and nobody was told.
    Silent,
}

/// Returns the time on the processor since `start` [ns].
fn took(start: f64) -> Duration {
    Duration::from_nanos((processor_time() - start) as u64)
}

/// What becomes of the graph `name` in the folder, given what it was before.
fn fate(copy: &Copy, name: &str, original: &Course, before: &str, after: &str) -> Fate {
    let start = processor_time();
    let plan = match compile(&catalogue(), &Request::file(copy.path(name))) {
        Ok(plan) => plan,
        Err(report) => {
            assert!(!report.diagnostics.is_empty(), "it does not load and says nothing");
            assert!(report.render(false).contains("error["));
            assert!(took(start) < LONGEST, "it took {:?} to say so", took(start));
            return Fate::Told;
        }
    };
    assert!(took(start) < LONGEST, "it took {:?} to load", took(start));
    if plan.warnings().is_some() {
        return Fate::Told;
    }
    let course = course(plan, TICKS);
    assert!(took(start) < 2 * LONGEST, "it took {:?} to load and run", took(start));
    if course.fault.is_some() {
        return Fate::Told;
    }
    if course == *original {
        return Fate::Same;
    }
    could_be_meant(before, after).map_or(Fate::Silent, Fate::Meant)
}

/// Mutates the files of a graph and counts what becomes of them; what passes silently is written out.
fn mutants(name: &str, files: &[&str], seed: u64, counts: &mut BTreeMap<Fate, usize>) -> Vec<String> {
    let copy = Copy::new();
    let original = course(crate::course::loaded(&Request::file(copy.path(name))), TICKS);
    let mut random = Random::new(seed, 0);
    let mut silent = Vec::new();
    let texts: Vec<(PathBuf, String, Vec<Token>)> = files
        .iter()
        .map(|file| {
            let text = fs::read_to_string(copy.path(file)).unwrap();
            let tokens = tokens(&text);
            (copy.path(file), text, tokens)
        })
        .collect();
    let total: usize = texts.iter().map(|(.., tokens)| tokens.len()).sum();
    for _ in 0..MUTANTS {
        // A file is as likely as it has tokens.
        let mut at = random.below(total);
        let (path, text, tokens) = texts
            .iter()
            .find(|(.., tokens)| {
                at < tokens.len() || {
                    at -= tokens.len();
                    false
                }
            })
            .unwrap();
        // Two numbers of a list exchanged are another list that somebody could have meant.
        let operation = Operation::ALL[random.below(Operation::ALL.len() - 1)];
        let index = random.below(tokens.len());
        let Some(mutant) = mutate(text, tokens, index, operation, &mut random) else { continue };
        fs::write(path, &mutant).unwrap();
        let told =
            || format!("{name}, seed {seed}, {operation:?} in {}:\n{}", path.display(), difference(text, &mutant));
        let fate = catch_unwind(AssertUnwindSafe(|| fate(&copy, name, &original, text, &mutant)));
        let fate = fate.unwrap_or_else(|_| panic!("{}", told()));
        fs::write(path, text).unwrap();
        if fate == Fate::Silent {
            silent.push(told());
        }
        *counts.entry(fate).or_default() += 1;
    }
    silent
}

/// The lines that differ.
fn difference(before: &str, after: &str) -> String {
    let (before, after): (Vec<&str>, Vec<&str>) = (before.lines().collect(), after.lines().collect());
    let head = before.iter().zip(&after).take_while(|(a, b)| a == b).count();
    let rest = before[head..].iter().rev().zip(after[head..].iter().rev()).take_while(|(a, b)| a == b).count();
    let part = |lines: &[&str], sign: char| {
        lines[head..lines.len() - rest].iter().map(|line| format!("{}: {sign} {line}\n", head + 1)).collect::<String>()
    };
    part(&before, '-') + &part(&after, '+')
}

#[test]
fn no_mutant_passes_silently() {
    const PRESS: [&str; 4] = ["finger_press.toml", "parts/touch.toml", "parts/move.toml", "benches/finger_press.toml"];
    const HYBRID: [&str; 4] = ["hybrid.toml", "parts/touch.toml", "parts/move.toml", "benches/mock.toml"];
    let seeds = number("TACTFLOW_SEEDS", SEEDS);
    let jobs = (1..=seeds).flat_map(|seed| [(PRESS, seed), (HYBRID, seed)]);
    let results: Vec<_> = std::thread::scope(|scope| {
        let run = |(files, seed): ([&'static str; 4], u64)| {
            scope.spawn(move || {
                let mut counts = BTreeMap::new();
                (mutants(files[0], &files, seed, &mut counts), counts)
            })
        };
        let threads: Vec<_> = jobs.map(run).collect();
        threads
            .into_iter()
            .map(|thread| thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    });
    let mut counts: BTreeMap<Fate, usize> = BTreeMap::new();
    for (fate, count) in results.iter().flat_map(|(_, counts)| counts) {
        *counts.entry(*fate).or_default() += count;
    }
    let silent: Vec<String> = results.into_iter().flat_map(|(silent, _)| silent).collect();
    assert!(silent.is_empty(), "{} pass silently, of {counts:?}\n{}", silent.len(), silent.join("\n"));
    let of = |fate: Fate| counts.get(&fate).copied().unwrap_or(0);
    let total: usize = counts.values().sum();
    assert!(total > seeds as usize * MUTANTS, "{counts:?}");
    assert!(of(Fate::Told) * 10 > total * 6, "most mutants are mistakes, and told: {counts:?}");
    let meant: usize = counts.iter().filter(|(fate, _)| matches!(fate, Fate::Meant(_))).map(|(_, count)| count).sum();
    assert!(meant * 10 < total, "few are another graph that could be meant: {counts:?}");
}

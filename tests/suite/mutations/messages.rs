//! What the messages about a mutant are worth: the first is on the line of the mutation, its suggestion is the token that
//! was there, and one changed token gives one message.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::random::Random;
use tactflow_runtime::source::{Report, Severity};
use tactflow_tests::catalogue;

use super::lexer::{Token, tokens};
use super::{Copy, Operation, difference, mutate, number};
use crate::fixes;

/// Graphs with a bench each, and the files that they read.
const GRAPHS: [(&str, &[&str]); 6] = [
    ("finger_press.toml", &["finger_press.toml", "parts/touch.toml", "parts/move.toml", "benches/finger_press.toml"]),
    ("hybrid.toml", &["hybrid.toml", "parts/ruler.toml", "parts/answer.toml", "benches/mock.toml"]),
    ("cable.toml", &["cable.toml", "benches/cable.toml"]),
    ("explore.toml", &["explore.toml", "benches/object.toml"]),
    ("seek_ridge.toml", &["seek_ridge.toml", "benches/ridge.toml"]),
    ("edge.toml", &["edge.toml", "benches/edge.toml"]),
];

/// The mutations of one token, and how well the messages about them are.
#[derive(Debug, Default)]
struct Score {
    reported: usize,
    on_line: usize,
    named: usize,
    suggested: usize,
    single: usize,
}

struct Mutant {
    operation: Operation,
    file: PathBuf,
    /// Lines of the mutant on which a message about it can be, from 1.
    lines: std::ops::RangeInclusive<usize>,
    /// The name that was there, if a suggestion can give it.
    original: Option<String>,
    /// Number of changed tokens.
    changed: usize,
    text: String,
}

/// Returns the lines of the block around a line: from its header to the next one.
fn block(text: &str, line: usize) -> std::ops::RangeInclusive<usize> {
    let lines: Vec<&str> = text.lines().collect();
    let is_header = |line: &&str| line.starts_with('[');
    let at = line.min(lines.len());
    let start = lines[..at].iter().rposition(is_header).map_or(1, |at| at + 1);
    let end = lines[at..].iter().position(is_header).map_or(lines.len(), |next| at + next);
    start..=end.max(start)
}

fn mutant(file: PathBuf, text: &str, tokens: &[Token], operation: Operation, random: &mut Random) -> Option<Mutant> {
    let index = random.below(tokens.len());
    let mutant = mutate(text, tokens, index, operation, random)?;
    let token = &text[tokens[index].span.clone()];
    let line = text[..tokens[index].span.start].matches('\n').count() + 1;
    let lines = match operation {
        Operation::DeleteLine => {
            let block = block(&mutant, line.saturating_sub(1).max(1));
            (*block.start()).min(line)..=(*block.end()).max(line)
        }
        Operation::DuplicateLine => line..=line + 1,
        _ => line..=line,
    };
    let is_word = |c: char| c.is_ascii_alphabetic() || c == '"';
    let is_name = token.starts_with(is_word) && !matches!(token, "true" | "false");
    let changes_name = !matches!(
        operation,
        Operation::DeleteLine | Operation::DuplicateLine | Operation::DropQuote | Operation::SwapTokens
    );
    // Nobody can know the text that another text has replaced as a whole.
    let is_whole = matches!(operation, Operation::Replace) && token.starts_with('"');
    let is_lost = is_whole || matches!(operation, Operation::Delete) && token.len() == 1;
    let original = (is_name && changes_name && !is_lost).then(|| token.trim_matches('"').to_owned());
    let is_on_line = |other: &&Token| text[..other.span.start].matches('\n').count() + 1 == line;
    let changed = match operation {
        Operation::DeleteLine | Operation::DuplicateLine => tokens.iter().filter(is_on_line).count(),
        Operation::SwapTokens => 2,
        _ => 1,
    };
    Some(Mutant { operation, file, lines, original, changed, text: mutant })
}

impl Mutant {
    /// Scores the messages about the mutant, and returns what is not as it should be.
    fn score(&self, report: &Report, score: &mut Score) -> Vec<&'static str> {
        let mut wrong = Vec::new();
        let mut check = |is_right: bool, count: &mut usize, what: &'static str| {
            *count += usize::from(is_right);
            if !is_right {
                wrong.push(what);
            }
        };
        score.reported += 1;
        let first = &report.diagnostics[0];
        let place = report.sources.location(&first.span);
        let is_here = self.file.ends_with(&place.file) || PathBuf::from(&place.file).ends_with(&self.file);
        check(is_here && self.lines.contains(&place.line), &mut score.on_line, "line");
        let errors = report.diagnostics.iter().filter(|d| d.code.severity() == Severity::Error).count();
        check(errors <= self.changed, &mut score.single, "count");
        if let Some(original) = &self.original {
            score.named += 1;
            let help = first.help.as_deref().unwrap_or_default();
            let words: Vec<&str> = help.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).collect();
            let is_there = |part: &str| words.contains(&part);
            let is_suggested = help.contains(original) || original.split('.').any(is_there);
            check(is_suggested, &mut score.suggested, "suggestion");
        }
        wrong
    }
}

/// Mutates the files of all graphs and returns the scores of each operation. What is wrong is written out if
/// `is_verbose`.
#[expect(clippy::print_stderr, reason = "whoever measures with a seed reads what is wrong")]
fn scores(seed: u64, count: usize, operations: &[Operation], is_verbose: bool) -> BTreeMap<String, Score> {
    let copy = Copy::new();
    let catalogue = catalogue();
    let mut random = Random::new(seed, 0);
    let mut scores: BTreeMap<String, Score> = BTreeMap::new();
    for _ in 0..count {
        let (graph, files) = GRAPHS[random.below(GRAPHS.len())];
        let file = copy.path(files[random.below(files.len())]);
        let text = fs::read_to_string(&file).unwrap();
        let tokens = tokens(&text);
        let operation = operations[random.below(operations.len())];
        let Some(mutant) = mutant(file.clone(), &text, &tokens, operation, &mut random) else { continue };
        fs::write(&file, &mutant.text).unwrap();
        let result = compile(&catalogue, &Request::file(copy.path(graph)));
        fs::write(&file, &text).unwrap();
        let Some(report) = result.map_or_else(Some, |plan| plan.warnings()) else { continue };
        let score = scores.entry(format!("{:?}", mutant.operation)).or_default();
        let wrong = mutant.score(&report, score);
        if is_verbose && !wrong.is_empty() {
            let change = difference(&text, &mutant.text);
            eprintln!("=== {wrong:?} {operation:?} {graph} {}\n{change}{}", file.display(), report.render(false));
        }
    }
    scores
}

fn sum(scores: &BTreeMap<String, Score>) -> Score {
    scores.values().fold(Score::default(), |sum, score| Score {
        reported: sum.reported + score.reported,
        on_line: sum.on_line + score.on_line,
        named: sum.named + score.named,
        suggested: sum.suggested + score.suggested,
        single: sum.single + score.single,
    })
}

/// Each fix of a mutant can be applied: its mistake is gone, and no new one appears.
#[test]
fn the_fixes_of_mutants_mend_them() {
    let (copy, fresh) = (Copy::new(), Copy::new());
    let mut random = Random::new(7, 0);
    let (mut tried, mut mended, mut wrong, mut left) = (0, 0, Vec::new(), Vec::new());
    for _ in 0..number("TACTFLOW_FIXES", 140) {
        let (graph, files) = GRAPHS[random.below(GRAPHS.len())];
        let (graph, file) = (copy.path(graph), copy.path(files[random.below(files.len())]));
        let text = fs::read_to_string(&file).unwrap();
        let tokens = tokens(&text);
        let operation = Operation::ALL[random.below(Operation::ALL.len())];
        let Some(mutant) = mutant(file.clone(), &text, &tokens, operation, &mut random) else { continue };
        fs::write(&file, &mutant.text).unwrap();
        let report = fixes::check(&graph);
        let fixed = report.iter().flat_map(|report| &report.diagnostics).find(|diagnostic| !diagnostic.fix.is_empty());
        if let (Some(report), Some(fixed)) = (&report, fixed) {
            tried += 1;
            let change = || difference(&text, &mutant.text);
            wrong.extend(fixes::try_fix(&graph, report, fixed).map(|wrong| format!("{}{wrong}", change())));
            match fixes::rounds(&graph) {
                Some(_) => mended += 1,
                None => left.push(format!("{}{}", change(), fixes::check(&graph).unwrap().render(false))),
            }
        }
        restore(&copy, &fresh);
    }
    assert!(tried > 28, "{tried} fixes");
    assert!(wrong.is_empty(), "{} of {tried} fixes are wrong\n{}", wrong.len(), wrong.join("\n"));
    assert!(mended * 4 >= tried * 3, "{mended} of {tried} load after their fixes\n{}", left.join("\n"));
}

/// Undoes all changes in a copy.
fn restore(copy: &Copy, fresh: &Copy) {
    for file in GRAPHS.iter().flat_map(|(_, files)| *files) {
        fs::copy(fresh.path(file), copy.path(file)).unwrap();
    }
}

/// One changed token gives one message, on its line, that suggests the token that was there.
#[test]
fn the_first_message_is_about_the_changed_token() {
    let (seed, count) = (number("TACTFLOW_SEED", 11), number("TACTFLOW_MUTANTS", 1600) as usize);
    let scores = scores(seed, count, &Operation::ALL, std::env::var_os("TACTFLOW_SEED").is_some());
    let total = sum(&scores);
    let text = format!("{total:?}, of {scores:#?}");
    assert!(total.reported * 2 > count, "{text}");
    assert!(total.on_line * 100 >= total.reported * 96, "first message on another line: {text}");
    assert!(total.suggested * 100 >= total.named * 95, "the original token is not suggested: {text}");
    assert!(total.single * 100 >= total.reported * 95, "several messages for one token: {text}");
}

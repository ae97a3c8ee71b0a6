//! The files of a graph: each kind is spoilt in a copy of the shipped folder, and checked with what names it.
//!
//! The first byte of an input selects the file that it replaces. Nothing runs, and no simulator is called: an input
//! that names the device `lockstep` is left out.

use std::cell::RefCell;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use tactflow_nodes::arm::model;
use tactflow_nodes::arm::mount::Mount;
use tactflow_nodes::calibration::file;
use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::node::{At, FilePath, Mistakes};
use tactflow_runtime::scenario::Scenario;
use tactflow_runtime::source::{Report, SourceMap};

use super::Subject;
use crate::{catalogue, toml_files, workspace};

/// What a check may take beside a multiple of the input: the plan and the other files of the graph [bytes].
const BESIDE: u64 = 96 << 20;
/// What a check may take for each byte.
const PER_BYTE: u64 = 2000;

/// A file of the folder, and what reads it.
#[derive(Clone)]
struct Place {
    file: PathBuf,
    read: Read,
}

#[derive(Clone)]
enum Read {
    /// A graph, on its own bench or on another.
    Graph(PathBuf, Option<PathBuf>),
    Scenario,
    /// A robot model, up to the link of this name.
    Urdf(&'static str),
}

/// A copy of the shipped folder in which files are spoilt, for as long as it lives.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let name = format!("tactflow-fuzz-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        let folder = Self(std::env::temp_dir().join(name));
        for kind in ["", "benches", "calibrations", "pads", "parts", "robots", "scenarios", "scenarios/tasks"] {
            let from = workspace().join("graphs").join(kind);
            fs::create_dir_all(folder.0.join(kind)).expect("a folder for temporary files");
            for entry in fs::read_dir(from).expect("the folder ships").flatten() {
                if entry.path().extension().is_some_and(|end| end == "toml" || end == "urdf") {
                    let to = folder.0.join(kind).join(entry.file_name());
                    fs::copy(entry.path(), to).expect("a copy of a small file");
                }
            }
        }
        fs::write(folder.0.join("benches/pad.toml"), PAD_BENCH).expect("a small file");
        folder
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What is left lies among the temporary files.
        let _ = fs::remove_dir_all(&self.0);
    }
}

const PAD_BENCH: &str = "[bind]\npad = \"skin\"\n[devices.skin]\ntype = \"stream\"\nsensor = \"../pads/anyskin.toml\"\n\
                         link = \"tcp:127.0.0.1:1\"\n";

fn subject(places: Vec<(&str, Read)>) -> Subject {
    let folder = Folder::new();
    let places: Vec<Place> = places.into_iter().map(|(file, read)| Place { file: file.into(), read }).collect();
    let good = |place: &Place| {
        let shipped = folder.0.join(&place.file);
        fs::read(shipped).unwrap_or_else(|why| panic!("{}: {why}", place.file.display()))
    };
    let good: Vec<Vec<u8>> = places.iter().map(good).collect();
    let corpus = good.iter().enumerate().map(|(i, text)| [&[i as u8], &**text].concat()).collect();
    let catalogue = catalogue();
    Subject {
        corpus,
        read: Box::new(move |input| {
            let (first, text) = input.split_first().unwrap_or((&0, &[]));
            if text.windows(8).any(|word| word.eq_ignore_ascii_case(b"lockstep")) {
                return false;
            }
            let at = usize::from(*first) % places.len();
            let path = folder.0.join(&places[at].file);
            fs::write(&path, text).expect("a small file");
            let is_accepted = check(&catalogue, &folder.0, &places[at]);
            fs::write(&path, &good[at]).expect("a small file");
            is_accepted
        }),
        max_memory: |input| PER_BYTE * input.len() as u64 + BESIDE,
    }
}

fn check(catalogue: &Catalogue, folder: &Path, place: &Place) -> bool {
    let file = folder.join(&place.file);
    let checked = match &place.read {
        Read::Graph(graph, bench) => {
            let request =
                Request { bench: bench.as_ref().map(|bench| folder.join(bench)), ..Request::file(folder.join(graph)) };
            compile(catalogue, &request).map(|compiled| compiled.warnings())
        }
        Read::Scenario => Scenario::load(catalogue, &file).map(|all| all.iter().find_map(Scenario::warnings).cloned()),
        Read::Urdf(tip) => {
            let urdf = FilePath { path: file, span: 0..0, builtin: None };
            return model::load(&urdf, tip, &Mount::NONE).map_err(|mistakes| check_mistakes(&mistakes, None)).is_ok();
        }
    };
    let is_accepted = checked.is_ok();
    checked.unwrap_or_else(Some).iter().for_each(check_report);
    is_accepted
}

/// Checks that each diagnostic has a message and marks a place of a text, and that it can be shown and mended.
fn check_report(report: &Report) {
    assert!(!report.diagnostics.is_empty(), "refused for no reason");
    for diagnostic in &report.diagnostics {
        assert!(!diagnostic.message.trim().is_empty(), "{diagnostic:?}");
        check_span(&report.sources, &diagnostic.span, &diagnostic.message);
        diagnostic.notes.iter().for_each(|(span, label)| check_span(&report.sources, span, label));
        let edited = report.sources.edited(&diagnostic.fix);
        assert_eq!(edited.is_empty(), diagnostic.fix.is_empty(), "{diagnostic:?}");
    }
    assert!(!report.render(false).is_empty());
}

fn check_span(sources: &SourceMap, span: &Range<usize>, message: &str) {
    let file = sources.file_at(span.start);
    let local = span.start.checked_sub(file.base).zip(span.end.checked_sub(file.base));
    let is_inside = local.is_some_and(|(start, end)| file.text.get(start..end).is_some());
    assert!(is_inside, "{span:?} is no place of `{}`, {:?}: {message}", file.name, file.span());
    assert!(!sources.locate(span.start).is_empty());
}

/// Checks the mistakes in a data file. Places that are spans lie in `text`.
fn check_mistakes(mistakes: &Mistakes, text: Option<&str>) {
    assert!(!mistakes.is_empty(), "refused for no reason");
    for mistake in mistakes {
        assert!(!mistake.message.trim().is_empty(), "{mistake:?}");
        let is_inside = match (&mistake.at, text) {
            (At::Data { text, span, .. }, _) => text.get(span.clone()).is_some(),
            (At::Span(span), Some(text)) => text.get(span.clone()).is_some(),
            _ => true,
        };
        assert!(is_inside, "{mistake:?} is not in the text");
    }
}

/// Every task that ships, and the graphs that must fail, which are small.
pub(super) fn graphs() -> Subject {
    let own = |name: &'static str| (name, Read::Graph(name.into(), None));
    let names = ["look.toml", "force.toml", "hybrid.toml", "edge.toml", "explore.toml", "carry.toml", "two_arms.toml"];
    let mut subject = subject(names.map(own).into());
    // As often as the graphs that must fail, of which there are many.
    (0..4).for_each(|_| subject.corpus.extend_from_within(..));
    let failing = toml_files(&workspace().join("tests/errors")).into_iter();
    subject.corpus.extend(failing.map(|file| [&[0], &*fs::read(file).expect("a file of the tests")].concat()));
    subject
}

/// Every part.
pub(super) fn parts() -> Subject {
    let of = |file, graph: &str| (file, Read::Graph(graph.into(), None));
    subject(vec![
        of("parts/touch.toml", "force.toml"),
        of("parts/move.toml", "force.toml"),
        of("parts/ruler.toml", "force.toml"),
        of("parts/answer.toml", "force.toml"),
        of("parts/carry_side.toml", "carry.toml"),
    ])
}

/// Benches of every kind of device that reads no large file.
pub(super) fn benches() -> Subject {
    let with = |bench: &'static str, graph: &str| (bench, Read::Graph(graph.into(), Some(bench.into())));
    subject(vec![
        with("benches/mock.toml", "force.toml"),
        with("benches/ball.toml", "force.toml"),
        with("benches/cable.toml", "force.toml"),
        with("benches/table.toml", "force.toml"),
        with("benches/toy_box.toml", "force.toml"),
        with("benches/myrmex_lwr.toml", "force.toml"),
        with("benches/ur5e_rtde.toml", "force.toml"),
        with("benches/lwr_fri.toml", "force.toml"),
        with("benches/carried_box.toml", "carry.toml"),
        with("benches/two_arms.toml", "two_arms.toml"),
    ])
}

/// Robots: the file that names a model, with its limits.
pub(super) fn robots() -> Subject {
    let on = |file, bench: &str| (file, Read::Graph("force.toml".into(), Some(bench.into())));
    subject(vec![on("robots/lwr4p.toml", "benches/ball.toml"), on("robots/ur5e.toml", "benches/ur5e_rtde.toml")])
}

/// Descriptions of pads.
pub(super) fn pads() -> Subject {
    let shipped = toml_files(&workspace().join("graphs/pads")).into_iter();
    let read = Read::Graph("look.toml".into(), Some("benches/pad.toml".into()));
    let mut subject = subject(vec![("pads/anyskin.toml", read)]);
    subject.corpus = shipped.map(|file| [&[0], &*fs::read(file).expect("it ships")].concat()).collect();
    subject
}

/// Scenarios.
pub(super) fn scenarios() -> Subject {
    let names = ["scenarios/fig2.toml", "scenarios/fig11.toml", "scenarios/square.toml", "scenarios/carry.toml"];
    subject(names.map(|name| (name, Read::Scenario)).into())
}

/// Robot models.
pub(super) fn models() -> Subject {
    subject(vec![
        ("robots/lwr4p.urdf", Read::Urdf("lwr_7_link")),
        ("robots/ur5e.urdf", Read::Urdf("tool0")),
        ("robots/panda.urdf", Read::Urdf("panda_link8")),
    ])
}

/// Calibrations. One that is read is the same after it is written and read again.
pub(super) fn calibrations() -> Subject {
    let rows = ["{ at = [0, 0], offset = 1.5, gain = 0.01 }", "{ at = [0, 1], offset = 2.0, gain = 0.02 }"];
    let head =
        "kind = \"calibration\"\nversion = 1\nrows = 1\ncols = 3\nreading = \"raw\"\nunit = \"N\"\ndead = [[0, 2]]\n";
    let linear = format!("{head}curve = \"linear\"\ntactels = [\n  {},\n  {},\n]\n", rows[0], rows[1]);
    let rational = linear.replace("linear", "rational").replace(" }", ", squash = 0.001, most = 5.0 }");
    let knots = "readings = [10.0, 20.0], forces = [1.0, 3.0]";
    let piecewise = linear.replace("linear", "piecewise").replace("gain = 0.01", knots).replace("gain = 0.02", knots);
    Subject {
        corpus: [linear, rational, piecewise].map(String::into_bytes).into(),
        read: Box::new(|input| {
            let text = String::from_utf8_lossy(input);
            let is_calibration = file::is_calibration(&text);
            match file::read(&text) {
                Ok(calibration) => {
                    assert!(is_calibration, "it is read as one");
                    let again = file::read(&file::write(&calibration, "fuzz"));
                    assert_eq!(again.as_ref(), Ok(&calibration), "written and read again");
                    true
                }
                Err(mistakes) => {
                    check_mistakes(&mistakes, Some(&text));
                    false
                }
            }
        }),
        max_memory: |input| PER_BYTE * input.len() as u64 + BESIDE,
    }
}

/// Assignments of the command line: `--set key=value`.
pub(super) fn assignments() -> Subject {
    let texts = [
        "nodes.error.gains.x=3",
        "bind.pad=\"mock_pad\"",
        "devices.bench.seed=7",
        "limits.workspace_min_m=[-0.8, -0.4, 0.1]",
        "graph.clock = 'pad'",
        "modes.follow.until={ word = \"go\" }",
    ];
    let catalogue = catalogue();
    let graph = workspace().join("graphs/look.toml");
    Subject {
        corpus: texts.map(|text| text.as_bytes().to_vec()).into(),
        read: Box::new(move |input| {
            let text = String::from_utf8_lossy(input).into_owned();
            if text.to_ascii_lowercase().contains("lockstep") {
                return false;
            }
            let checked = compile(&catalogue, &Request::file(&graph).set(text)).map(|compiled| compiled.warnings());
            let is_accepted = checked.is_ok();
            checked.unwrap_or_else(Some).iter().for_each(check_report);
            is_accepted
        }),
        max_memory: |input| PER_BYTE * input.len() as u64 + BESIDE,
    }
}

/// Words of an operator, one a line, to a graph with modes and to one with several tasks.
pub(super) fn words() -> Subject {
    let engine = |graph: &str| {
        let request = Request::file(workspace().join("graphs").join(graph));
        RefCell::new(Engine::new(compile(&catalogue(), &request).expect("a graph that ships")))
    };
    let engines = [engine("explore.toml"), engine("two_arms.toml")];
    let known = |engine: &RefCell<Engine>| engine.borrow().words().join("\n").into_bytes();
    Subject {
        corpus: engines.iter().map(known).collect(),
        read: Box::new(move |input| {
            let text = String::from_utf8_lossy(input);
            let send = |engine: &RefCell<Engine>, word: &str| {
                let sent = engine.borrow_mut().send(word);
                assert!(sent.as_ref().err().is_none_or(|why| !why.trim().is_empty()), "{word:?}");
                sent.is_ok()
            };
            text.lines().take(50).filter(|word| engines.iter().any(|engine| send(engine, word))).count() > 0
        }),
        max_memory: |input| PER_BYTE * input.len() as u64 + BESIDE,
    }
}

//! A folder with a graph of two tasks, and traces of its runs.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use tactflow_runtime::engine::{Engine, TaskRun};
use tactflow_runtime::fault::Fault;
use tactflow_runtime::graph::{Compiled, Request, compile};
use tactflow_runtime::record::PortColumns;
use tactflow_tests::{catalogue, workspace};
use tempfile::TempDir;
use toml::Table;

use crate::tool::{Said, say};

/// A change of a file: its name, a text in it (nothing for its end), and what replaces it.
pub(crate) type Edit<'a> = (&'a str, &'a str, &'a str);

/// The roles of the part `left` in `two.toml`.
pub(crate) const LEFT_ROLES: &str = "roles = { pad = \"left_pad\", arm = \"left_arm\" }";

/// A folder with the graph of two arms, the two files of its tasks, and its bench.
pub(crate) struct Folder(TempDir);

impl Folder {
    pub(crate) fn new(edits: &[Edit<'_>]) -> Self {
        let read = |path: &str| fs::read_to_string(workspace().join(path)).unwrap();
        let graphs = workspace().join("graphs").display().to_string();
        let two = read("tests/data/tasks/two.toml");
        let two = two.replacen("../../../graphs/hybrid.toml", "left.toml", 1);
        let task = read("graphs/hybrid.toml").replace("\"parts/", "\"builtin:parts/");
        let task = task.replace("\"benches/", &format!("\"{graphs}/benches/"));
        let mut files = BTreeMap::from([
            ("two.toml", two.replacen("../../../graphs/hybrid.toml", "right.toml", 1)),
            ("bench.toml", read("tests/data/tasks/bench.toml").replace("../../../graphs", &graphs)),
            ("left.toml", task.clone()),
            ("right.toml", task),
        ]);
        for (file, from, to) in edits {
            let text = files.entry(file).or_default();
            assert!(text.contains(from), "`{file}` has `{from}`");
            *text = if from.is_empty() { format!("{text}\n{to}\n") } else { text.replacen(from, to, 1) };
        }
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            fs::write(folder.path().join(name), text).unwrap();
        }
        Self(folder)
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn request(&self) -> Request {
        Request::file(self.path("two.toml"))
    }

    pub(crate) fn say(&self, args: &[&str]) -> Said {
        let path = self.path("two.toml").display().to_string();
        say(&[&args[..1], &[&path], &args[1..]].concat())
    }

    /// The task of one part alone, with the device of that part.
    pub(crate) fn alone(&self, part: &str) -> Request {
        let mut bench: Table = fs::read_to_string(self.path("bench.toml")).unwrap().parse().unwrap();
        bench["devices"].as_table_mut().unwrap().retain(|name, _| name == part);
        bench["bind"] = ["pad", "arm"].map(|role| (role.to_owned(), part.into())).into_iter().collect::<Table>().into();
        fs::write(self.path("alone.toml"), bench.to_string()).unwrap();
        Request::file(self.path(&format!("{part}.toml"))).bench(self.path("alone.toml"))
    }
}

pub(crate) fn loaded(request: &Request) -> Compiled {
    compile(&catalogue(), request).unwrap_or_else(|report| panic!("{}", report.render(false)))
}

/// What a run left behind.
pub(crate) struct Trace {
    pub(crate) engine: Engine,
    /// The bits of each column, tick after tick.
    pub(crate) columns: BTreeMap<String, Vec<u64>>,
    /// The fastest joint that each device is commanded [rad/s], tick after tick.
    pub(crate) fastest: BTreeMap<String, Vec<f64>>,
    pub(crate) fault: Option<Fault>,
}

/// Runs a graph to the end of its devices, and sends words at times [s].
pub(crate) fn trace(request: &Request, words: &[(f64, &str)]) -> Trace {
    let mut engine = Engine::new(loaded(request));
    let list = PortColumns::new(engine.ports());
    let (mut row, mut bits) = (vec![0.0; list.list.len()], vec![Vec::new(); list.list.len()]);
    let mut fastest: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    let (mut words, mut fault) = (words.iter().peekable(), None);
    while let Some(next) = engine.next() {
        while let Some((_, word)) = words.next_if(|(time, _)| time * 1e9 <= next as f64) {
            engine.send(word).unwrap();
        }
        if let Err(found) = engine.tick(next) {
            fault = Some(found);
            break;
        }
        list.read(engine.bus(), &mut row);
        bits.iter_mut().zip(&row).for_each(|(bits, value)| bits.push(value.to_bits()));
        for device in ["left", "right"] {
            let Some(joints) = engine.commands(device) else { continue };
            let speed = joints.iter().fold(0.0, |fastest: f64, joint| fastest.max(joint.abs()));
            fastest.entry(device.into()).or_default().push(speed);
        }
    }
    let columns = list.list.iter().map(|column| column.name.clone()).zip(bits).collect();
    Trace { engine, columns, fastest, fault }
}

impl Trace {
    pub(crate) fn task(&self, name: &str) -> &TaskRun {
        self.engine.tasks().iter().find(|task| task.name() == name).expect("a task of the graph")
    }

    /// The tick after which a task is in a mode for the first time.
    pub(crate) fn entered(&self, task: &str, mode: &str) -> u64 {
        let changes = self.task(task).changes();
        changes.iter().find(|change| change.mode == mode).unwrap_or_else(|| panic!("{changes:?}")).tick
    }

    pub(crate) fn failures(&self) -> Vec<&str> {
        self.engine.failures().map(|(task, _)| task).collect()
    }

    /// Leaves out the columns of the roles, which have other names in a nested task.
    pub(crate) fn without_roles(mut self) -> Self {
        self.columns.retain(|name, _| !name.starts_with("pad.") && !name.starts_with("arm."));
        self
    }

    pub(crate) fn are_at_rest(&self, device: &str, ticks: std::ops::Range<usize>) -> bool {
        self.fastest[device][ticks].iter().all(|speed| *speed == 0.0)
    }
}

/// Asserts that all columns of the task alone are those of the part, bit for bit.
pub(crate) fn assert_same_bits(both: &Trace, part: &str, alone: &Trace) {
    assert!(alone.columns.len() > 100, "{}", alone.columns.len());
    for (name, bits) in &alone.columns {
        let is_of_role = ["pad.", "arm."].iter().any(|role| name.starts_with(role));
        let own = if is_of_role { format!("{part}_{name}") } else { format!("{part}.{name}") };
        // The flags of the modes are columns only where several tasks are.
        let both = both.columns.get(&own).unwrap_or_else(|| panic!("no column `{own}`"));
        assert!(both == bits, "`{own}` is not that of the task alone");
    }
}

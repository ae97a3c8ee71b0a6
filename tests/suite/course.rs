//! A run in this process, with every recorded scalar of every tick.

use std::collections::BTreeMap;

use tactflow_runtime::engine::Engine;
use tactflow_runtime::fault::Fault;
use tactflow_runtime::graph::{Compiled, Request, compile};
use tactflow_runtime::record::PortColumns;
use tactflow_runtime::signal::Signal;
use tactflow_tests::{catalogue, on_the_mock_bench, workspace};

/// A shipped graph, by the name of its file.
pub(crate) fn shipped(name: &str) -> Request {
    if name == "finger_press.toml" {
        Request::file(workspace().join("graphs").join(name))
    } else {
        on_the_mock_bench(name)
    }
}

/// The plan of a graph that loads.
pub(crate) fn loaded(request: &Request) -> Compiled {
    compile(&catalogue(), request).unwrap_or_else(|report| panic!("{}", report.render(false)))
}

/// What a run left behind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Course {
    /// The bits of each column, tick after tick; a column is known by its name and its unit.
    pub(crate) columns: BTreeMap<String, Vec<u64>>,
    /// Time of each tick [ns].
    pub(crate) times: Vec<i64>,
    /// How it ended, if not by itself.
    pub(crate) fault: Option<Fault>,
}

/// Runs until a device ends, something goes wrong or there were `most` ticks.
pub(crate) fn course(plan: Compiled, most: usize) -> Course {
    let mut engine = Engine::new(plan);
    let columns = PortColumns::new(engine.ports());
    let mut bits = vec![Vec::new(); columns.list.len()];
    let mut row = vec![0.0; columns.list.len()];
    let (mut times, mut fault) = (Vec::new(), None);
    while let Some(next) = engine.next().filter(|_| times.len() < most) {
        if let Err(found) = engine.tick(next) {
            fault = Some(found);
            break;
        }
        times.push(next);
        columns.read(engine.bus(), &mut row);
        for (bits, value) in bits.iter_mut().zip(&row) {
            bits.push(value.to_bits());
        }
    }
    let names = columns.list.iter().map(|column| format!("{} [{}]", column.name, column.unit));
    Course { columns: names.zip(bits).collect(), times, fault }
}

/// Runs a graph to its end and shows every tick.
pub(crate) fn watch(request: &Request, mut look: impl FnMut(&Engine)) {
    let mut engine = Engine::new(loaded(request));
    while let Some(next) = engine.next() {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
        look(&engine);
    }
}

/// What is on a port; none if it is absent.
pub(crate) fn get<'e, T: Signal>(engine: &'e Engine, port: &str) -> Option<&'e T> {
    let found = engine.ports().iter().find(|(planned, _)| planned.name == port);
    let (planned, id) = found.unwrap_or_else(|| panic!("there is no port `{port}`"));
    assert_eq!(planned.shape.kind(), T::KIND, "`{port}`");
    engine.bus().get(*id)
}

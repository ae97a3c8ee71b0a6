//! Large graphs: what they cost grows with their size, and no faster.
//!
//! `.ci/instructions` counts the instructions; here are the counts that a test can take without a tool.

use std::fs;

use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Request, compile};
use tactflow_tests::large::{FAMILIES, LargeGraph, filter, graph};

const SMALL: usize = 1000;
const LARGE: usize = 12_000;
/// Maximum growth of what is counted exactly, from the small to the large graph.
const MAX_GROWTH: f64 = 13.0;
/// Maximum growth of the time, which varies on a shared machine. Squares grow by 144.
const MAX_TIME_GROWTH: f64 = 40.0;
/// Maximum growth of the time to report four times as many mistakes. A suggestion is searched among all names, so some
/// squares remain. Cubes grow by 64.
const MAX_REPORT_GROWTH: f64 = 40.0;

/// What one graph costs until the end of its first tick.
#[derive(Debug, Clone, Copy)]
struct Cost {
    allocations: f64,
    peak_bytes: f64,
    /// Time on the processor [ns].
    time: f64,
}

/// Returns the time that this thread has spent on a processor [ns].
pub(crate) fn processor_time() -> f64 {
    let text = fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    text.split(' ').next().unwrap().parse().unwrap()
}

fn cost(text: String) -> Cost {
    let request = Request::text(text);
    let catalogue = tactflow_nodes::catalogue();
    let start = processor_time();
    let counted = allocation_counter::measure(|| {
        let mut engine = Engine::new(compile(&catalogue, &request).unwrap());
        let now = engine.next().unwrap();
        engine.tick(now).unwrap();
    });
    let time = processor_time() - start;
    Cost { allocations: counted.count_total as f64, peak_bytes: counted.bytes_max as f64, time }
}

#[test]
fn the_cost_of_a_graph_grows_with_its_size() {
    for (family, graph) in FAMILIES {
        let (small, large) = (cost(graph(SMALL)), cost(graph(LARGE)));
        let growths = [
            ("allocations", large.allocations / small.allocations, MAX_GROWTH),
            ("memory", large.peak_bytes / small.peak_bytes, MAX_GROWTH),
            ("time", large.time / small.time, MAX_TIME_GROWTH),
        ];
        for (what, growth, max) in growths {
            assert!(
                growth <= max,
                "{family}: {what} grows by {growth:.1} with 12 times the nodes: {small:?} {large:?}"
            );
        }
    }
}

/// Returns the time to report a graph with many mistakes of one sort [ns].
fn report_time(mistake: LargeGraph, mistakes: usize) -> f64 {
    let request = Request::text(graph((0..mistakes).map(mistake)));
    let catalogue = tactflow_nodes::catalogue();
    let start = processor_time();
    let report = compile(&catalogue, &request).map(|_| ()).unwrap_err();
    // One missing name has one diagnostic, however many places refer to it.
    assert!(!report.diagnostics.is_empty());
    assert!(!report.render(false).is_empty());
    processor_time() - start
}

#[test]
fn the_time_to_report_many_mistakes_is_short() {
    let sorts: [(&str, LargeGraph); 4] = [
        ("a name that does not exist", |i| filter(i, &format!("m{i}.value"))),
        ("a port that does not exist", |i| filter(i, "source.smu")),
        ("an input without a wire", |i| format!("\n[nodes.n{i}]\ntype = \"low_pass\"\ntime_constant_ms = 40.0\n")),
        ("a cycle", |i| {
            filter(2 * i, &format!("n{}.value", 2 * i + 1)) + &filter(2 * i + 1, &format!("n{}.value", 2 * i))
        }),
    ];
    for (sort, mistake) in sorts {
        let growth = report_time(mistake, SMALL * 2) / report_time(mistake, SMALL / 2);
        assert!(growth <= MAX_REPORT_GROWTH, "{sort}: the time grows by {growth:.1} with four times the mistakes");
    }
}

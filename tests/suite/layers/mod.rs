//! The layers of the crates: which room may take something from which, and that no arrows run in a cycle.
//!
//! A room is a folder, or a file beside `lib.rs`. The arrows are read from the code, with re-exports resolved.

mod arrows;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use arrows::{Arrows, Crate};
use tactflow_tests::workspace;

/// The rooms of `runtime/src` from the ground up. A room may take something from those before it.
const RUNTIME: &[&str] = &[
    "lib",
    "source",
    "random",
    "signal",
    "node",
    "device",
    "outline",
    "catalogue",
    "graph/syntax",
    "graph/load",
    "graph/plan",
    "graph/net",
    "graph/bench",
    "graph/check",
    "graph/build",
    "graph",
    "fault",
    "engine/core",
    "engine/session",
    "engine",
    "example",
    "record",
    "recording",
    "scenario/inject",
    "scenario/matrix",
    "scenario",
    "harness",
    "harness/lint",
    "socket",
    "cli/text",
    "cli/shell",
    "cli/view",
    "cli/still",
    "cli/run",
    "cli/running",
    "cli/draw",
    "cli/recorded",
    "cli/plot",
    "cli/verify",
    "cli/report",
    "cli/reference",
    "cli",
];

/// Rooms of `runtime/src` that stand above others and still take nothing from them.
const RUNTIME_APART: &[(&str, &str)] = &[
    ("graph/plan", "graph/load"),
    ("engine/core", "graph/net"),
    ("engine/core", "graph/check"),
    ("engine/core", "graph/build"),
    ("engine/core", "catalogue"),
    ("engine/core", "fault"),
    ("engine/session", "catalogue"),
    ("cli/text", "engine/session"),
    ("cli/text", "graph"),
    ("socket", "catalogue"),
    ("cli/running", "engine/session"),
    ("cli/view", "cli/shell"),
    ("cli/verify", "cli/run"),
    ("cli/reference", "cli/run"),
    ("cli", "harness"),
];

/// The rooms of `nodes/src`, each with the rooms that it may take something from.
const NODES: &[(&str, &[&str])] = &[
    ("builtin", &[]),
    ("roles", &[]),
    ("motion", &[]),
    ("usual", &[]),
    ("recordings/common", &[]),
    ("recordings", &["recordings"]),
    ("calibration", &["motion", "recordings", "calibration"]),
    ("touch", &["motion", "usual", "calibration", "touch"]),
    ("servo", &["motion", "usual", "servo"]),
    ("limits", &["arm", "motion", "usual", "limits"]),
    ("arm", &["motion", "usual"]),
    ("flow", &["flow"]),
    ("devices", &["arm", "builtin", "motion", "recordings", "usual", "devices"]),
    ("sim", &["arm", "devices", "motion", "usual", "roles", "sim"]),
    ("wires", &["builtin", "devices"]),
    ("tool", &["arm", "builtin", "calibration", "devices", "motion", "recordings", "sim", "touch", "usual", "tool"]),
];

/// The folder a file stands in; a file beside `lib.rs` is a room of its own.
fn room(file: &Path) -> String {
    let folder = file.parent().unwrap();
    // `catalogue.rs` and its children in `catalogue/` are one room.
    let room = if folder.as_os_str().is_empty() { file.with_extension("") } else { folder.to_owned() };
    room.to_string_lossy().into_owned()
}

fn between_rooms(arrows: &Arrows) -> BTreeMap<String, BTreeSet<String>> {
    let mut rooms = BTreeMap::<String, BTreeSet<String>>::new();
    for (from, targets) in arrows {
        let own = rooms.entry(room(from)).or_default();
        own.extend(targets.iter().map(|to| room(to)).filter(|to| *to != room(from)));
    }
    rooms
}

/// Everything that can be reached from `start` along the arrows.
fn reachable<T: Ord + Clone>(arrows: &BTreeMap<T, BTreeSet<T>>, start: &T) -> BTreeSet<T> {
    let (mut reached, mut open) = (BTreeSet::new(), vec![start.clone()]);
    while let Some(node) = open.pop() {
        let next = arrows.get(&node).into_iter().flatten();
        open.extend(next.filter(|next| reached.insert((*next).clone())).cloned());
    }
    reached
}

/// The arrows that lie on a cycle.
fn on_cycles<T: Ord + Clone>(arrows: &BTreeMap<T, BTreeSet<T>>) -> Vec<(T, T)> {
    let all = arrows.iter().flat_map(|(from, targets)| targets.iter().map(move |to| (from, to)));
    let closed = all.filter(|(from, to)| reachable(arrows, to).contains(*from));
    closed.map(|(from, to)| (from.clone(), to.clone())).collect()
}

/// Whether a file is the module that the other one is a child of.
fn is_parent_of(parent: &Path, child: &Path) -> bool {
    let module = match parent.file_name().unwrap().to_str().unwrap() {
        "mod.rs" | "lib.rs" => parent.parent().unwrap().to_owned(),
        _ => parent.with_extension(""),
    };
    let folder = child.parent().unwrap();
    folder == module || child.ends_with("mod.rs") && folder.parent() == Some(&module)
}

fn arrows_of(root: &str) -> Arrows {
    Crate::read(&workspace().join(root)).arrows()
}

#[test]
fn the_arrows_are_read_from_imports_paths_and_re_exports() {
    let arrows = arrows_of("runtime/src");
    let takes = |from: &str, to: &str| arrows[&PathBuf::from(from)].contains(&PathBuf::from(to));
    assert!(takes("graph/net/order.rs", "graph/plan/port.rs"), "through the re-export of graph/plan/mod.rs");
    assert!(takes("engine/core/tick.rs", "engine/core/inlet.rs"), "through `super`");
    assert!(takes("cli/mod.rs", "cli/check.rs"), "a path in code");
    assert!(!takes("source/map.rs", "graph/mod.rs"));
    assert!(arrows.len() > 100);
}

#[test]
fn no_folders_depend_on_each_other_in_a_cycle() {
    for root in ["runtime/src", "nodes/src"] {
        assert_eq!(on_cycles(&between_rooms(&arrows_of(root))), [], "{root}");
    }
}

#[test]
fn no_files_depend_on_each_other_in_a_cycle_except_a_module_and_its_children() {
    for root in ["runtime/src", "nodes/src", "runtime/derive/src"] {
        let mut arrows = arrows_of(root);
        for (from, targets) in &mut arrows {
            targets.retain(|to| !is_parent_of(to, from));
        }
        assert_eq!(on_cycles(&arrows), [], "{root}");
    }
}

#[test]
fn a_room_of_the_runtime_only_takes_from_rooms_below_it() {
    let height = |room: &str| {
        let place = RUNTIME.iter().position(|known| *known == room);
        place.unwrap_or_else(|| panic!("`{room}` is not in the list of rooms"))
    };
    let rooms = between_rooms(&arrows_of("runtime/src"));
    for (from, targets) in &rooms {
        for to in targets {
            assert!(height(to) < height(from), "`{from}` takes something from `{to}`, which stands above it");
        }
    }
    for (from, to) in RUNTIME_APART {
        assert!(height(from) > height(to), "`{from}` does not stand above `{to}`");
        assert!(!rooms[*from].contains(*to), "`{from}` takes something from `{to}`");
    }
    assert!(RUNTIME.iter().all(|room| rooms.contains_key(*room)), "a room of the list is gone");
}

#[test]
fn a_room_of_the_nodes_only_takes_from_the_listed_rooms() {
    // The most specific entry of the list that a folder falls under.
    let entry = |room: &str| {
        let under = NODES.iter().filter(|(name, _)| room == *name || room.starts_with(&format!("{name}/")));
        under.max_by_key(|(name, _)| name.len())
    };
    for (from, targets) in between_rooms(&arrows_of("nodes/src")) {
        // The catalogue of `lib.rs` lists every node.
        let Some((_, allowed)) = entry(&from) else {
            assert!(["lib", "main"].contains(&from.as_str()), "`{from}` is not in the list of rooms");
            continue;
        };
        for to in targets {
            let is_allowed = allowed.iter().any(|name| to == **name || to.starts_with(&format!("{name}/")));
            assert!(is_allowed, "`{from}` takes something from `{to}`");
        }
    }
}

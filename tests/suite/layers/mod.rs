//! The layers of the crates: which room may take something from which, and that no arrows run in a cycle.

mod arrows;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use arrows::{Arrows, Crate};
use tactflow_tests::workspace;

/// The rooms of `runtime/src` from the ground up, each with the rooms that it may take something from.
const RUNTIME: &[(&str, &[&str])] = &[];

/// The folder a file stands in; a file beside `lib.rs` is a room of its own.
fn room(file: &Path) -> String {
    let folder = file.parent().unwrap();
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

#[test]
fn print_arrows() {
    for root in ["runtime/src", "nodes/src"] {
        let arrows = Crate::read(&workspace().join(root)).arrows();
        println!("{root} file cycles: {:#?}", on_cycles(&arrows));
        let rooms = between_rooms(&arrows);
        println!("{root} room cycles: {:#?}", on_cycles(&rooms));
        for (from, to) in &rooms {
            println!("  (\"{from}\", &{to:?}),");
        }
    }
}

//! The reference under docs/reference is what the catalogue says today. With `TACTFLOW_BLESS=1` it is written anew.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;

use tactflow_runtime::cli::reference;
use tactflow_tests::workspace;

fn folder() -> PathBuf {
    workspace().join("docs/reference")
}

#[test]
fn the_reference_is_current() {
    let pages = reference(&tactflow_nodes::catalogue());
    if std::env::var_os("TACTFLOW_BLESS").is_some() {
        fs::remove_dir_all(folder()).ok();
        fs::create_dir_all(folder()).unwrap();
        pages.iter().for_each(|(name, text)| fs::write(folder().join(name), text).unwrap());
    }
    let files = fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let names: BTreeSet<String> = pages.iter().map(|(name, _)| name.clone()).collect();
    assert_eq!(files.collect::<BTreeSet<String>>(), names);
    for (name, text) in pages {
        let is = fs::read_to_string(folder().join(&name)).unwrap();
        assert!(is == text, "docs/reference/{name} is out of date: TACTFLOW_BLESS=1 cargo test reference");
    }
}

#[test]
fn every_node_and_device_has_its_place_in_the_index() {
    let catalogue = tactflow_nodes::catalogue();
    let pages: BTreeMap<String, String> = reference(&catalogue).into_iter().collect();
    let index = &pages["README.md"];
    let nodes = catalogue.nodes().iter().map(|node| node.spec().name.into_owned());
    for name in nodes.chain(catalogue.devices().iter().map(|device| device.name().into_owned())) {
        let line = index.lines().find(|line| line.contains(&format!("[`{name}`]"))).unwrap_or_else(|| panic!("{name}"));
        let file = line.split("](").nth(1).and_then(|rest| rest.split('#').next()).unwrap();
        assert!(pages[file].lines().any(|heading| heading == format!("## `{name}`")), "{file} has no {name}");
    }
}

//! Clients that others have written read the pads of `tests/peers/pad.py`, and decode what our descriptions decode.
//!
//! `.ci/edge` installs the clients and names their Python. A pseudo-terminal has one reader at a time, so the client reads
//! first, and our driver reads the frames after that. The frames of the pad repeat after 251, so both see the same ones.

use std::collections::BTreeMap;
use std::process::Command;
use std::time::Instant;

use tactflow_runtime::signal::Image;
use tactflow_tests::workspace;

use super::PATIENT;
use super::fake::{Fake, SOON, driver, shipped};
use crate::tool::said;

/// Frames that each of them reads.
const FRAMES: usize = 300;
/// Frames that both must have decoded.
const MIN_COMPARED: usize = 100;

/// Returns what a client decodes.
fn frames_of_client(client: &str, port: &str) -> Vec<Vec<f64>> {
    let python = std::env::var("EDGE_PYTHON").expect("`.ci/edge` names a Python with the clients");
    let script = workspace().join("tests/peers/pad_client.py");
    // Isolated: a file beside the script has the name of a module of the standard library.
    let read = said(Command::new(python).arg("-I").arg(script).args([client, port, &FRAMES.to_string()]));
    assert_eq!(read.code, 0, "{client}: {}", read.err);
    serde_json::from_str(&read.out).unwrap()
}

/// Compares the frames of a client with those of our driver. `ours` are the places in the client's frame of what our
/// description decodes.
fn compare(client: &str, pad: &str, count: usize, ours: impl Iterator<Item = usize>) {
    let places: Vec<usize> = ours.collect();
    let mut fake = Fake::start(pad, "pty");
    fake.does("go");
    let port = fake.link.strip_prefix("serial:").unwrap().to_owned();
    let frames = frames_of_client(client, &port);
    assert!(frames.iter().all(|frame| frame.len() == count), "{client}");
    let theirs: BTreeMap<u64, Vec<f64>> = frames
        .iter()
        .map(|frame| places.iter().map(|place| frame[*place]).collect::<Vec<f64>>())
        .map(|frame| (frame[0] as u64, frame))
        .collect();
    // The value of tactel k in frame n, as the pad sends it.
    for (first, frame) in &theirs {
        let sent = (0..places.len() as u64).map(|k| ((first + 3 * k) % 251) as f64);
        assert!(sent.eq(frame.iter().copied()), "{client}: {frame:?}");
    }
    let mut rig = driver(&fake, &shipped(pad), PATIENT);
    let (mut compared, end) = (0, Instant::now() + SOON);
    for _ in 0..FRAMES {
        let image = rig.next::<Image>("image", SOON).unwrap_or_else(|| panic!("{pad}: no image"));
        let ours: Vec<f64> = image.cells().iter().copied().map(f64::from).collect();
        if let Some(frame) = theirs.get(&(ours[0] as u64)) {
            assert_eq!(*frame, ours, "{client}");
            compared += 1;
        }
        assert!(Instant::now() < end, "{pad}: {compared} frames");
    }
    assert!(compared >= MIN_COMPARED, "{client}: {compared}");
    rig.stop().unwrap();
}

#[test]
#[ignore = "it needs clients from the package index: `.ci/edge` installs them and runs it"]
fn the_client_of_flexitac_decodes_what_our_description_decodes() {
    compare("flexitac", "flexitac_12x32", 12 * 32, 0..12 * 32);
}

#[test]
#[ignore = "it needs clients from the package index: `.ci/edge` installs them and runs it"]
fn the_client_of_anyskin_decodes_what_our_description_decodes() {
    // Temperature, x, y and z of five chips; the description reads z.
    compare("anyskin", "anyskin", 20, (0..5).map(|chip| 4 * chip + 3));
}

//! `run --svg`: the picture is XML, and its curves are those of the recording.

use std::fs;

use crate::cli::in_new_folder;
use crate::tool::{peer, say};

const HYBRID: &str = "graphs/hybrid.toml";
const VIEW: &str = "tests/data/view.toml";

/// Draws and records a run; returns what the peer says of the picture and the recording.
fn compared(args: &[&str]) -> String {
    let (_folder, svg) = in_new_folder("run.svg");
    let csv = svg.replace(".svg", ".csv");
    let run = say(&[&["run", "--svg", &svg, "--out", &csv], args].concat());
    assert_eq!((run.code, run.err.as_str()), (0, ""), "{args:?}");
    assert!(run.out.ends_with(&format!("wrote {csv}\nwrote {svg}\n")), "{}", run.out);
    peer("svg.py", &[&svg, &csv])
}

#[test]
fn the_curves_of_the_picture_are_those_of_the_recording() {
    let short = compared(&[VIEW]);
    assert!(short.starts_with("title tests/data/view.toml, 64 tactels, 1 mark, modes none\n"), "{short}");
    assert!(
        short
            .contains("\nerror.error.x [m]: 150 points for 150 values\nerror.error.y [m]: 150 points for 150 values\n"),
        "{short}"
    );
    let long = compared(&[HYBRID, "--for=6s"]);
    assert!(long.starts_with("title graphs/hybrid.toml, 256 tactels, 1 mark, modes approach servo\n"), "{long}");
    assert!(long.contains("\nerror.error.x [m]: ") && long.contains("\nerror.error.pressure [N/tactel]: "), "{long}");
}

#[test]
fn a_run_without_an_image_or_without_values_has_a_picture_too() {
    let numbers = compared(&[VIEW, "--set=graph.show=['error.error', 'label.present']"]);
    assert!(numbers.contains(", 0 tactels, 0 mark,") && numbers.contains("\nlabel.present [1]: "), "{numbers}");
    let image = compared(&[VIEW, "--set=graph.show=['source.image']"]);
    assert_eq!(image.lines().count(), 1, "{image}");
    let absent = compared(&[VIEW, "--for=0.1s"]);
    assert!(absent.ends_with("absent: x, y\n"), "{absent}");
}

#[test]
fn a_picture_replaces_only_a_picture() {
    let (_folder, path) = in_new_folder("run.svg");
    fs::write(&path, "<html>").unwrap();
    let refused = say(&["run", VIEW, "--svg", &path]);
    let message =
        format!("error: `{path}` exists and is not an SVG picture, so it is not overwritten: write to another file\n");
    assert_eq!((refused.code, refused.out.as_str(), refused.err), (2, "", message));
    fs::remove_file(&path).unwrap();
    let draw = || {
        assert_eq!(say(&["run", VIEW, "--quiet", "--svg", &path]).code, 0);
        fs::read(&path).unwrap()
    };
    assert_eq!(draw(), draw(), "the same run has the same bytes");
}

#[test]
fn the_picture_of_the_readme_is_current() {
    let kept = tactflow_tests::workspace().join("docs/hybrid.svg");
    let (_folder, path) = in_new_folder("hybrid.svg");
    assert_eq!(say(&["run", HYBRID, "--quiet", "--svg", &path]).code, 0);
    let drawn = fs::read(path).unwrap();
    if std::env::var_os("TACTFLOW_BLESS").is_some() {
        fs::write(&kept, &drawn).unwrap();
    }
    assert!(drawn == fs::read(kept).unwrap(), "docs/hybrid.svg is out of date: TACTFLOW_BLESS=1 cargo test svg");
    assert!(drawn.len() < 100_000, "{} bytes", drawn.len());
}

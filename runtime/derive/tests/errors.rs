//! Each mistake in a declaration is a compile error on its field or its attribute: `errors/*.rs` with what the compiler
//! says beside it. `TACTFLOW_BLESS=1` writes that anew: read the difference before you commit it.
//!
//! The compiler runs here on its own, with the library that was built for this test. A harness that builds a project
//! of its own would build each dependency a second time.

mod compiler;

use std::fs;
use std::path::{Path, PathBuf};

/// The files in a folder of cases.
fn cases(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new("tests").join(folder);
    let files = fs::read_dir(&folder).expect("the cases are here").map(|entry| entry.expect("an entry").path());
    let mut cases: Vec<PathBuf> = files.filter(|path| path.extension().is_some_and(|end| end == "rs")).collect();
    assert!(!cases.is_empty(), "no case in {}", folder.display());
    cases.sort();
    cases
}

#[test]
fn every_mistake_shows_on_its_field() {
    let bless = std::env::var_os("TACTFLOW_BLESS").is_some();
    let mut differ = Vec::new();
    for case in cases("errors") {
        let said = compiler::mistakes(&case);
        assert!(!said.is_empty(), "{}: the compiler found no mistake", case.display());
        let expected = case.with_extension("txt");
        if bless {
            fs::write(&expected, said).expect("the expectation is written");
        } else if fs::read_to_string(&expected).unwrap_or_default() != said {
            differ.push(format!("{}: the compiler says\n\n{said}", case.display()));
        }
    }
    assert!(differ.is_empty(), "{}", differ.join("\n"));
}

#[test]
fn what_is_sound_compiles_and_runs() {
    for case in cases("sound") {
        assert_eq!(compiler::mistakes(&case), "", "{}", case.display());
        compiler::run(&case);
    }
}

//! Bad data: one clear message each, with the place in the file of data and the line of the bench that names it.
//!
//! Each case damages one good file of a bench. The whole message stands in `data/bad_data/CASE.txt`; with
//! `TACTFLOW_BLESS=1` those are written anew: read the difference before you commit it.

use std::fs;
use std::path::Path;
use std::process::Command;

use tempfile::TempDir;

use crate::tool::{Said, said, tool};
use tactflow_tests::workspace;

const BENCH: &str = r#"allow_uncalibrated = true

[bind]
pad = "pad"
arm = "arm"

[devices.pad]
type = "recording"
file = "pad.csv"

[devices.arm]
type = "mock_arm"
urdf = "arm.urdf"
tip = "lwr_7_link"
start = [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0]

[limits]
workspace_min_m = [-0.8, -0.4, 0.1]
workspace_max_m = [-0.3, 0.4, 0.7]
joint_rad_per_s2 = 5.0
lead_rad = 0.1
"#;

/// Two frames of three by four sensels, one of which does not exist.
const MOVIE: &str = "DATA_TYPE MOVIE
ROWS 3
COLS 4
ROW_SPACING 0.127 centimeters
COL_SPACING 0.127 centimeters
NOISE_THRESHOLD 3
SECONDS_PER_FRAME 0.1
START_FRAME 1
END_FRAME 2
UNITS raw
ASCII_DATA @@

Frame 1, 0,, 12/2/2019 6:21:52.34PM,,,Raw Sum=,,66
B,0,0,5
0,7,12,9
0,8,15,10

Frame 2, 0.1,, 12/2/2019 6:21:52.44PM,,,Raw Sum=,,73
B,0,0,6
0,8,14,9
0,9,16,11
@@
";

/// What becomes of one file of the bench.
enum Damage {
    /// The first text is replaced by the second.
    Edit(&'static str, &'static str),
    /// The text ends after the first place of this.
    CutAfter(&'static str),
    Bytes(&'static [u8]),
    /// The first text is replaced by bytes that are no text.
    Splice(&'static str, &'static [u8]),
    Missing,
    Folder,
    Unreadable,
}

use Damage::{Bytes, CutAfter, Edit, Folder, Missing, Splice, Unreadable};

const CASES: [(&str, &str, Damage); 30] = [
    ("movie_cut_in_a_row", "pad.csv", CutAfter("0,8,1")),
    ("movie_cut_after_a_row", "pad.csv", CutAfter("0,8,14,9\n")),
    ("movie_cut_after_a_frame", "pad.csv", CutAfter("0,9,16,11\n")),
    ("movie_cut_after_the_first_frame", "pad.csv", CutAfter("0,8,15,10\n")),
    ("movie_cut_in_the_header", "pad.csv", CutAfter("END_FR")),
    ("movie_with_a_frame_too_few", "pad.csv", Edit("END_FRAME 2", "END_FRAME 309")),
    ("movie_with_a_ragged_row", "pad.csv", Edit("0,7,12,9", "0,7,12")),
    ("movie_with_a_row_too_long", "pad.csv", Edit("0,7,12,9", "0,7,12,9,9")),
    ("movie_with_a_nan", "pad.csv", Edit("0,8,14,9", "0,NaN,14,9")),
    ("movie_with_a_word_for_a_cell", "pad.csv", Edit("0,8,14,9", "0,eight,14,9")),
    ("movie_with_an_empty_cell", "pad.csv", Edit("0,8,14,9", "0,,14,9")),
    ("movie_with_too_many_rows", "pad.csv", Edit("ROWS 3", "ROWS 4")),
    ("movie_with_too_many_columns", "pad.csv", Edit("COLS 4", "COLS 5")),
    ("movie_with_no_rows", "pad.csv", Edit("ROWS 3", "ROWS 0")),
    ("movie_larger_than_the_file", "pad.csv", Edit("ROWS 3", "ROWS 99999999999")),
    ("movie_with_a_wrong_sum", "pad.csv", Edit("Raw Sum=,,73", "Raw Sum=,,74")),
    ("movie_of_an_unknown_unit", "pad.csv", Edit("UNITS raw", "UNITS stone")),
    ("movie_that_is_empty", "pad.csv", Bytes(b"")),
    ("movie_that_is_binary", "pad.csv", Bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\xff\xfe")),
    ("movie_with_bytes_that_are_no_text", "pad.csv", Splice("0,8,14,9", b"0,\xff\xfe\x00,14,9")),
    ("movie_that_is_missing", "pad.csv", Missing),
    ("movie_that_is_a_folder", "pad.csv", Folder),
    ("movie_without_permission", "pad.csv", Unreadable),
    ("model_that_is_cut_off", "arm.urdf", CutAfter("<joint name=\"lwr_a3_joint\"")),
    ("model_with_a_wrong_tag", "arm.urdf", Edit("</joint>", "</jiont>")),
    ("model_without_a_link", "arm.urdf", Edit("<link name=\"lwr_7_link\"", "<link name=\"lwr_8_link\"")),
    ("model_without_a_speed_limit", "arm.urdf", Edit(" velocity=\"1.919862177193763\"", " velocity=\"0\"")),
    ("model_that_is_empty", "arm.urdf", Bytes(b"")),
    ("model_that_is_missing", "arm.urdf", Missing),
    ("bench_with_an_unknown_tip", "bench.toml", Edit("tip = \"lwr_7_link\"", "tip = \"hand\"")),
];

/// A folder with a bench and its data; others may read it, so that the tool can run as somebody else.
fn bench() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    allow(folder.path(), 0o755);
    fs::write(folder.path().join("bench.toml"), BENCH).unwrap();
    fs::write(folder.path().join("pad.csv"), MOVIE).unwrap();
    fs::copy(workspace().join("graphs/robots/lwr4p.urdf"), folder.path().join("arm.urdf")).unwrap();
    folder
}

fn allow(path: &Path, mode: u32) {
    use std::os::unix::fs::PermissionsExt;
    fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
}

fn damage(file: &Path, damage: &Damage) {
    let text = || fs::read_to_string(file).unwrap();
    let place = |text: &str, of: &str| text.find(of).unwrap_or_else(|| panic!("no `{of}` in {}", file.display()));
    match damage {
        Edit(from, to) => {
            place(&text(), from);
            fs::write(file, text().replacen(from, to, 1)).unwrap();
        }
        CutAfter(end) => fs::write(file, &text()[..place(&text(), end) + end.len()]).unwrap(),
        Bytes(bytes) => fs::write(file, bytes).unwrap(),
        Splice(from, to) => {
            let (text, at) = (text(), place(&text(), from));
            let parts: [&[u8]; 3] = [&text.as_bytes()[..at], to, &text.as_bytes()[at + from.len()..]];
            fs::write(file, parts.concat()).unwrap();
        }
        Missing => fs::remove_file(file).unwrap(),
        Folder => {
            fs::remove_file(file).unwrap();
            fs::create_dir(file).unwrap();
        }
        Unreadable => allow(file, 0),
    }
}

/// `check`s the finger press on the bench of that folder.
fn check(folder: &Path) -> Command {
    let graph = workspace().join("graphs/finger_press.toml");
    let mut command = tool(&["check", graph.to_str().unwrap(), "--bench", "bench.toml"]);
    command.current_dir(folder);
    command
}

/// The same by somebody who may do nothing in particular: root reads what nobody else may.
fn check_as_nobody(folder: &Path) -> Command {
    use std::os::unix::process::CommandExt;
    const NOBODY: u32 = 65534;
    let mut command = check(folder);
    command.uid(NOBODY).gid(NOBODY);
    command
}

/// Checks a damaged bench; none where the one who tests may read everything, and nobody else may run the tool here,
/// say because it stands below a private folder.
fn check_damaged(folder: &Path, file: &str, what: &Damage) -> Option<Said> {
    let may_nobody = matches!(what, Unreadable) && check_as_nobody(folder).output().is_ok_and(|o| o.status.success());
    damage(&folder.join(file), what);
    let is_root = matches!(what, Unreadable) && fs::read(folder.join(file)).is_ok();
    match (is_root, may_nobody) {
        (false, _) => Some(said(&mut check(folder))),
        (true, true) => Some(said(&mut check_as_nobody(folder))),
        (true, false) => None,
    }
}

#[test]
fn what_is_whole_loads() {
    let folder = bench();
    let said = said(&mut check(folder.path()));
    assert_eq!((said.code, said.err.as_str()), (0, ""));
}

#[test]
#[allow(clippy::print_stderr, reason = "who tests must know what was left out")]
fn every_damage_has_its_message() {
    let is_blessing = std::env::var_os("TACTFLOW_BLESS").is_some();
    let mut wrong = Vec::new();
    for (case, file, what) in CASES {
        let folder = bench();
        let Some(said) = check_damaged(folder.path(), file, &what) else {
            eprintln!("`{case}` is left out: root reads everything, and nobody else may run the tool here");
            continue;
        };
        assert_eq!((said.code, said.out.as_str()), (2, ""), "{case}: {}", said.err);
        let expected = workspace().join("tests/data/bad_data").join(format!("{case}.txt"));
        if is_blessing {
            fs::write(&expected, &said.err).unwrap();
        }
        if fs::read_to_string(&expected).unwrap_or_default() != said.err {
            wrong.push(format!("{case}:\n{}", said.err));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_message_is_one_with_a_place_and_names_the_bench() {
    for (case, ..) in CASES {
        let path = workspace().join("tests/data/bad_data").join(format!("{case}.txt"));
        let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        assert_eq!(text.matches("error[").count(), 1, "{case}");
        assert!(text.ends_with("\n1 mistake\n") && text.contains("--> "), "{case}");
        assert!(text.contains("bench.toml:"), "{case}");
    }
    let told = fs::read_dir(workspace().join("tests/data/bad_data")).unwrap().count();
    assert_eq!(told, CASES.len(), "a message without a case");
}

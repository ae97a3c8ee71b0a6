//! What `--points` writes, read by a reader that is not ours.

use std::fs;

use tactflow_tests::workspace;

use crate::cli::in_new_folder;
use crate::tool::{Said, peer, say};

const MOCK: &str = "--bench=graphs/benches/mock.toml";

#[test]
fn the_points_are_those_of_the_rows_and_a_reader_that_is_not_ours_finds_them() {
    // The pad repeats some of its frames: a frame that is not new is no point.
    let repeats = "--set=devices.pad.glitch=[{ at_s = 1.0, for_s = 0.016, kind = 'repeat' }, { at_s = 1.2, for_s = 0.016, kind = 'repeat' }]";
    let cases: [(&str, &[&str], &str); 3] = [
        ("", &[], ""),
        ("ruler.pose=", &[], ""),
        (
            "ruler.pose,touch.pressure,touch.orientation=",
            &["touch_pressure=touch.pressure.value", "touch_orientation=touch.orientation.value"],
            " touch_pressure touch_orientation",
        ),
    ];
    for (ports, beside, more) in cases {
        let (_folder, ply) = in_new_folder("surface.ply");
        let csv = ply.replace("surface.ply", "rows.csv");
        let wanted = format!("--points={ports}{ply}");
        let said = say(&["run", "graphs/hybrid.toml", MOCK, repeats, "--out", &csv, &wanted]);
        assert_eq!((said.code, said.err.as_str()), (0, ""));
        let args = [&[ply.as_str(), &csv, "ruler.point.pose"], beside].concat();
        let read = peer("points.py", &args);
        let count: u32 = read.split(' ').next().unwrap().parse().unwrap();
        let rows: u32 = read.split(' ').nth(3).unwrap().parse().unwrap();
        assert!(count > 500 && count + 6 <= rows, "{read}");
        assert_eq!(read, format!("{count} points of {rows} rows, x y z nx ny nz time{more}\n"));
        assert_eq!(said.out.lines().last().unwrap(), format!("wrote {ply}: {count} points"));
    }
}

#[test]
fn one_name_of_a_port_of_a_part_works_wherever_a_user_writes_one() {
    let (folder, ply) = in_new_folder("surface.ply");
    let csv = ply.replace("surface.ply", "rows.csv");
    let wanted = format!("--points=ruler.pose,touch.force={ply}");
    let show = "--set=graph.show=['touch.force', 'seen.value']";
    let wire = "--set=nodes.seen={ type = 'low_pass', time_constant_ms = 100, in = { value = 'touch.force' } }";
    let args = ["run", "graphs/hybrid.toml", MOCK, show, wire, "--out", &csv, &wanted];
    let said = say(&args);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    assert!(said.out.contains("touch.force"), "{}", said.out);
    let points = fs::read(&ply).unwrap();
    assert!(String::from_utf8_lossy(&points[..600]).contains("property double touch_force\n"));
    // A recording holds the ports inside parts too, so its names are those of the nodes.
    let rows = fs::read_to_string(&csv).unwrap();
    assert!(rows.contains("# touch.moments.force [N]\n"), "{}", &rows[..800]);
    let scenario = folder.path().join("force.toml");
    let graph = workspace().join("graphs/hybrid.toml");
    let bench = workspace().join("graphs/benches/mock.toml");
    let check = "[check.force]\nof = \"touch.force\"\nnever_below = \"0.1 N\"";
    let text = format!("[scenario]\ngraph = {graph:?}\nbench = {bench:?}\nfor_s = 2.0\n{check}\n");
    fs::write(&scenario, text).unwrap();
    let said = say(&["verify", scenario.to_str().unwrap()]);
    assert_eq!((said.code, said.err.as_str()), (0, ""), "{}", said.out);
}

#[test]
fn a_run_without_a_contact_has_a_file_without_points() {
    let (_folder, ply) = in_new_folder("surface.ply");
    let said = say(&["run", "graphs/hybrid.toml", MOCK, "--for=100ms", "--points", &ply]);
    assert_eq!(said.out.lines().last().unwrap(), format!("wrote {ply}: 0 points"));
    let text = fs::read_to_string(&ply).unwrap();
    assert!(
        text.starts_with("ply\n") && text.contains("\nelement vertex 0\n") && text.ends_with("end_header\n"),
        "{text}"
    );
    // A file of points may be written anew.
    assert_eq!(say(&["run", "graphs/hybrid.toml", MOCK, "--for=100ms", "--points", &ply]).code, 0);
}

#[test]
fn what_cannot_be_points_is_told_before_anything_runs() {
    let (_folder, ply) = in_new_folder("surface.ply");
    let cases = [
        ("surface.obj", "graphs/hybrid.toml", "`surface.obj` is not a .ply file".to_owned()),
        ("ruler.psoe=a.ply", "graphs/hybrid.toml", "the graph has no port `ruler.psoe`: ".to_owned()),
        (
            "touch.x=a.ply",
            "graphs/hybrid.toml",
            "`touch.x` is a scalar, but the first port of `--points` must be a pose".to_owned(),
        ),
        (
            "ruler.pose,touch.image=a.ply",
            "graphs/hybrid.toml",
            "`touch.image` is an image, which has no numbers".to_owned(),
        ),
        (
            "a.ply",
            "graphs/finger_press.toml",
            "the graph does not report exactly one pose: name a port, as in `--points".to_owned(),
        ),
        (
            &ply,
            "graphs/hybrid.toml",
            format!("`{ply}` exists and is not a file of points, so it is not overwritten: write to another file"),
        ),
    ];
    fs::write(&ply, [0x93, b'N', b'U', b'M']).unwrap();
    for (wanted, graph, message) in cases {
        let Said { code, err, .. } = say(&["run", graph, "--for=100ms", "--points", wanted]);
        assert_eq!(code, 2, "{wanted}: {err}");
        assert!(err.contains(&message), "{wanted}: {err}");
    }
    assert_eq!(fs::read(&ply).unwrap(), [0x93, b'N', b'U', b'M']);
}

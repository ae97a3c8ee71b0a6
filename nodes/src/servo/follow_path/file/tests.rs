//! Files and parameters, good and bad.

use std::fs;
use std::path::PathBuf;

use nalgebra::Vector3;
use tactflow_runtime::harness::NodeRig;
use tactflow_runtime::node::{At, FilePath, Mistakes};
use tactflow_runtime::signal::{PoseShape, Shape};
use tactflow_runtime::source::Code;

use super::super::FollowPath;
use super::{MAX_POINTS, ply, read, table};

/// A file in the folder for temporary files, which is removed with this value.
struct Written(PathBuf);

impl Written {
    fn new(name: &str, bytes: impl AsRef<[u8]>) -> Self {
        let path = std::env::temp_dir().join(format!("tactflow_path_{}_{name}", std::process::id()));
        fs::write(&path, bytes).unwrap();
        Self(path)
    }
}

impl Drop for Written {
    fn drop(&mut self) {
        fs::remove_file(&self.0).unwrap();
    }
}

fn node(params: &str) -> Result<NodeRig, Mistakes> {
    let wires: [(&str, Shape); 1] = [("pose", PoseShape::default().into())];
    NodeRig::new::<FollowPath>(params, &wires)
}

/// A file by its name and its bytes, and the code, the message and the place (line, column) of its mistake.
type Damaged<'c> = (&'c str, Vec<u8>, Code, &'c str, Option<(usize, usize)>);

/// The code, the message and the place in its line of the only mistake of a file.
fn mistake(name: &str, bytes: impl AsRef<[u8]>) -> (Code, String, Option<(usize, usize)>) {
    let file = Written::new(name, bytes);
    let mistakes = node(&format!("file = {:?}", file.0)).err().unwrap_or_else(|| panic!("{name} is read"));
    assert_eq!(mistakes.len(), 1, "{name}: {mistakes:?}");
    let place = match &mistakes[0].at {
        At::Data { text, span, .. } => {
            let before = &text[..span.start];
            Some((before.matches('\n').count() + 1, before.len() - before.rfind('\n').map_or(0, |at| at + 1) + 1))
        }
        _ => None,
    };
    (mistakes[0].code, mistakes[0].message.clone(), place)
}

#[test]
fn a_table_is_read_in_any_order_of_columns() {
    let expected = [Vector3::new(1.0, 2.0, 3.0), Vector3::new(-0.5, 2e-3, 0.0)];
    let cases = [
        "x,y,z\n1,2,3\n-0.5,2e-3,0\n",
        "x [m], y [m], z [m]\r\n 1 , 2 , 3\r\n\r\n-0.5,0.002,0",
        "time [s],z,y,x\n0,3,2,1\n0.1,0,0.002,-0.5\n\n",
        "\u{feff}x,y,z\n1,2,3\n-.5,.002,0",
    ];
    for text in cases {
        let found = table::read(text).unwrap();
        assert_eq!(found.points, expected, "{text}");
        let last = &text[found.spans[1].clone()];
        assert!(last.contains("5") && !last.contains('\n'), "{last}");
    }
}

/// A PLY file with floats before and after the coordinates, as text or in binary.
fn cloud(is_binary: bool, points: &[[f64; 3]]) -> Vec<u8> {
    let format = if is_binary { "binary_little_endian" } else { "ascii" };
    let header = format!(
        "ply\nformat {format} 1.0\ncomment x y z\nelement vertex {}\nproperty uchar red\nproperty double x\n\
         property double y\nproperty float z\nproperty int index\nelement face 1\n\
         property list uchar int vertex_indices\n\
         end_header\n",
        points.len()
    );
    let mut bytes = header.into_bytes();
    for (i, [x, y, z]) in points.iter().enumerate() {
        if is_binary {
            bytes.push(7);
            bytes.extend([x.to_le_bytes(), y.to_le_bytes()].concat());
            bytes.extend((*z as f32).to_le_bytes());
            bytes.extend((i as i32).to_le_bytes());
        } else {
            bytes.extend(format!("7 {x} {y} {z} {i}\n").into_bytes());
        }
    }
    bytes.extend(if is_binary { &[3, 0, 0, 0, 0][..] } else { b"3 0 1 2\n" });
    bytes
}

#[test]
fn the_vertices_of_a_cloud_are_read_from_text_and_from_binary() {
    let points = [[0.1, 0.2, 0.5], [-1e-3, 4e-9, 0.25], [0.0, 0.0, -2.0]];
    for is_binary in [false, true] {
        let found = ply::read(&cloud(is_binary, &points)).unwrap();
        assert_eq!(found.points, points.map(Vector3::from), "binary: {is_binary}");
    }
}

#[test]
fn hostile_files_give_one_message_at_its_place() {
    use Code::{BadData, BadValue};
    let huge = "x,y,z\n".to_owned() + &"0,0,0\n".repeat(10_000_000 / 20);
    let ascii = String::from_utf8(cloud(false, &[[0.0; 3], [1.0; 3]])).unwrap();
    let cases: [Damaged<'_>; 16] = [
        ("empty.csv", b"".to_vec(), BadData, "the file is empty", None),
        ("blank.csv", b"\n \n".to_vec(), BadData, "the file is empty", None),
        ("header.csv", b"x,y,z\n".to_vec(), BadValue, "a path needs at least 2 points", None),
        ("one.csv", b"x,y,z\n1,2,3\n".to_vec(), BadValue, "a path needs at least 2 points", None),
        (
            "equal.csv",
            b"x,y,z\n0,0,0\n1,2,3\n1,2,3\n".to_vec(),
            BadData,
            "point 2 is at the same place as the next one",
            Some((3, 1)),
        ),
        (
            "nan.csv",
            b"x,y,z\n0,0,0\n1, nan,3\n".to_vec(),
            BadData,
            "expected a coordinate in metres, found `nan`",
            Some((3, 4)),
        ),
        ("short.csv", b"x,y,z\n0,0\n".to_vec(), BadData, "this row has fewer cells than the header", Some((2, 1))),
        ("no_header.csv", b"0,0,0\n1,1,1\n".to_vec(), BadData, "the header has no column `x` in metres", Some((1, 1))),
        (
            "mm.csv",
            b"x [mm],y [mm],z [mm]\n0,0,0\n".to_vec(),
            BadData,
            "the header has no column `x` in metres",
            Some((1, 1)),
        ),
        ("twice.csv", b"x,y,z,y\n0,0,0,0\n".to_vec(), BadData, "two columns have the name `y`", Some((1, 7))),
        ("huge.csv", huge.into_bytes(), BadData, "the file has more than 100000 points", None),
        ("bytes.csv", vec![b'x', 0xff, 0xfe], BadData, "byte 2 of the file is not UTF-8 text", None),
        (
            "cut.ply",
            ascii.replace("vertex 2", "vertex 9").into_bytes(),
            BadData,
            "the file states 9 vertices, but it ends after 3",
            None,
        ),
        (
            "nan.ply",
            ascii.replace("7 1 1", "7 1 inf").into_bytes(),
            BadData,
            "expected a coordinate in metres, found `inf`",
            Some((14, 5)),
        ),
        (
            "no_z.ply",
            ascii.replace("float z", "float w").into_bytes(),
            BadData,
            "its vertices have no property `z`",
            None,
        ),
        (
            "count.ply",
            ascii.replace("vertex 2", "vertex 99999999999").into_bytes(),
            BadData,
            "the file has more than 100000 points",
            None,
        ),
    ];
    for (name, bytes, code, message, place) in cases {
        assert_eq!(mistake(name, bytes), (code, message.to_owned(), place), "{name}");
    }
    assert_eq!(MAX_POINTS, 100_000);
}

#[test]
fn a_cloud_of_random_bytes_is_refused_without_a_panic() {
    let good = cloud(true, &[[0.1, 0.2, 0.5], [-1e-3, 4e-9, 0.25]]);
    for cut in 0..good.len() {
        let mut broken = good.clone();
        broken[cut] ^= 0x5a;
        let _ = ply::read(&broken);
        let _ = ply::read(&good[..cut]);
    }
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let file = FilePath { path: "no/such/path.csv".into(), span: 1..4, builtin: None };
    let mistake = read(&file).unwrap_err();
    assert_eq!((mistake.code, mistake.at), (Code::Unreadable, At::Span(1..4)));
}

#[test]
fn bad_parameters_are_mistakes_with_a_way_out() {
    let right_angle = "path = [[0,0,0],[0.03,0,0],[0.03,0.004,0]]";
    let cases = [
        (
            "",
            "the path has no points",
            Some("give one of the two: `path = [[x, y, z], …]` in metres, or `file = \"path.csv\"`"),
        ),
        ("path = []", "a path needs at least 2 points", None),
        ("path = [[0,0,0],[0.01,0,0]]\nclosed = true", "a closed path needs at least 3 points", None),
        (
            "path = [[0,0,0],[0.01,0,0],[0.01,0,0]]",
            "point 2 is at the same place as the next one",
            Some("leave out one of the two"),
        ),
        (
            "path = [[0,0,0],[0.01,0,0],[0,0,0]]",
            "the path turns back at point 2, which no arc can round",
            Some("add a point beside it, so that the path turns in two corners"),
        ),
        (
            right_angle,
            "the corner at point 2 with a radius of 0.005 m does not fit the leg of 0.004 m that begins at point 2",
            Some("write `corner_m = 0.003998` or less, or move the points apart"),
        ),
        ("path = [[0,0,0],[1,0,0]]\ncorner_m = 0", "expected a number greater than 0 [m], found 0", None),
    ];
    for (params, message, help) in cases {
        let mistakes = node(params).err().unwrap_or_else(|| panic!("{params} is accepted"));
        assert_eq!(mistakes.len(), 1, "{params}: {mistakes:?}");
        assert_eq!(mistakes[0].message, message, "{params}");
        if help.is_some() {
            assert_eq!(mistakes[0].help.as_deref(), help, "{params}");
        }
    }
    assert!(node(&format!("{right_angle}\ncorner_m = 0.003998")).is_ok());
    let file = Written::new("both.csv", "x,y,z\n0,0,0\n0.1,0,0\n");
    let both = node(&format!("path = [[0,0,0],[1,0,0]]\nfile = {:?}", file.0)).err().unwrap();
    assert_eq!(both[0].message, "`path` and `file` exclude each other");
}

#[test]
fn a_file_in_millimetres_is_warned_of() {
    let file = Written::new("mm_without_unit.csv", "x,y,z\n0,0,0\n400,0,0\n");
    let rig = node(&format!("file = {:?}", file.0)).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
    let codes: Vec<Code> = rig.warnings.iter().map(|warning| warning.code).collect();
    assert_eq!(codes, [Code::UnusualValue]);
}

//! Tables of good messages and of mistakes with their texts.

use proptest::prelude::*;

use super::*;
use crate::motion::pose::pose_of;

const HELLO: &str = r#"{"type":"hello","proto":1,"dt":0.004,"lockstep":true,"task":"hybrid","joints":["a","b"],"q_min":[-1,-2.5],"q_max":[1,2],"dq_max":[3,4],"urdf":"lwr4p","tip":"flange","T_es":[1,0,0,0.1, 0,1,0,0.2, 0,0,1,0.03, 0,0,0,1],"rows":2,"cols":3,"pitch":0.005,"counts_per_unit":102.375,"newton_per_unit":0.1,"threshold_units":0.15,"colour":{"of":"pad"}}"#;
const OBS: &str =
    r#"{"type":"obs","seq":17,"t":0.068,"q":[0.1,2],"dq":[0,0.0],"q_eq":[0.2,2],"img":[0,1,2,3.5,4,5],"more":[]}"#;

/// Returns what [`HELLO`] describes.
fn bench() -> Hello {
    hello(HELLO).unwrap()
}

#[test]
fn a_hello_is_read_and_an_unknown_key_is_ignored() {
    let hello = hello(HELLO).unwrap();
    assert_eq!((hello.dt, hello.is_lockstep, hello.rows, hello.cols), (0.004, true, 2, 3));
    assert_eq!(
        (hello.joints.len(), hello.q_min, hello.q_max, hello.dq_max),
        (2, vec![-1.0, -2.5], vec![1.0, 2.0], vec![3.0, 4.0])
    );
    assert_eq!((hello.urdf.as_str(), hello.tip.as_str(), hello.pitch), ("lwr4p", "flange", 0.005));
    assert_eq!((hello.counts_per_unit, hello.newton_per_unit, hello.threshold_units), (102.375, 0.1, 0.15));
    assert_eq!((hello.mount.xyz, hello.mount.rpy), ([0.1, 0.2, 0.03], [0.0; 3]));
}

/// The keys of a line of JSON.
fn keys(line: &str) -> Vec<String> {
    let fields: serde_json::Map<String, serde_json::Value> = serde_json::from_str(line).unwrap();
    fields.into_iter().map(|(name, _)| name).collect()
}

#[test]
fn a_missing_key_is_named() {
    for key in keys(HELLO).into_iter().filter(|key| key != "colour") {
        let line = HELLO.replace(&format!("\"{key}\":"), &format!("\"no_{key}\":"));
        assert_eq!(hello(&line).unwrap_err(), format!("missing field `{key}`"));
    }
    for key in keys(OBS).into_iter().filter(|key| key != "more") {
        let why = message(&OBS.replace(&format!("\"{key}\":"), &format!("\"no_{key}\":")), &bench()).unwrap_err();
        assert!(why.ends_with(&format!("missing field `{key}`")), "{why}");
    }
}

#[test]
fn a_mistake_in_a_hello_names_its_field() {
    let cases = [
        ("\"proto\":1", "\"proto\":2", "`proto`: 2 is not the supported protocol version, 1"),
        ("\"hello\"", "\"obs\"", "`type`: unknown variant `obs`, expected `hello`"),
        ("0.004", "0", "`dt`: 0 is not greater than 0"),
        ("0.004", "NaN", "`dt`: expected value at byte 32, found `NaN`"),
        ("\"lockstep\":true", "\"lockstep\":1", "`lockstep`: invalid type: integer `1`, expected a boolean"),
        ("[\"a\",\"b\"]", "[\"a\",7]", "`joints[1]`: invalid type: integer `7`, expected a string"),
        ("[\"a\",\"b\"]", "[\"a\",\"a\"]", "`joints`: element 1 is `a`, but each joint needs its own name"),
        ("[\"a\",\"b\"]", "[]", "`joints`: the list is empty"),
        ("[-1,-2.5]", "[-1]", "`q_min` has 1 numbers, but there are 2 `joints`"),
        ("[1,2]", "[1,-2.5]", "`q_min` of joint `b` is -2.5 rad, which is not less than its `q_max` of -2.5 rad"),
        ("[3,4]", "[3,0]", "`dq_max` of joint `b` is 0 rad/s, which is not greater than 0"),
        ("[3,4]", "[3,null]", "`dq_max[1]`: invalid type: null, expected f64"),
        ("[3,4]", "[3,4],\"dq_max\":[3,4]", "duplicate field `dq_max`"),
        ("\"rows\":2", "\"rows\":2.5", "`rows`: 2.5 is not a whole number from 1 to 500000"),
        ("\"rows\":2", "\"rows\":400000", "`rows` and `cols` make 400000x3 tactels, but the maximum is 500000"),
        ("0,0,0,1]", "0,0,0]", "`T_es`: invalid length 15, expected an array of length 16"),
        ("0,0,0,1]", "0,0,1,1]", "`T_es`: this is not a pose: its last row"),
        ("[1,0,0,0.1", "[2,0,0,0.1", "`T_es`: this is not a pose: its rotation matrix is off by 3.0e0"),
        ("[1,0,0,0.1", "[-1,0,0,0.1", "`T_es`: this is not a pose: its axes are left-handed"),
        ("0.15", "-1", "`threshold_units`: -1 is not 0 or greater"),
        ("\"urdf\":\"lwr4p\"", "\"urdf\":null", "`urdf`: invalid type: null, expected a string"),
    ];
    for (from, to, message) in cases {
        assert!(HELLO.contains(from), "{from}");
        let why = hello(&HELLO.replacen(from, to, 1)).unwrap_err();
        assert!(why.starts_with(message), "{to}: {why}");
    }
}

#[test]
fn a_mistake_in_a_frame_names_its_field() {
    let Ok(Some(obs)) = message(OBS, &bench()) else { panic!("a frame") };
    assert_eq!((obs.seq, obs.t, &*obs.q, &*obs.q_eq), (17, 0.068, &[0.1, 2.0][..], &[0.2, 2.0][..]));
    assert_eq!(obs.img, [0.0, 1.0, 2.0, 3.5, 4.0, 5.0]);
    assert_eq!(message(&OBS.replace("17", "17.0"), &bench()).map(|_| ()), Ok(()), "a float that is whole");
    assert_eq!(message("{\"type\":\"end\",\"reason\":1}", &bench()), Ok(None));
    let cases = [
        ("3.5,4,5]", "3.5,4]", "obs 17: `img` has 5 numbers, but the pad has 2x3 = 6"),
        ("3.5", "NaN", "`img[3]`: expected value at byte 87, found `NaN`"),
        ("3.5", "-Infinity", "`img[3]`: invalid number at byte 87, found `-Infinity`"),
        ("3.5", "1e999", "obs 17: `img[3]`: number out of range at byte 87, found `1e999`"),
        ("3.5", "1e39", "obs 17: `img[3]` is 1e39, which is too large"),
        ("3.5", "\"3.5\"", "obs 17: `img[3]`: invalid type: string \"3.5\", expected f64"),
        ("[0.1,2]", "[0.1,2,3]", "obs 17: `q` has 3 numbers, but the arm has 2 joints"),
        ("[0,0.0]", "[0,nan]", "`dq[1]`: expected ident at byte 54, found `nan`"),
        ("[0.2,2]", "{}", "obs 17: `q_eq`: invalid type: map, expected a sequence"),
        ("0.068", "null", "obs 17: `t`: invalid type: null, expected f64"),
        ("17", "-1", "`seq`: -1 is not a whole number from 0"),
        ("17", "1.5", "`seq`: 1.5 is not a whole number from 0"),
        ("\"obs\"", "\"cmd\"", "obs 17: `type`: unknown variant `cmd`, expected `obs` or `end`"),
        ("3.5", "3;5", "`img`: expected `,` or `]` at byte 87, found `3;5`"),
    ];
    for (from, to, wanted) in cases {
        let why = message(&OBS.replacen(from, to, 1), &bench()).unwrap_err();
        assert!(why.starts_with(wanted), "{to}: {why}");
    }
}

#[test]
fn a_line_that_is_not_json_is_described() {
    let deep = format!("{{\"a\":{}1{}}}", "[".repeat(900_000), "]".repeat(9));
    let cases = [
        ("", "the line ends while parsing a value"),
        ("ready when you are", "expected value at byte 1, found `ready`"),
        ("220 mail", "invalid type: integer `220`, expected a JSON object"),
        ("{\"q\":[1,2", "`q`: the line ends while parsing a list"),
        ("{\"q\":[1 2]}", "`q`: expected `,` or `]` at byte 9, found `2`"),
        ("{\"seq\":zero}", "`seq`: expected value at byte 8, found `zero`"),
        ("{\"q\"=1}", "expected `:` at byte 2, found `\"q\"=1`"),
        ("{q:1}", "key must be a string at byte 2, found `q`"),
        (&deep, "`a`: expected `,` or `]` at byte 900016, found `}`"),
    ];
    for (line, wanted) in cases {
        let why = message(line, &bench()).unwrap_err();
        assert!(why.ends_with(wanted), "{}: {why}", &line[..line.len().min(40)]);
    }
}

#[test]
fn a_reply_is_json_and_keeps_every_bit() {
    let dq = [0.1 + 0.2, -1e-300, 0.0, 1e22];
    let line = Reply::Cmd { seq: 3, dq: &dq, est: Some([0.5, -0.25, 1e-7]) }.line();
    assert!(line.ends_with("}\n") && line.starts_with("{\"type\":\"cmd\",\"seq\":3,"), "{line}");
    let fields: serde_json::Value = serde_json::from_str(&line).unwrap();
    assert_eq!(serde_json::from_value::<[f64; 4]>(fields["dq"].clone()).unwrap(), dq);
    assert_eq!(serde_json::from_value::<[f64; 3]>(fields["est"].clone()).unwrap(), [0.5, -0.25, 1e-7]);
    assert!(Reply::Cmd { seq: 3, dq: &dq, est: None }.line().contains("\"est\":null"));
    assert_eq!(Reply::End { reason: "a \"b\"\n" }.line(), "{\"type\":\"end\",\"reason\":\"a \\\"b\\\"\\n\"}\n");
}

proptest! {
    #[test]
    fn a_mount_is_the_matrix_it_was_read_from(
        xyz in prop::array::uniform3(-1.0..1.0_f64), roll in -3.1..3.1_f64, yaw in -3.1..3.1_f64,
        // A quarter turn of pitch, and anything near it or far from it.
        pitch in prop_oneof![-1.6..1.6_f64, Just(std::f64::consts::FRAC_PI_2), Just(-std::f64::consts::FRAC_PI_2),
            (-1e-6..1e-6_f64).prop_map(|d| std::f64::consts::FRAC_PI_2 + d)],
        noise in prop::array::uniform9(-1e-7..1e-7_f64),
    ) {
        let matrix = pose_of(xyz, [roll, pitch, yaw]).to_homogeneous();
        let mut numbers: [f64; 16] = matrix.transpose().as_slice().try_into().unwrap();
        for (k, noise) in noise.into_iter().enumerate() {
            numbers[k / 3 * 4 + k % 3] += noise;
        }
        let read = mount_of(&numbers).unwrap();
        prop_assert!((read.pose().to_homogeneous() - matrix).amax() < 1e-6, "{read:?}");
    }
}

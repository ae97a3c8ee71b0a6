//! The messages against tables: what is good, and what each mistake is told as.

use proptest::prelude::*;

use super::*;
use crate::arm::mount::pose_of;

const HELLO: &str = r#"{"type":"hello","proto":1,"dt":0.004,"lockstep":true,"task":"hybrid","joints":["a","b"],"q_min":[-1,-2.5],"q_max":[1,2],"dq_max":[3,4],"urdf":"lwr4p","tip":"flange","T_es":[1,0,0,0.1, 0,1,0,0.2, 0,0,1,0.03, 0,0,0,1],"rows":2,"cols":3,"pitch":0.005,"counts_per_unit":102.375,"newton_per_unit":0.1,"threshold_units":0.15,"colour":{"of":"pad"}}"#;
const OBS: &str =
    r#"{"type":"obs","seq":17,"t":0.068,"q":[0.1,2],"dq":[0,0.0],"q_eq":[0.2,2],"img":[0,1,2,3.5,4,5],"more":[]}"#;
const SIZES: Sizes = Sizes { joints: 2, rows: 2, cols: 3 };

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

#[test]
fn every_key_of_the_hello_and_of_a_frame_is_missed_by_its_name() {
    let keys = |line: &str| object(line).unwrap().into_iter().map(|(name, _)| name).collect::<Vec<_>>();
    for key in keys(HELLO).into_iter().filter(|key| key != "colour") {
        let line = HELLO.replace(&format!("\"{key}\":"), &format!("\"no_{key}\":"));
        assert_eq!(hello(&line).unwrap_err(), format!("`{key}` is missing"));
    }
    for key in keys(OBS).into_iter().filter(|key| key != "more") {
        let why = message(&OBS.replace(&format!("\"{key}\":"), &format!("\"no_{key}\":")), SIZES).unwrap_err();
        assert!(why.ends_with(&format!("`{key}` is missing")), "{why}");
    }
}

#[test]
fn what_is_wrong_with_a_hello() {
    let cases = [
        ("\"proto\":1", "\"proto\":2", "`proto` is 2, but the protocol that is spoken here is 1"),
        ("\"hello\"", "\"obs\"", "the first message is of type `obs`, and not a hello"),
        ("0.004", "0", "`dt` is 0, and has to be greater than 0"),
        ("0.004", "NaN", "`dt` is NaN, and not finite"),
        ("\"lockstep\":true", "\"lockstep\":1", "`lockstep` is a number, and neither true nor false"),
        ("[\"a\",\"b\"]", "[\"a\",7]", "entry 2 of `joints` is a number, and not a name"),
        ("[\"a\",\"b\"]", "[\"a\",\"a\"]", "entry 2 of `joints` is `a`: each joint needs a name of its own"),
        ("[-1,-2.5]", "[-1]", "`q_min` has 1 numbers, but there are 2 `joints`"),
        ("[1,2]", "[1,-2.5]", "`q_min` of joint `b` is -2.5, and not less than its `q_max` of -2.5"),
        ("[3,4]", "[3,0]", "`dq_max` of joint `b` is 0, and has to be greater than 0"),
        ("[3,4]", "[3,null]", "entry 2 of `dq_max` is null, and not a number"),
        ("\"rows\":2", "\"rows\":2.5", "`rows` is 2.5, and not a whole number from 1"),
        (
            "\"rows\":2",
            "\"rows\":400000",
            "`rows` and `cols` make 400000x3 tactels, and more than 500000 do not fit into a line",
        ),
        ("0,0,0,1]", "0,0,0]", "`T_es` has 15 numbers, but a 4x4 matrix has 16"),
        ("0,0,0,1]", "0,0,1,1]", "`T_es` is no pose: its last row"),
        ("[1,0,0,0.1", "[2,0,0,0.1", "`T_es` is no pose: its rotation is off by 3.0e0"),
        ("[1,0,0,0.1", "[-1,0,0,0.1", "`T_es` is no pose: its rotation mirrors"),
        ("0.15", "-1", "`threshold_units` is -1, and cannot be less than 0"),
        ("\"urdf\":\"lwr4p\"", "\"urdf\":null", "`urdf` is null, and not a text"),
    ];
    for (from, to, message) in cases {
        assert!(HELLO.contains(from), "{from}");
        let why = hello(&HELLO.replacen(from, to, 1)).unwrap_err();
        assert!(why.starts_with(message), "{to}: {why}");
    }
}

#[test]
fn a_frame_is_read_and_what_is_wrong_with_one_names_its_number_and_field() {
    let Ok(Message::Obs(obs)) = message(OBS, SIZES) else { panic!("a frame") };
    assert_eq!((obs.seq, obs.t, &*obs.q, &*obs.q_eq), (17, 0.068, &[0.1, 2.0][..], &[0.2, 2.0][..]));
    assert_eq!(obs.img, [0.0, 1.0, 2.0, 3.5, 4.0, 5.0]);
    assert_eq!(message(&OBS.replace("17", "17.0"), SIZES).map(|_| ()), Ok(()), "a float that is whole");
    assert_eq!(message("{\"type\":\"end\",\"reason\":1}", SIZES), Ok(Message::End));
    let cases = [
        ("3.5,4,5]", "3.5,4]", "obs 17: `img` has 5 numbers, but the pad has 2x3 = 6"),
        ("3.5", "NaN", "obs 17: number 4 of `img` is NaN, and not finite"),
        ("3.5", "-Infinity", "obs 17: number 4 of `img` is -inf, and not finite"),
        ("3.5", "1e39", "obs 17: number 4 of `img` is 1e39, and too large"),
        ("3.5", "\"3.5\"", "obs 17: entry 4 of `img` is a text, and not a number"),
        ("[0.1,2]", "[0.1,2,3]", "obs 17: `q` has 3 numbers, but the arm has 2 joints"),
        ("[0,0.0]", "[0,nan]", "obs 17: number 2 of `dq` is NaN, and not finite"),
        ("[0.2,2]", "{}", "obs 17: `q_eq` is an object, and not a list"),
        ("0.068", "null", "obs 17: `t` is null, and not a number"),
        ("17", "-1", "`seq` is -1, and not a whole number from 0"),
        ("17", "1.5", "`seq` is 1.5, and not a whole number from 0"),
        ("\"obs\"", "\"cmd\"", "a message is of type `cmd`, and neither `obs` nor `end`"),
        ("3.5", "3;5", "`img`: expected `,` or `]`"),
    ];
    for (from, to, wanted) in cases {
        let why = message(&OBS.replacen(from, to, 1), SIZES).unwrap_err();
        assert!(why.starts_with(wanted), "{to}: {why}");
    }
}

#[test]
fn what_is_said_is_json_and_keeps_every_bit() {
    let dq = [0.1 + 0.2, -1e-300, 0.0, 1e22];
    let line = cmd(3, &dq, Some([0.5, -0.25, 1e-7]));
    let fields = Fields(object(&line).unwrap());
    assert_eq!(fields.numbers("dq", 4, String::new), Ok(dq.to_vec()));
    assert_eq!(fields.numbers("est", 3, String::new), Ok(vec![0.5, -0.25, 1e-7]));
    assert_eq!((fields.text("type"), fields.whole("seq", 0.0, 9.0)), (Ok("cmd"), Ok(3)));
    assert!(line.ends_with("}\n") && cmd(3, &dq, None).contains("\"est\":null"));
    assert_eq!(Fields(object(&end("a \"b\"\n")).unwrap()).text("reason"), Ok("a \"b\"\n"));
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
        let mut numbers: Vec<f64> = matrix.transpose().iter().copied().collect();
        for (k, noise) in noise.into_iter().enumerate() {
            numbers[k / 3 * 4 + k % 3] += noise;
        }
        let read = mount(&numbers).unwrap();
        prop_assert!((read.pose().to_homogeneous() - matrix).amax() < 1e-6, "{read:?}");
    }
}

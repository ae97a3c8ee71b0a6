//! Tests of calibration files: written, read again, and damaged.

use proptest::prelude::*;

use super::*;
use crate::calibration::curve::KINDS;

fn read_back(calibration: &Calibration) -> Calibration {
    let text = write(calibration, "a test");
    assert!(is_calibration(&text));
    read(&text).unwrap_or_else(|mistakes| panic!("{mistakes:?}\n{text}"))
}

/// Generates finite numbers of 32 bits.
fn number() -> impl Strategy<Value = f32> {
    any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |number| number.is_finite())
}

fn tactel(kind: CurveKind) -> BoxedStrategy<Option<Tactel>> {
    let gain = || number().prop_filter("a slope", |gain| *gain != 0.0);
    let curve = match kind {
        CurveKind::Linear => gain().prop_map(|gain| ForceCurve::Linear { gain }).boxed(),
        CurveKind::Rational => (gain(), number(), number())
            .prop_map(|(gain, squash, most)| ForceCurve::Rational {
                gain,
                squash: squash.abs().copysign(gain),
                most: most.abs(),
            })
            .boxed(),
        CurveKind::Piecewise => prop::collection::vec((1e-3..1e5f32, 0.0..1e3f32), 1..12)
            .prop_map(|steps| {
                let mut last = [0.0, 0.0];
                let knots = steps.into_iter().map(|(s, force)| {
                    last = [last[0] + s, last[1] + force];
                    last
                });
                ForceCurve::Piecewise { knots: knots.collect() }
            })
            .boxed(),
    };
    let curve = curve.prop_filter("without a flaw", |curve| curve.flaw().is_none());
    prop::option::weighted(0.8, (number(), curve).prop_map(|(offset, curve)| Tactel { offset, curve })).boxed()
}

fn calibration() -> impl Strategy<Value = Calibration> {
    let kind = prop::sample::select(KINDS.to_vec());
    (kind, 1..4usize, 1..5usize).prop_flat_map(|(kind, rows, cols)| {
        prop::collection::vec(tactel(kind), rows * cols).prop_map(move |tactels| Calibration {
            kind,
            rows,
            cols,
            reading: Unit::RAW,
            unit: Unit::NEWTON,
            tactels,
        })
    })
}

proptest! {
    #[test]
    fn what_is_written_is_read_bit_for_bit(calibration in calibration()) {
        let back = read_back(&calibration);
        // 0 and -0 are equal as floats, but different as text.
        prop_assert_eq!(format!("{:?}", &back), format!("{:?}", &calibration));
    }
}

const GOOD: &str = r#"# by hand
kind = "calibration"
version = 1
curve = "rational"
rows = 2
cols = 2
reading = "raw"
unit = "N"
dead = [[0, 1]]
tactels = [
  { at = [0, 0], offset = 10, gain = 0.01, squash = 0.001, most = 4.5 },
  { at = [1, 1], offset = 11.5, gain = 0.02, squash = 0, most = 5 },
  { at = [1, 0], offset = -3, gain = 0.03, squash = 0.003, most = 6 },
]
"#;

const KNOTS: &str = r#"kind = "calibration"
version = 1
curve = "piecewise"
rows = 1
cols = 1
reading = "raw"
unit = "N"
tactels = [{ at = [0, 0], offset = 10, readings = [10, 20, 30], forces = [0.5, 1.5, 4] }]
"#;

#[test]
fn a_file_written_by_hand_is_read_in_any_order() {
    let calibration = read(GOOD).unwrap();
    let offsets: Vec<Option<f32>> = calibration.tactels.iter().map(|t| t.as_ref().map(|t| t.offset)).collect();
    assert_eq!(offsets, [Some(10.0), None, Some(-3.0), Some(11.5)]);
    assert_eq!((calibration.kind, calibration.unit), (CurveKind::Rational, Unit::NEWTON));
    assert!(read(KNOTS).is_ok());
}

#[test]
fn every_mistake_has_its_place() {
    let cases = [
        (GOOD, "kind = \"calibration\"", "kind = \"bench\"", "\"bench\"", "this is not a calibration file"),
        (GOOD, "kind = \"calibration\"\n", "", "", "this is not a calibration file"),
        (GOOD, "version = 1", "version = 2", "2", "unsupported version 2: this tool reads version 1"),
        (GOOD, "\"rational\"", "\"cubic\"", "\"cubic\"", "expected one of `linear`, `rational`, `piecewise`"),
        (GOOD, "\"rational\"", "\"linear\"", "squash", "`squash` is not a parameter here"),
        (GOOD, "rows = 2", "rows = 0", "0", "expected a whole number from 1"),
        (GOOD, "rows = 2", "row = 2", "row", "`row` is not a parameter here"),
        (GOOD, "rows = 2", "rows = 1", "[1, 1]", "tactel [1, 1] is outside the array of 1 rows by 2 columns"),
        (GOOD, "rows = 2", "rows = 1000000", "[\n  {", "tactel [2, 0] is missing, and 1999995 more"),
        (GOOD, "\"raw\"", "\"counts\"", "\"counts\"", "`counts` is not a unit"),
        (GOOD, "[[0, 1]]", "[]", "[\n  {", "tactel [0, 1] is missing"),
        (GOOD, "[[0, 1]]", "[[0, 1], [0, 1]]", "[0, 1]", "tactel [0, 1] appears twice"),
        (GOOD, "[[0, 1]]", "[[0, 1], [1]]", "[1]", "expected a list of 2"),
        (GOOD, "at = [1, 0]", "at = [1, 1]", "[1, 1]", "tactel [1, 1] appears twice"),
        (GOOD, "at = [1, 0]", "at = [0, 1]", "[0, 1]", "tactel [0, 1] appears twice"),
        (GOOD, "gain = 0.02", "gain = 0", "0", "a `gain` of 0 gives no force"),
        (GOOD, "gain = 0.02", "gain = 1e99", "1e99", "too large for a 32-bit float"),
        (GOOD, "gain = 0.02", "gain = nan", "nan", "expected a finite number"),
        (GOOD, "gain = 0.02", "gain = \"x\"", "\"x\"", "expected a number"),
        (GOOD, "gain = 0.02, ", "", "{ at = [1, 1]", "`gain` is missing: expected a number"),
        (GOOD, "squash = 0.001", "squash = -1", "-1", "`squash` must have the sign of `gain`"),
        (GOOD, "most = 5", "most = -5", "-5", "`most`, the maximum force, must be greater than 0"),
        (GOOD, "offset = -3", "offset = 1e50", "1e50", "too large"),
        (KNOTS, "[0, 0]", "[0, 1]", "[0, 1]", "tactel [0, 1] is outside the array of 1 rows by 1 columns"),
        (KNOTS, "[0.5, 1.5, 4]", "[0.5, 1.5]", "[0.5, 1.5]", "3 readings, but 2 forces"),
        (
            KNOTS,
            "[0.5, 1.5, 4]",
            "[0.5, 0.4, 4]",
            "[0.5, 0.4, 4]",
            "`forces` must not decrease, but 0.4 comes after 0.5",
        ),
        (KNOTS, "[10, 20, 30]", "[10, 10, 30]", "[10, 10, 30]", "`readings` must increase from 0 or decrease from 0"),
        (KNOTS, "[10, 20, 30]", "[10, 20, 1e40]", "[10, 20, 1e40]", "too large"),
    ];
    for (good, from, to, marked, message) in cases {
        assert!(good.contains(from), "{from}");
        let text = good.replacen(from, to, 1);
        let mistakes = read(&text).expect_err(message);
        let first = &mistakes[0];
        let At::Span(span) = first.at.clone() else { panic!("{first:?}") };
        assert!(first.message.starts_with(message), "{from} -> {to}: {mistakes:?}");
        assert!(text[span.clone()].starts_with(marked), "{from} -> {to}: {:?}", &text[span]);
        assert!(mistakes.len() == 1 || to.contains("linear") || to == "rows = 1", "{from} -> {to}: {mistakes:?}");
    }
}

#[test]
fn text_that_is_not_toml_is_refused_and_long_lists_are_cut() {
    let syntax = read("rows = = 2").unwrap_err();
    assert_eq!((syntax.len(), syntax[0].code, &syntax[0].at), (1, Code::BadData, &At::Span(7..8)));
    assert!(!is_calibration("rows = = 2"));
    assert!(!is_calibration("kind = 1") && !is_calibration(""));
    assert!(is_calibration("kind = \"calibration\"\nversion = 9"), "a later one is one too");
    let line = "  { at = [0, 0], offset = 10, gain = 0, squash = 0, most = 1 },\n";
    let text = GOOD.replacen("tactels = [\n", &format!("tactels = [\n{}", line.repeat(50)), 1);
    assert_eq!(read(&text).unwrap_err().len(), MAX_MISTAKES);
}

/// The node reserves the same number of segments for every tactel: one long line must not multiply the memory.
#[test]
fn a_curve_has_a_maximum_number_of_knots() {
    let with = |count: usize| {
        let list = (1..=count).map(|k| k.to_string()).collect::<Vec<_>>().join(", ");
        read(&KNOTS.replace("10, 20, 30", &list).replace("0.5, 1.5, 4", &list))
    };
    assert!(with(64).is_ok());
    let mistakes = with(65).unwrap_err();
    assert_eq!((mistakes.len(), mistakes[0].message.as_str()), (1, "65 knots, but the maximum is 64"));
}

#[test]
fn a_file_that_is_not_toml_has_one_mistake() {
    let log = "time,force,t0_0\n0.0,0.1,200\n0.1,0.2,300\n";
    assert_eq!(read(log).unwrap_err().len(), 1);
}

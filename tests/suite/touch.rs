//! The examples of the touch nodes load together, and no rule of any of them allocates.

use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::signal::Scalar;
use tactflow_tests::catalogue;

use crate::course::get;

const NODES: [&str; 14] = [
    "tactile_source",
    "binarize",
    "label",
    "select_region",
    "region_count",
    "image_window",
    "moments",
    "principal_axes",
    "eccentricity",
    "contact_area",
    "hough",
    "moving_average",
    "low_pass",
    "median",
];

/// A pad that is touched twice, the second time by a bar; it repeats no frame and ends by itself.
const PAD: &str = r#"
graph.clock = "pad"
roles.pad = "tactile_pad"
bind.pad = "pad"
[devices.pad]
type = "mock_pad"
rate_hz = 250
for_s = 1.2
press = [
  { from_s = 0.1, to_s = 0.4, at = [0.010, -0.005], speed = [-0.004, 0.0], force = 3.0 },
  { from_s = 0.3, to_s = 0.6, at = [-0.020, 0.015], force = 4.0 },
  { from_s = 0.8, to_s = 1.1, at = [0.0, 0.01], radius = 0.006, length = 0.03, angle = 0.6, force = 4.0 },
]
[nodes.calibrate]
type = "calibrate"
in.image = "source.image"
"#;

/// The rules that the examples do not show.
const OTHERS: &str = r#"
[nodes.plain]
type = "binarize"
in.image = "calibrate.image"
threshold = 0.015
[nodes.otsu]
type = "binarize"
in.image = "calibrate.image"
threshold = 0.015
method = "otsu"
[nodes.nearest]
type = "label"
in.image = "calibrate.image"
in.mask = "otsu.mask"
choose = "nearest"
min_area = 4
[nodes.second]
type = "select_region"
in.regions = "label.regions"
rank = 2
[nodes.strongest]
type = "select_region"
in.regions = "nearest.regions"
by = "force"
[nodes.shape]
type = "moments"
in.image = "calibrate.image"
in.region = "nearest.region"
weight = "area"
[nodes.bend]
type = "curvature"
in.image = "calibrate.image"
in.region = "image_window.region"
min_anisotropy = 0.2
[nodes.axis]
type = "moving_average"
in.value = "shape.orientation"
window = 4
[nodes.middle]
type = "median"
in.value = "hough.orientation"
window = 4
[nodes.cut]
type = "low_pass"
in.value = "hough.offset"
cutoff_hz = 8
"#;

fn graph() -> String {
    let catalogue = catalogue();
    let specs: Vec<_> = catalogue.nodes().iter().map(|node| node.spec()).collect();
    let examples = NODES.map(|name| {
        let spec = specs.iter().find(|spec| spec.name == name).unwrap_or_else(|| panic!("no node `{name}`"));
        assert!(spec.doc.len() > 200, "`{name}` has no doc");
        assert_eq!(spec.example.matches("[nodes.").count(), 1, "the example of `{name}` is one block");
        spec.example.to_string()
    });
    [PAD, &examples.concat(), OTHERS].concat()
}

#[test]
fn the_examples_load_together_and_no_touch_node_allocates_in_a_tick() {
    let request = Request { text: Some(graph()), ..Request::file("examples.toml") };
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    let outputs = ["median.value", "low_pass.value", "moving_average.value", "axis.value", "middle.value", "cut.value"]
        .into_iter()
        .chain([
            "contact_area.area",
            "contact_area.interpolated",
            "eccentricity.eccentricity",
            "principal_axes.minor",
            "bend.turn",
        ]);
    let mut seen: Vec<(&str, u32)> = outputs.map(|name| (name, 0)).collect();
    let mut ticks = 0;
    while let Some(now) = engine.next() {
        engine.exchange(now).unwrap();
        let counted = allocation_counter::measure(|| engine.step().unwrap());
        assert_eq!(counted.count_total, 0, "in tick {}", engine.ticks());
        for (name, count) in &mut seen {
            *count += u32::from(get::<Scalar>(&engine, name).is_some());
        }
        ticks += 1;
    }
    // Two touches of 0.5 s and 0.3 s; only the second is a line.
    assert_eq!(ticks, 300);
    assert!(seen.iter().all(|(_, count)| (60..220).contains(count)), "{seen:?}");
}

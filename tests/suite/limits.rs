//! Limits: no command reaches an arm around them, no chain of limiters exceeds what it says it holds, and directions
//! stay.

use std::fs;
use std::path::Path;

use nalgebra::{IsometryMatrix3, Rotation3, Vector3, Vector6};
use proptest::prelude::*;
use tactflow_nodes::limits::acceleration_limit::AccelerationLimit;
use tactflow_nodes::limits::bumpless::Bumpless;
use tactflow_nodes::limits::contact_limit::ContactLimit;
use tactflow_nodes::limits::twist_limit::TwistLimit;
use tactflow_nodes::limits::workspace_limit::WorkspaceLimit;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::harness::NodeRig;
use tactflow_runtime::node::{Limits, Node};
use tactflow_runtime::signal::{Image, ImageShape, Kind, Pose, PoseShape, Shape, Twist, TwistShape, Unit};
use tactflow_runtime::source::{Code, Diagnostic, Report};
use tactflow_tests::{catalogue, shipped_graphs, single_tasks, workspace};
use tempfile::TempDir;
use toml::Table;

fn table(path: &Path) -> Table {
    fs::read_to_string(path).unwrap().parse().unwrap()
}

/// Why a graph with its parts and benches in that folder does not load.
fn refused(folder: &TempDir, graph: &str) -> Option<Report> {
    compile(&catalogue(), &Request::file(folder.path().join(graph))).err()
}

/// Everything that ships, in a folder of its own.
fn copied() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let copy = std::process::Command::new("cp").arg("-r").arg(workspace().join("graphs/.")).arg(folder.path()).status();
    assert!(copy.unwrap().success());
    folder
}

#[test]
fn without_any_one_limiter_no_shipped_graph_loads() {
    let folder = copied();
    let path = folder.path().join("parts/move.toml");
    let whole = table(&path);
    let limits = |kind: &str| {
        let specs = catalogue();
        let found = specs.nodes().iter().map(|node| node.spec()).find(|spec| spec.name == kind);
        found.unwrap().limits
    };
    let nodes = whole["nodes"].as_table().unwrap();
    let limiters: Vec<(&String, &'static str)> = nodes
        .iter()
        .filter_map(|(name, node)| {
            Some((name, limits(node["type"].as_str()?)))
                .filter(|(_, limits)| !limits.holds.is_empty())
                .and_then(|(name, limits)| Some((name, limits.through?)))
        })
        .collect();
    assert_eq!(limiters.len(), 7, "{limiters:?}");
    for (name, through) in limiters {
        let mut part = whole.clone();
        let nodes = part["nodes"].as_table_mut().unwrap();
        let gone = nodes.remove(name).unwrap();
        let source = gone["in"][through].clone();
        // What it gave is taken from where it took it.
        let gave = format!("{name}.{}", if through == "velocity" { "velocity" } else { "twist" });
        for (_, node) in nodes.iter_mut() {
            for (_, wire) in node["in"].as_table_mut().unwrap() {
                if wire.as_str() == Some(&gave) {
                    *wire = source.clone();
                }
            }
        }
        for (_, export) in part["exports"].as_table_mut().unwrap() {
            if export.as_str() == Some(&gave) {
                *export = source.clone();
            }
        }
        fs::write(&path, part.to_string()).unwrap();
        for graph in shipped_graphs() {
            let graph = graph.file_name().unwrap().to_str().unwrap();
            // It has no arm.
            if graph == "look.toml" {
                continue;
            }
            let report = refused(&folder, graph).unwrap_or_else(|| panic!("{graph} loads without `{name}`"));
            let codes: Vec<Code> = report.diagnostics.iter().map(|d| d.code).collect();
            assert!(codes.contains(&Code::UnlimitedCommand), "{graph} without `{name}`: {}", report.render(false));
            let help =
                report.diagnostics.iter().find_map(|d| d.help.as_ref().filter(|_| d.code == Code::UnlimitedCommand));
            let kind = gone["type"].as_str().unwrap();
            assert!(help.unwrap().contains(&format!("`{kind}`")), "{graph} without `{name}`: {help:?}");
        }
    }
}

#[test]
fn a_pose_that_no_sensor_measures_reaches_neither_a_limiter_nor_the_arm() {
    let folder = copied();
    let path = folder.path().join("parts/move.toml");
    let part = fs::read_to_string(&path).unwrap();
    let made = "[nodes.fixed]\ntype = \"static_pose\"\nframe = \"pad\"\nreference = \"arm.base\"\n\
        [nodes.nothing]\ntype = \"static_pose\"\n\
        [nodes.seen]\ntype = \"inverse_pose\"\nin.pose = \"state.sensor_pose\"\n\
        [nodes.back]\ntype = \"inverse_pose\"\nin.pose = \"seen.pose\"\n\
        [nodes.moved]\ntype = \"compose_poses\"\nin.inner = \"state.sensor_pose\"\nin.outer = \"nothing.pose\"\n";
    let mut swapped = 0;
    let wires =
        part.match_indices("pose = \"state.sensor_pose\"").filter(|(at, _)| !part[..*at].ends_with("\nsensor_"));
    for (at, measured) in wires {
        for pose in ["fixed.pose", "back.pose", "moved.pose"] {
            let (before, after) = (&part[..at], &part[at + measured.len()..]);
            fs::write(&path, format!("{before}pose = \"{pose}\"{after}\n{made}")).unwrap();
            let report = refused(&folder, "position.toml").unwrap_or_else(|| panic!("`{pose}` at {at}"));
            let at_the_wire = |d: &&Diagnostic| d.code == Code::QuantityMismatch && d.message.contains(pose);
            let found = report.diagnostics.iter().find(at_the_wire);
            let found = found.unwrap_or_else(|| panic!("`{pose}` at {at}: {}", report.render(false)));
            assert!(found.help.as_ref().unwrap().contains("state.sensor_pose"), "{:?}", found.help);
            swapped += 1;
        }
    }
    assert_eq!(swapped, 6 * 3, "lost, contact, workspace, blind, adjoint and ik_sink, each with three poses");
}

#[test]
fn without_any_one_number_no_shipped_graph_loads() {
    let folder = copied();
    for graph in single_tasks() {
        let graph = graph.file_name().unwrap().to_str().unwrap();
        let path = folder.path().join(graph);
        let whole = table(&path);
        let keys: Vec<String> = whole["limits"].as_table().unwrap().keys().cloned().collect();
        assert!(keys.len() >= 8, "{graph}: {keys:?}");
        for key in keys {
            let mut cut = whole.clone();
            cut["limits"].as_table_mut().unwrap().remove(&key);
            fs::write(&path, cut.to_string()).unwrap();
            let report = refused(&folder, graph).unwrap_or_else(|| panic!("{graph} loads without `{key}`"));
            assert!(report.diagnostics.iter().any(|d| d.code == Code::MissingLimit && d.message.contains(&key)));
        }
        fs::write(&path, whole.to_string()).unwrap();
        assert!(refused(&folder, graph).is_none(), "{graph} loads with all of them");
    }
}

#[test]
fn a_limiter_says_what_it_does_and_no_mode_can_set_it() {
    let catalogue = catalogue();
    let mut limiters = 0;
    for spec in catalogue.nodes().iter().map(|node| node.spec()) {
        let Limits { through, holds, breaks, guards, .. } = spec.limits;
        if let Some(through) = through {
            assert!(spec.inputs.iter().any(|input| input.name == through), "{}: {through}", spec.name);
        }
        if let Some(guards) = guards {
            assert!(spec.inputs.iter().any(|input| input.name == guards), "{}: {guards}", spec.name);
        }
        for limit in holds {
            let share = spec.outputs.iter().find(|output| output.name == *limit);
            let share = share.unwrap_or_else(|| panic!("`{}` has no output `{limit}`", spec.name));
            assert_eq!((share.kind, &*share.args[0]), (Kind::Scalar, "1"), "{}", spec.name);
            assert!(!breaks.contains(limit));
        }
        if !holds.is_empty() {
            limiters += 1;
            let live: Vec<_> = spec.params.iter().filter(|param| param.is_live).map(|param| param.name).collect();
            assert!(live.is_empty(), "a mode could set {live:?} of `{}`", spec.name);
        }
    }
    assert_eq!(limiters, 9);
    // Whatever an arm asks for, some node holds.
    for limit in catalogue.roles().iter().flat_map(|role| &role.limits) {
        let is_held = catalogue.nodes().iter().any(|node| node.spec().limits.holds.contains(&&**limit));
        assert!(is_held, "{limit}");
    }
}

/// A limiter on a table, and what it says.
struct Link {
    rig: NodeRig,
    limits: Limits,
    is_scaling: bool,
}

const LINEAR: f64 = 0.3;
const ANGULAR: f64 = 2.0;
const ACCELERATION: f64 = 1.5;
const TURNING: f64 = 6.0;

fn link<N: Node>(params: &str, is_scaling: bool, more: &[(&str, Shape)]) -> Link {
    let mut wires: Vec<(&str, Shape)> = vec![("twist", TwistShape.into())];
    wires.extend(more.iter().cloned());
    let rig = NodeRig::new::<N>(params, &wires).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
    Link { rig, limits: N::LIMITS, is_scaling }
}

fn pad() -> ImageShape {
    ImageShape { rows: 4, cols: 4, pitch: [0.01, 0.01], unit: Unit::NEWTON }
}

const BOX: &str = "min_m = [-0.1, -0.1, -0.1]\nmax_m = [0.1, 0.1, 0.1]\ndeceleration_m_per_s2 = 1.5";

fn chain(kinds: &[u8]) -> Vec<Link> {
    let accelerations = format!("linear_m_per_s2 = {ACCELERATION}\nangular_rad_per_s2 = {TURNING}");
    let speeds = format!("linear_m_per_s = {LINEAR}\nangular_rad_per_s = {ANGULAR}");
    let made = kinds.iter().map(|kind| match kind {
        0 => link::<Bumpless>(&accelerations, false, &[]),
        1 => link::<TwistLimit>(&speeds, true, &[]),
        2 => link::<AccelerationLimit>(&accelerations, false, &[]),
        3 => link::<WorkspaceLimit>(BOX, true, &[("pose", PoseShape::default().into())]),
        _ => link::<ContactLimit>(
            "force_n = 10.0\npeak_n = 4.0\ndeceleration_m_per_s2 = 1.0\nfoam_n_per_m3 = 1e5",
            false,
            &[("image", pad().into())],
        ),
    });
    made.collect()
}

/// What holds at the end of a chain, as the check works it out.
fn held(chain: &[Link]) -> Vec<&'static str> {
    let mut held = Vec::new();
    for link in chain {
        held.retain(|limit| !link.limits.breaks.contains(limit));
        held.extend(link.limits.holds);
    }
    held
}

/// What a chain gives for what comes in; nothing is zero motion. Then `ms` pass.
fn pass(
    chain: &mut [Link],
    input: Option<Twist>,
    pose: Pose,
    cells: &[f32],
    ms: f64,
) -> Result<Option<Twist>, TestCaseError> {
    let mut twist = input;
    for link in chain {
        match twist {
            Some(twist) => link.rig.set("twist", twist),
            None => link.rig.lose("twist"),
        }
        if link.limits.holds.contains(&"workspace") {
            link.rig.set("pose", pose);
        }
        if link.limits.holds.contains(&"force") {
            link.rig.set("image", Image::from_cells(4, cells));
        }
        let before = twist;
        link.rig.step_ms(ms);
        twist = link.rig.get::<Twist>("twist").copied();
        if let (true, Some(before), Some(after)) = (link.is_scaling, before, twist) {
            let share = after.0.norm() / before.0.norm().max(1e-300);
            prop_assert!(share <= 1.0 + 1e-12 && (after.0 - before.0 * share).norm() <= 1e-9 * (1.0 + before.0.norm()));
        }
    }
    Ok(twist)
}

fn a_twist() -> impl Strategy<Value = Option<Twist>> {
    let sizes = prop_oneof![Just(1e-12), Just(0.05), Just(1.0), Just(1e6)];
    let twist = (prop::array::uniform6(-1.0..1.0f64), sizes);
    prop::option::weighted(0.8, twist.prop_map(|(twist, size)| Twist(Vector6::from(twist) * size)))
}

fn a_pose() -> impl Strategy<Value = Pose> {
    (prop::array::uniform3(-3.0..3.0f64), prop::array::uniform3(-0.12..0.12f64)).prop_map(|(turn, place)| {
        Pose(IsometryMatrix3::from_parts(Vector3::from(place).into(), Rotation3::new(turn.into())))
    })
}

/// Speed toward the object at a point of the pad.
fn way_in(twist: &Twist, [x, y]: [f64; 2]) -> f64 {
    twist.0[2] + twist.0[3] * y - twist.0[4] * x
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn no_chain_of_limiters_exceeds_what_it_holds(
        kinds in prop::collection::vec(0..5u8, 1..7),
        inputs in prop::collection::vec((a_twist(), a_pose(), prop::array::uniform16(-1.0..5.0f32), 0.0..8.0f64), 2..40),
    ) {
        let mut chain = chain(&kinds);
        let holds = held(&chain);
        let is_last = |kind: u8| kinds.iter().rposition(|k| *k == kind).is_some_and(|at| !kinds[at..].contains(&2));
        let (mut last, mut dt) = (Twist::default(), 0.0);
        for (input, pose, cells, ms) in inputs {
            let out = pass(&mut chain, input, pose, &cells, ms)?;
            let now = out.unwrap_or_default();
            prop_assert!(now.0.iter().all(|v| v.is_finite()));
            if holds.contains(&"speed") {
                prop_assert!(now.linear().norm() <= LINEAR * (1.0 + 1e-12) && now.angular().norm() <= ANGULAR * (1.0 + 1e-12));
            }
            // A bumpless motion that nothing has touched since, and one whose acceleration is limited, never jump.
            if holds.contains(&"acceleration") || kinds.last() == Some(&0) {
                let change = Twist(now.0 - last.0);
                let scale = 1.0 + last.0.norm();
                prop_assert!(change.linear().norm() <= ACCELERATION * dt + 1e-9 * scale, "{change:?} in {dt} s");
                prop_assert!(change.angular().norm() <= TURNING * dt + 1e-9 * scale, "{change:?} in {dt} s");
            }
            if holds.contains(&"workspace") && is_last(3) {
                let velocity = pose.0.rotation * now.linear();
                for axis in 0..3 {
                    let (v, place) = (velocity[axis], pose.0.translation.vector[axis]);
                    let distance = if v > 0.0 { 0.1 - place } else { place + 0.1 };
                    prop_assert!(v * v / 3.0 <= distance.max(0.0) + 1e-9 * velocity.norm(), "{v} m/s at {distance} m");
                }
            }
            if holds.contains(&"force") && is_last(4) && out.is_some() {
                let shape = pad();
                let pressed = |i: usize| f64::from(cells[i].max(0.0));
                let place = |i: usize| [shape.x((i % 4) as f64), shape.y((i / 4) as f64)];
                let sum: f64 = (0..16).map(pressed).sum();
                let centre = [0, 1].map(|k| (0..16).map(|i| pressed(i) * place(i)[k]).sum::<f64>() / sum);
                let highest = (0..16).fold(0, |best, i| if pressed(i) > pressed(best) { i } else { best });
                let scale = 1e-9 * (1.0 + now.0.norm());
                if sum >= 10.0 {
                    prop_assert!(way_in(&now, centre) <= scale, "{} m/s into {sum} N", way_in(&now, centre));
                }
                if pressed(highest) >= 4.0 {
                    prop_assert!(way_in(&now, place(highest)) <= scale);
                }
            }
            (last, dt) = (now, ms * 1e-3);
        }
    }

    #[test]
    fn a_sensor_that_does_as_it_is_told_a_tick_later_stays_in_its_box(
        inputs in prop::collection::vec((prop::array::uniform6(-3.0..3.0f64), 1..60usize), 1..20),
    ) {
        // As in the part that ships: box, speed, acceleration.
        let mut chain = chain(&[3, 1, 2]);
        let (mut place, mut told) = (Vector3::zeros(), Twist::default());
        for (twist, ticks) in inputs {
            for _ in 0..ticks {
                let pose = Pose(IsometryMatrix3::translation(place.x, place.y, place.z));
                let out = pass(&mut chain, Some(Twist(twist.into())), pose, &[0.0; 16], 4.0)?.unwrap_or_default();
                place += told.linear() * 0.004;
                told = out;
                prop_assert!(place.amax() <= 0.1 + 1e-3, "{place:?}");
            }
        }
    }
}

#[test]
fn moving_out_of_contact_is_always_free() {
    let mut chain = chain(&[4]);
    let cells = [4.5_f32; 16];
    let out = Twist([0.1, -0.2, -0.3, 0.0, 0.0, 1.0].into());
    assert_eq!(pass(&mut chain, Some(out), Pose::default(), &cells, 1.0).unwrap(), Some(out));
    let into = Twist([0.1, -0.2, 0.3, 0.0, 0.0, 1.0].into());
    let barred = Twist([0.1, -0.2, 0.0, 0.0, 0.0, 1.0].into());
    assert_eq!(pass(&mut chain, Some(into), Pose::default(), &cells, 1.0).unwrap(), Some(barred));
}

#[test]
fn an_object_at_the_rim_counts_like_one_in_the_middle() {
    let mut chain = chain(&[4]);
    // One tactel in the corner at its ceiling: a roll that presses just there is barred, and one that lifts it is free.
    let mut cells = [0.0_f32; 16];
    cells[15] = 4.0;
    let roll = |wx: f64| Twist([0.0, 0.0, 0.0, wx, 0.0, 0.0].into());
    let lifted = pass(&mut chain, Some(roll(-1.0)), Pose::default(), &cells, 1.0).unwrap().unwrap();
    assert_eq!(lifted, roll(-1.0));
    let pressed = pass(&mut chain, Some(roll(1.0)), Pose::default(), &cells, 1.0).unwrap().unwrap();
    assert!((pressed.0[2] + 0.015).abs() < 1e-12 && pressed.0[3] == 1.0, "it rolls about the corner: {pressed:?}");
}

#[test]
fn what_cannot_be() {
    let contact = "force_n = 1.0\npeak_n = 2.0\ndeceleration_m_per_s2 = 1.0";
    let wires: [(&str, Shape); 2] = [("twist", TwistShape.into()), ("image", pad().into())];
    // The sections [limits] of several files may add up to it.
    let rig = NodeRig::new::<ContactLimit>(contact, &wires).unwrap();
    assert_eq!(
        rig.warnings[0].message,
        "`peak_n` is greater than `force_n`, so it has no effect: one tactel is never above the sum"
    );
    let empty = BOX.replace("0.1, 0.1, 0.1]\nd", "0.1, -0.2, 0.1]\nd");
    let wires: [(&str, Shape); 2] = [("twist", TwistShape.into()), ("pose", PoseShape::default().into())];
    let mistakes = NodeRig::new::<WorkspaceLimit>(&empty, &wires).err().unwrap();
    assert_eq!(mistakes[0].message, "the box is empty along y: from -0.1 to -0.2 m");
}

//! What is tuned: the features of one mode, and the node that takes the test signal.

use tactflow_runtime::graph::{Outline, OutlinedBlock, OutlinedMode};

use super::TuneArgs;
use super::task::Task;
use crate::tool::control::collect::law;
use crate::tool::control::law::Feature;
use crate::tool::control::mount::Mount;
use crate::tool::control::nodes::{Command, Index, Nodes, commands};
use crate::tool::control::schedule::Schedule;

/// Returns the mode that is tuned, and its features.
pub(super) fn controlled<'o>(
    args: &TuneArgs,
    index: &Index<'o>,
    twist: &str,
) -> Result<(&'o OutlinedMode, Vec<Feature>), String> {
    let controlled = |mode: &OutlinedMode| {
        let law = law(&Nodes::new(index, Some(mode)), twist);
        law.features.into_iter().filter(Feature::moves).collect::<Vec<_>>()
    };
    let moving =
        |mode: &OutlinedMode| controlled(mode).into_iter().filter(|feature| feature.kp > 0.0).collect::<Vec<_>>();
    let modes: Vec<&OutlinedMode> = index.modes("").into_iter().flatten().collect();
    let mode = match &args.mode {
        Some(name) => modes.iter().find(|mode| mode.name == *name).ok_or_else(|| {
            let names: Vec<String> = modes.iter().map(|mode| format!("`{}`", mode.name)).collect();
            format!("the graph has no mode `{name}`; its modes are {}", names.join(", "))
        })?,
        None => modes
            .iter()
            .max_by_key(|mode| moving(mode).len())
            .ok_or("a graph without modes has no mode to tune: add a mode, as docs/composing-a-task.md shows")?,
    };
    let features = moving(mode);
    let known: Vec<String> = features.iter().map(|feature| format!("`{}`", feature.name)).collect();
    let is_reversed = |feature: &Feature| feature.kp < 0.0 && args.features.contains(&feature.name);
    if let Some(Feature { name, .. }) = controlled(mode).into_iter().find(is_reversed) {
        return Err(format!(
            "the gain `kp` of `{name}` is negative: make it positive, and turn the sign of its column"
        ));
    }
    if let Some(unknown) = args.features.iter().find(|name| features.iter().all(|feature| feature.name != **name)) {
        return Err(format!("the mode `{}` does not control `{unknown}`; it controls {}", mode.name, known.join(", ")));
    }
    let is_asked = |feature: &Feature| args.features.is_empty() || args.features.contains(&feature.name);
    let features: Vec<Feature> = features.into_iter().filter(is_asked).collect();
    if features.is_empty() {
        return Err(format!("the mode `{}` controls no feature with a `pid`", mode.name));
    }
    features.iter().try_for_each(is_measured)?;
    features.iter().try_for_each(has_a_known_schedule)?;
    Ok((*mode, features))
}

/// Returns the command of an arm, the first one if it has no name.
pub(super) fn command<'o>(outline: &'o Outline, arm: Option<&str>) -> Result<Command<'o>, String> {
    let all = || commands(outline);
    let names: Vec<String> = all().map(|command| format!("`{}`", command.arm)).collect();
    match (all().find(|command| arm.is_none_or(|arm| arm == command.arm)), arm) {
        (Some(command), _) => Ok(command),
        (None, Some(arm)) if !names.is_empty() => {
            Err(format!("no role `{arm}` is an arm; the arms are {}", names.join(", ")))
        }
        _ => Err("no role is an arm, so nothing moves".to_owned()),
    }
}

/// Returns the task that makes a twist: the graph itself, or a part of it with [inputs].
///
/// # Errors
/// If it is a part that can run alone: says how to tune that.
pub(super) fn task(index: &Index<'_>, twist: &str, arm: &str) -> Result<Task, String> {
    let (task, outline) = (index.task_of(twist), index.outline());
    if task.is_empty() {
        return Ok(Task::default());
    }
    let own = |node: &&OutlinedBlock| node.name.rsplit_once('.').is_some_and(|(part, _)| part == task);
    let file = outline.nodes.iter().find(own).map_or("", |node| &node.place.file);
    let table = |file: &str| std::fs::read_to_string(file).ok()?.parse::<toml::Table>().ok();
    let table = table(file).unwrap_or_default();
    if table.contains_key("inputs") {
        return Ok(Task::part(task, file.into()));
    }
    let says = format!("the arm follows the part `{task}`");
    let device = outline.roles.iter().find(|role| role.name == arm).map_or("", |role| &role.device.text);
    let roles = table.get("roles").and_then(toml::Value::as_table).into_iter().flat_map(toml::Table::keys);
    let binds: String = roles.map(|role| format!(" --set bind.{role}={device}")).collect();
    let bench = outline.devices.first().map_or("", |device| &device.place.file);
    Err(format!(
        "{says}: tune its file on the same bench. It has limits of its own; add those of this graph with --set\n\ntactflow \
         tune {file} --bench {bench}{binds}"
    ))
}

/// Refuses a feature of which nothing says what it measures.
fn is_measured(feature: &Feature) -> Result<(), String> {
    feature.quantity().map(drop).ok_or_else(|| {
        format!(
            "the error of `{}` comes from no `feature_error`, so that nothing says what it measures: tune the others, with \
             `--feature`",
            feature.name
        )
    })
}

/// Refuses a feature whose gains are multiplied by what nothing says.
fn has_a_known_schedule(feature: &Feature) -> Result<(), String> {
    let unknown = feature.schedules.iter().find(|schedule| !schedule.follows(feature.quantity()));
    unknown.map_or(Ok(()), |Schedule { node, .. }| {
        Err(format!(
            "`{node}` multiplies the gains of `{}` by what is not known: give it the `ratio` of a `stiffness_estimate` of \
             the same feature, with `jacobian` and `equilibrium`",
            feature.name
        ))
    })
}

/// Refuses a twist that a mount turns on its way to the arm: a test signal along one axis would move the sensor along another.
pub(super) fn is_unturned(mounts: &[Mount], twist: &str) -> Result<(), String> {
    let Some(Mount { node, .. }) = mounts.first() else { return Ok(()) };
    let sum = format!("{node}_sum");
    Err(format!(
        "`{node}` turns the motion `{twist}` on its way to the arm: add a `twist_adder` behind it, so that the test signal \
         moves the sensor along its own axes, and wire `{sum}.twist` to what reads `{node}.twist`:\n\n[nodes.{sum}]\ntype = \
         \"twist_adder\"\nin.mount = \"{node}.twist\""
    ))
}

/// Returns the node that adds the test signal to the motion.
pub(super) fn adder(index: &Index<'_>, twist: &str) -> Result<String, String> {
    let writer = Nodes::new(index, None).writer(twist).filter(|node| node.kind.text == "twist_adder");
    let help = "add one, so that the test signal has a way in:\n\n[nodes.sum]\ntype = \"twist_adder\"\nin.touch = ";
    writer
        .map(|node| node.name.clone())
        .ok_or_else(|| format!("the motion `{twist}` comes from no `twist_adder`; {help}\"{twist}\""))
}

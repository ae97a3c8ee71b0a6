//! The graph of `features`.

use tactflow_runtime::cli::Shell;
use tactflow_runtime::engine::{self, Engine, RunOptions};
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::record::PortColumns;

use super::FeaturesArgs;

/// What a contact is.
#[derive(Debug, Clone, Default)]
pub(super) struct ContactRules {
    /// Threshold of a touched tactel [unit of the recording].
    pub(super) threshold: f64,
    /// Where the threshold is from.
    pub(super) origin: String,
    /// Force of one unit of a pressure on a tactel [N].
    pub(super) newtons: Option<f64>,
    /// Noise that the file states [unit of the recording].
    pub(super) noise: Option<f64>,
    /// Number of regions that have nodes of their own.
    pub(super) regions: usize,
}

impl FeaturesArgs {
    /// Returns the graph, without the settings of the recording from the command line.
    pub(super) fn graph_text(&self, rules: &ContactRules) -> String {
        let Self { min_area, min_force, window, .. } = self;
        let (unit, forces) = match rules.newtons {
            Some(_) => ("N", "set.calibrate.unit = \"N\"            # the pressure times the area of a tactel\n"),
            None => ("unit of the recording", ""),
        };
        let origin = match rules.newtons {
            Some(_) => format!("{} kPa, {}", rules.threshold, rules.origin),
            None => rules.origin.clone(),
        };
        let threshold = rules.threshold * rules.newtons.unwrap_or(1.0);
        // The part compares its threshold, in newtons, with the noise of the pad.
        let noise = rules.noise.zip(rules.newtons).map(|(noise, newtons)| noise * newtons);
        let noise = noise.map_or_else(String::new, |noise| format!("set.binarize.noise = {noise:?}           # [N]\n"));
        let mut text = format!(
            r#"# The features of the contact in a recording.
[graph]
clock = "pad"

[roles]
pad = "tactile_pad"

[parts.touch]
file = "builtin:parts/touch.toml"
in.image = "pad.image"
set.calibrate.dead = {{ from = "pad.dead" }}
{forces}{noise}set.binarize.threshold = {threshold:?}       # [{unit}], {origin}
set.label = {{ min_area = {min_area}, min_force = {min_force:?} }}   # [tactels, {unit}]
set.pressure.window = {window}
set.orientation.window = {window}

[nodes.touched]                     # all tactels above the threshold, in all regions
type = "binarize"
in.image = "touch.repaired"
threshold = {threshold:?}

[nodes.whole]                       # the force and the centre of pressure of the whole pad
type = "moments"
in.image = "touch.repaired"
in.region = "touched.mask"

[nodes.every]
type = "label"
in.image = "touch.repaired"
in.mask = "touched.mask"

[nodes.regions]                     # the number of regions that are large enough for a contact
type = "region_count"
in.regions = "every.regions"
min_area = {min_area}
min_force = {min_force:?}
"#
        );
        for rank in 1..=rules.regions {
            text.push_str(&format!(
                r#"
[nodes.select{rank}]
type = "select_region"
in.regions = "every.regions"
rank = {rank}
min_area = {min_area}
min_force = {min_force:?}

[nodes.region{rank}]
type = "moments"
in.image = "touch.repaired"
in.region = "select{rank}.region"
"#
            ));
        }
        text.push_str("\n[bind]\npad = \"recording\"\n\n[devices.recording]\ntype = \"recording\"\n");
        if self.graph {
            self.settings().iter().for_each(|setting| text.push_str(&format!("{setting}\n")));
        }
        text
    }
}

/// Runs a graph of this command and returns the largest number of regions in one frame, or the exit code.
pub(super) fn count_regions(request: &Request, duration: Option<f64>, shell: &Shell) -> Result<usize, u8> {
    let compiled = compile(shell.catalogue(), request).map_err(|report| shell.reject(&report))?;
    let mut engine = Engine::new(compiled);
    let count = PortColumns::find(engine.ports(), "regions.count").expect("the graph has this node");
    let (mut most, options) = (0.0, RunOptions { duration, ..RunOptions::default() });
    engine::run(&mut engine, &options, &mut |engine| most = f64::max(most, engine.bus().scalar(count).unwrap_or(0.0)))
        .map_err(|error| shell.refuse(format_args!("cannot run: {error}")))?;
    Ok(most as usize)
}

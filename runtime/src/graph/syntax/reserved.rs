//! Names: which are valid, and which are reserved.

/// Name of the section [limits] in `{ from = "limits.KEY" }`.
pub(crate) const LIMITS: &str = "limits";
/// Where a sensor is that no arm carries.
pub(crate) const NO_ARM: &str = "none";
/// Key of a device for its robot, and section of the file that it names.
pub(crate) const ROBOT: &str = "robot";
/// Key of a device for its sensor, and section of the file that it names.
pub(crate) const SENSOR: &str = "sensor";
/// The keys of a device that name the file of what it drives or reads.
pub(crate) const MODELS: [&str; 2] = [ROBOT, SENSOR];

/// The section [live].
pub(crate) const LIVE: &str = "live";
/// The section [allow].
pub(super) const ALLOW: &str = "allow";
/// Key of a bench that allows limits in raw readings.
pub(crate) const ALLOW_UNCALIBRATED: &str = "allow_uncalibrated";

/// The sections of a graph file.
pub(super) const GRAPH_SECTIONS: [&str; 15] = [
    "graph",
    "roles",
    "parts",
    "nodes",
    "commands",
    LIMITS,
    "modes",
    "policy",
    "record",
    LIVE,
    "devices",
    "bind",
    "facts",
    ALLOW,
    ALLOW_UNCALIBRATED,
];

/// The sections that make a part a task: each is about its own roles.
pub(crate) const TASK_SECTIONS: [&str; 6] = ["graph", "roles", "commands", LIMITS, "modes", "policy"];

/// Name of the inputs of a part in `in.NAME = "inputs.INPUT"`.
pub(crate) const INPUTS: &str = "inputs";

/// Name of the modes of a task in the flag `modes.NAME`.
pub(crate) const MODES: &str = "modes";

/// Reserved names, which have another meaning in wires and facts.
const RESERVED: [&str; 3] = [INPUTS, LIMITS, MODES];

/// The words of the operator that every run knows.
pub(crate) const WORDS: [&str; 3] = ["stop", "resume", "tare"];

/// Returns whether a text is a valid name.
pub(super) fn is_name(name: &str) -> bool {
    let is_word = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    let starts_well = name.starts_with(|c: char| c.is_ascii_lowercase());
    starts_well && name.chars().all(is_word) && !RESERVED.contains(&name)
}

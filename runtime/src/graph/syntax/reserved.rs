//! Names: which are valid, and which are reserved.

/// Name of the section [limits] in `{ from = "limits.KEY" }`.
pub(crate) const LIMITS: &str = "limits";
/// Where a sensor is that no arm carries.
pub(crate) const NO_ARM: &str = "none";
/// Key of a device for its robot, and section of the file that it names.
pub(crate) const ROBOT: &str = "robot";

/// Name of the inputs of a part in `in.NAME = "inputs.INPUT"`.
pub(crate) const INPUTS: &str = "inputs";

/// Reserved names, which have another meaning in wires and facts.
const RESERVED: [&str; 2] = [INPUTS, LIMITS];

/// Returns whether a text is a valid name.
pub(super) fn is_name(name: &str) -> bool {
    let is_word = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    let starts_well = name.starts_with(|c: char| c.is_ascii_lowercase());
    starts_well && name.chars().all(is_word) && !RESERVED.contains(&name)
}

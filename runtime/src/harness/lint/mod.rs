//! Checks of a whole catalogue in one line of a test.

mod declared;
mod example;
mod watched;

use std::fmt;

use crate::catalogue::Catalogue;
use crate::source::suggestion;

/// Measures the allocations of what it runs; see [`Lint::counting`].
pub type CountAllocations = fn(&mut dyn FnMut()) -> u64;

/// Checks everything in a catalogue. [`Lint::assert_clean`] reports all violations at once.
///
/// ```no_run
/// use tactflow_runtime::catalogue::Catalogue;
/// use tactflow_runtime::harness::lint;
///
/// lint(&Catalogue::new()).assert_clean();
/// ```
///
/// The rules:
///
/// - Names are `snake_case`, and each is used once.
/// - Nodes, devices, roles, ports and parameters have docs; a number has a unit.
/// - Each node and each device has an example. It loads without a warning, and each default is accepted where its
///   parameter stands.
/// - While the example runs, each output has a value at least once, and a scalar stays within the range that the node
///   declares for it.
/// - After a reset, a node gives the same outputs as a new node with the same inputs.
/// - A step allocates nothing. A library has no allocator of its own, so this is checked only if the test passes a
///   counter: [`Lint::counting`].
///
/// An example with a live device is loaded, but not run.
pub fn lint(catalogue: &Catalogue) -> Lint<'_> {
    Lint { catalogue, count: None, only: Vec::new(), without_example: Vec::new(), quiet: Vec::new() }
}

/// A check of a catalogue; see [`lint`].
#[must_use]
pub struct Lint<'c> {
    catalogue: &'c Catalogue,
    count: Option<CountAllocations>,
    only: Vec<String>,
    without_example: Vec<String>,
    quiet: Vec<String>,
}

/// A violation of a rule.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Violation {
    /// The node, the device or the role.
    pub owner: String,
    /// The port or the parameter, with its sort: ``output `value` ``.
    pub place: Option<String>,
    /// What is wrong.
    pub message: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Some(place) => write!(f, "`{}`: {place}: {}", self.owner, self.message),
            None => write!(f, "`{}`: {}", self.owner, self.message),
        }
    }
}

impl Lint<'_> {
    /// Checks the allocations of each step, with a counting allocator of the test: the `allocation-counter` crate has
    /// one, as `.counting(|step| allocation_counter::measure(step).count_total)`.
    pub fn counting(self, count: CountAllocations) -> Self {
        Self { count: Some(count), ..self }
    }

    /// Checks only these nodes, devices and roles. The rest of the catalogue serves their examples.
    pub fn only(self, names: &[&str]) -> Self {
        Self { only: names.iter().map(|name| (*name).to_owned()).collect(), ..self }
    }

    /// Does not load the examples of these entries, for example of a device that connects when it is opened.
    pub fn without_example_of(self, names: &[&str]) -> Self {
        Self { without_example: names.iter().map(|name| (*name).to_owned()).collect(), ..self }
    }

    /// Accepts that these outputs, as `node.output`, have no value in their example.
    pub fn accepting_silence_of(self, outputs: &[&str]) -> Self {
        Self { quiet: outputs.iter().map(|output| (*output).to_owned()).collect(), ..self }
    }

    /// Returns every violation.
    #[must_use]
    pub fn violations(&self) -> Vec<Violation> {
        let mut found = Vec::new();
        self.names(&mut found);
        self.docs(&mut found);
        self.examples(&mut found);
        found.retain(|violation| self.is_checked(&violation.owner));
        self.unknown_names(&mut found);
        found
    }

    /// Finds names in `only` and `without_example_of` that the catalogue does not have.
    fn unknown_names(&self, found: &mut Vec<Violation>) {
        let (nodes, devices) = (self.catalogue.specs(), self.catalogue.devices().iter());
        let roles = self.catalogue.roles().iter().map(|role| role.name.to_string());
        let known: Vec<String> = nodes
            .map(|spec| spec.name.to_string())
            .chain(devices.map(|device| device.name().into_owned()))
            .chain(roles)
            .collect();
        for name in self.only.iter().chain(&self.without_example).filter(|name| !known.contains(name)) {
            let help = suggestion(name, known.iter().map(String::as_str), "entries");
            Notes { owner: name.clone(), found }.add(None, format!("the catalogue has no `{name}`: {help}"));
        }
    }

    /// Checks everything.
    ///
    /// # Panics
    /// If there is a violation; the message has a line for each.
    pub fn assert_clean(&self) {
        let lines: Vec<String> = self.violations().iter().map(ToString::to_string).collect();
        assert!(lines.is_empty(), "{} violations:\n{}", lines.len(), lines.join("\n"));
    }

    fn is_checked(&self, name: &str) -> bool {
        self.only.is_empty() || self.only.iter().any(|only| only == name)
    }
}

/// Collects violations of one owner.
struct Notes<'f> {
    owner: String,
    found: &'f mut Vec<Violation>,
}

impl Notes<'_> {
    /// Adds a violation.
    fn add(&mut self, place: Option<String>, message: impl Into<String>) {
        self.found.push(Violation { owner: self.owner.clone(), place, message: message.into() });
    }

    /// Adds a violation unless `is_right`.
    fn unless(&mut self, is_right: bool, place: Option<String>, message: impl Into<String>) {
        if !is_right {
            self.add(place, message);
        }
    }
}

//! The exits of a mode: where they lead, and what they wait for.

use tactflow_runtime::graph::OutlinedMode;
use tactflow_runtime::source::{Item, Value};

/// The keys of the exits of a mode.
pub(crate) const EXITS: [&str; 4] = ["go", "on_lost", "done", "fail"];

/// An exit of a mode.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Exit<'a> {
    /// Its table.
    pub(crate) value: &'a Value,
}

/// Returns the exits of a mode under a key, such as `go` or `done`: one table, or a list of them.
pub(crate) fn exits<'a>(mode: &'a OutlinedMode, key: &'static str) -> impl Iterator<Item = Exit<'a>> {
    let settings = mode.settings.iter().filter(move |setting| setting.path == key);
    let values = settings.flat_map(|setting| match &setting.value.item {
        Item::Array(exits) => exits.iter().collect(),
        _ => vec![&setting.value],
    });
    values.map(|value| Exit { value })
}

impl<'a> Exit<'a> {
    /// Returns the mode to which it leads; `None` for an exit that ends the task.
    pub(crate) fn to(self) -> Option<&'a str> {
        self.word("to")
    }

    /// Returns the port for whose value it waits.
    pub(crate) fn when(self) -> Option<&'a str> {
        self.word("when")
    }

    /// Returns the port whose presence it watches.
    pub(crate) fn of(self) -> Option<&'a str> {
        self.word("of")
    }

    /// Returns one of its entries.
    pub(crate) fn entry(self, key: &str) -> Option<&'a Value> {
        self.value.as_table()?.get(key)
    }

    /// Returns one of its entries, if that is a number.
    pub(crate) fn number(self, key: &str) -> Option<f64> {
        self.entry(key)?.read()
    }

    /// Returns the time for which it waits whatever the ports say [ms]; 0 if it waits for something else too, or first.
    pub(crate) fn waits(self) -> f64 {
        let others = ["when", "after_travel_mm"].iter().any(|key| self.entry(key).is_some());
        self.number("after_ms").filter(|_| !others).unwrap_or_default()
    }

    /// Returns whether it waits until there is no contact.
    pub(crate) fn is_lost(self) -> bool {
        self.is_of_contact() && matches!(self.word("is"), Some("false" | "absent"))
    }

    /// Returns whether it waits for a contact.
    pub(crate) fn is_found(self) -> bool {
        self.is_of_contact() && !self.is_lost()
    }

    fn is_of_contact(self) -> bool {
        self.when().is_some_and(|port| port.ends_with(".present"))
    }

    /// Returns one of its entries, if that is a word. `true` and `false` are words too.
    fn word(self, key: &str) -> Option<&'a str> {
        let value = self.entry(key)?;
        match value.item {
            Item::Boolean(true) => Some("true"),
            Item::Boolean(false) => Some("false"),
            _ => value.as_str(),
        }
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::graph::{Request, compile};

    use super::*;

    #[test]
    fn an_exit_waits_for_the_end_of_a_contact_however_that_is_written() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/hybrid.toml");
        for (is, expected) in [("", false), ("is = true, ", false), ("is = false, ", true), ("is = \"absent\", ", true)]
        {
            let exit = format!("modes.servo.go={{ to = \"approach\", when = \"touch.present\", {is}for_ms = 2000 }}");
            let compiled = compile(&crate::catalogue(), &Request::file(path).set(exit));
            let compiled = compiled.unwrap_or_else(|report| panic!("{}", report.render(false)));
            let servo = compiled.outline().modes.iter().find(|mode| mode.name == "servo").unwrap();
            let exit = exits(servo, "go").next().unwrap();
            assert_eq!((exit.is_lost(), exit.is_found()), (expected, !expected), "{is}");
        }
    }
}

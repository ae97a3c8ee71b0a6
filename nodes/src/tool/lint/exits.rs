//! The exits of a mode that lead to other modes.

use tactflow_runtime::source::{Item, Value};

use super::mode_law::ModeLaw;

/// An exit of a mode that leads to another one.
pub(super) struct Exit<'a> {
    /// The mode.
    pub(super) to: &'a str,
    /// Its table.
    pub(super) value: &'a Value,
}

impl ModeLaw<'_> {
    /// Returns the tables of the exits of a kind.
    pub(super) fn tables(&self, kind: &'static str) -> impl Iterator<Item = &Value> {
        let settings = self.mode.iter().flat_map(|mode| &mode.settings).filter(move |setting| setting.path == kind);
        settings.flat_map(|setting| match &setting.value.item {
            Item::Array(exits) => exits.iter().collect(),
            _ => vec![&setting.value],
        })
    }

    /// Returns the exits of a kind that lead to other modes.
    pub(super) fn exits(&self, kind: &'static str) -> impl Iterator<Item = Exit<'_>> {
        self.tables(kind).filter_map(|value| Some(Exit { to: value.as_table()?.get("to")?.as_str()?, value }))
    }

    /// Returns the exits that are taken when the contact is lost.
    pub(super) fn lost(&self) -> impl Iterator<Item = Exit<'_>> {
        self.exits("on_lost").chain(self.releases())
    }

    /// Returns the exits that wait until there is no contact.
    pub(super) fn releases(&self) -> impl Iterator<Item = Exit<'_>> {
        self.exits("go").filter(Exit::is_lost)
    }

    /// Returns whether only the end of the contact, or a failure, ends the mode.
    pub(super) fn lasts(&self) -> bool {
        self.tables("done").next().is_none() && self.exits("go").all(|exit| exit.is_lost())
    }

    /// Returns whether any exit waits for the value of a port.
    pub(super) fn watches(&self) -> bool {
        let exits = ["go", "done", "fail"].into_iter().flat_map(|kind| self.tables(kind));
        exits.filter_map(Value::as_table).any(|exit| exit.get("when").is_some())
    }

    /// Returns whether an exit waits for a contact.
    pub(super) fn waits_for_contact(&self) -> bool {
        self.exits("go").any(|exit| exit.is_found())
    }
}

impl Exit<'_> {
    /// Returns whether a `go` waits until there is no contact.
    pub(super) fn is_lost(&self) -> bool {
        self.is_of_contact() && matches!(self.word("is"), Some("false" | "absent"))
    }

    /// Returns whether a `go` waits for a contact.
    pub(super) fn is_found(&self) -> bool {
        self.is_of_contact() && !self.is_lost()
    }

    fn is_of_contact(&self) -> bool {
        self.word("when").is_some_and(|port| port.ends_with(".present"))
    }

    pub(super) fn word(&self, key: &str) -> Option<&str> {
        self.value.as_table()?.get(key)?.as_str()
    }

    pub(super) fn number(&self, key: &str) -> Option<f64> {
        self.value.as_table()?.get(key)?.read()
    }
}

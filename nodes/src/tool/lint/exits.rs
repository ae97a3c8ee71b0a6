//! The exits of a mode that lead to other modes.

use tactflow_runtime::source::{Item, Value};

use super::ModeLaw;

/// An exit of a mode that leads to another one.
pub(super) struct Exit<'a> {
    /// The mode.
    pub(super) to: &'a str,
    /// Its table.
    pub(super) value: &'a Value,
}

impl ModeLaw<'_> {
    /// Returns the exits of a kind that lead to other modes.
    pub(super) fn exits(&self, kind: &'static str) -> impl Iterator<Item = Exit<'_>> {
        let settings = self.mode.iter().flat_map(|mode| &mode.settings).filter(move |setting| setting.path == kind);
        let each = settings.flat_map(|setting| match &setting.value.item {
            Item::Array(exits) => exits.iter().collect(),
            _ => vec![&setting.value],
        });
        each.filter_map(|value| Some(Exit { to: value.as_table()?.get("to")?.as_str()?, value }))
    }

    /// Returns the exits that are taken when the contact is lost.
    pub(super) fn lost(&self) -> impl Iterator<Item = Exit<'_>> {
        self.exits("on_lost").chain(self.exits("go").filter(Exit::is_lost))
    }
}

impl Exit<'_> {
    /// Returns whether a `go` waits until there is no contact.
    fn is_lost(&self) -> bool {
        let word = |key: &str| self.value.as_table()?.get(key)?.as_str();
        word("when").is_some_and(|port| port.ends_with(".present")) && matches!(word("is"), Some("false" | "absent"))
    }
}

//! The exits of a mode, as the lints ask for them.

use super::mode_law::ModeLaw;
use crate::tool::control::exits::{Exit, exits};

impl<'a> ModeLaw<'a> {
    /// Returns the exits under a key.
    fn all(&self, key: &'static str) -> impl Iterator<Item = Exit<'a>> {
        self.mode.into_iter().flat_map(move |mode| exits(mode, key))
    }

    /// Returns the exits under a key that lead to other modes.
    pub(super) fn exits(&self, key: &'static str) -> impl Iterator<Item = Exit<'a>> {
        self.all(key).filter(|exit| exit.to().is_some())
    }

    /// Returns the exits that wait for a condition: those that lead to other modes, and those that end the task.
    pub(super) fn conditions(&self) -> impl Iterator<Item = Exit<'a>> {
        self.all("go").chain(self.all("done"))
    }

    /// Returns the exits that end the task with a failure.
    pub(super) fn fails(&self) -> impl Iterator<Item = Exit<'a>> {
        self.all("fail")
    }

    /// Returns the exits that are taken when the contact is lost.
    pub(super) fn lost(&self) -> impl Iterator<Item = Exit<'a>> {
        self.exits("on_lost").chain(self.releases())
    }

    /// Returns the exits that wait until there is no contact.
    pub(super) fn releases(&self) -> impl Iterator<Item = Exit<'a>> {
        self.exits("go").filter(|exit| exit.is_lost())
    }

    /// Returns whether the mode lasts at least some time [ms] while there is a contact, unless it fails.
    pub(super) fn lasts_for(&self, ms: f64) -> bool {
        self.conditions().all(|exit| exit.is_lost() || exit.waits() >= ms)
    }

    /// Returns whether any exit waits for the value of a port.
    pub(super) fn watches(&self) -> bool {
        self.conditions().chain(self.fails()).any(|exit| exit.entry("when").is_some())
    }

    /// Returns whether an exit waits for a contact.
    pub(super) fn waits_for_contact(&self) -> bool {
        self.exits("go").any(Exit::is_found)
    }
}

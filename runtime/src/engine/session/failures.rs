//! Nodes that find that their task must not go on: the task ends with a fault.

use super::engine::Engine;
use super::trouble::{Origin, Trouble, WatchedFailure};
use crate::fault::Fault;
use crate::graph::Policy;
use crate::signal::Flag;

impl Engine {
    /// Ends the tasks of each node that has found that they must not go on. No policy changes that: such a node knows
    /// that its sensor cannot be trusted.
    ///
    /// # Errors
    /// Returns the fault if it ends the run.
    pub(super) fn watch_failures(&mut self) -> Result<(), Fault> {
        for i in 0..self.failures.len() {
            let WatchedFailure { runner, flag } = self.failures[i];
            if self.core.bus.get::<Flag>(flag).is_some_and(|has_failed| *has_failed) {
                self.raise(Origin::Runner(runner), |_| Policy::Fault, Trouble::Found(runner))?;
            }
        }
        Ok(())
    }

    /// Returns what nodes have found out about their sensors so far, each with the name of the node.
    pub fn findings(&self) -> impl Iterator<Item = (&str, String)> {
        self.names.iter().zip(self.core.found()).filter_map(|((name, _), found)| Some((name.as_str(), found?)))
    }
}

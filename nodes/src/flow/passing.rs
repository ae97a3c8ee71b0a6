//! What the nodes share that pass a signal on: when the output is new.

use tactflow_runtime::node::{Out, State};
use tactflow_runtime::signal::Signal;

/// What a node remembers that passes a signal on.
#[derive(State)]
pub struct State {
    /// The source of the last output; `None` if it was absent.
    last: Option<bool>,
}

impl State {
    /// Passes on the value of a source. The output is new if the value is new, or if the source has changed.
    pub(super) fn pass<T: Signal>(&mut self, source: Option<bool>, value: Option<&T>, is_new: bool, out: &mut Out<T>) {
        let is_changed = std::mem::replace(&mut self.last, source) != source;
        match value {
            Some(value) if is_new || is_changed => out.copy_from(value),
            Some(_) => out.keep(),
            None => {}
        }
    }
}

//! The modes of a task as ports: a flag for each, which is set while the task is in that mode.

use crate::graph::load::FlatGraph;
use crate::graph::syntax::MODES;
use crate::node::PortSpec;
use crate::signal::Kind;

/// The modes of one task.
pub(super) struct TaskModes {
    /// `modes`, or `left.modes` of the task `left`.
    pub(super) name: String,
    /// The flags, in the order of the file.
    pub(super) ports: Vec<PortSpec>,
}

impl TaskModes {
    /// Returns the modes of every task.
    pub(super) fn all(flat: &FlatGraph) -> Vec<Self> {
        let tasks = flat.tasks.iter().enumerate();
        let port = |name: &str| PortSpec {
            name: name.to_owned().into(),
            ..PortSpec::new("", "Whether the task is in this mode.", Kind::Flag, &[])
        };
        let modes = tasks.map(|(task, known)| Self {
            name: format!("{}{MODES}", known.prefix),
            ports: flat.mode_names(task).map(port).collect(),
        });
        modes.collect()
    }
}

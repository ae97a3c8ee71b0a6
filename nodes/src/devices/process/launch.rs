//! What is needed to start a program.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Duration;

use super::signature::Signature;

/// What is needed to start a program.
#[derive(Debug, Clone)]
pub(super) struct Launch {
    pub(super) command: Vec<String>,
    /// The folder in which it runs.
    pub(super) folder: PathBuf,
    /// What the file states of it.
    pub(super) signature: Signature,
    /// The values of its parameters.
    pub(super) values: BTreeMap<String, f64>,
    /// Nominal time between two answers.
    pub(super) period: Duration,
    /// Longest time for an answer.
    pub(super) timeout: Duration,
    /// Longest time until it has stated its signature.
    pub(super) start: Duration,
}

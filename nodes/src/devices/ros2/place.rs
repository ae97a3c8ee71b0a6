//! Where the topics of a device are: the parameters that all devices share.

use std::net::IpAddr;
use std::time::Duration;

use tactflow_runtime::node::{Mistake, Mistakes, Param};

use super::domain::{Domain, MAX_DOMAIN, domain_of};

/// The domain, and the network over which it is reached.
#[derive(Debug, Clone, Param)]
pub(super) struct Place {
    /// The domain; that of the environment variable `ROS_DOMAIN_ID`, or 0, if not given.
    #[param(range = 0..=MAX_DOMAIN)]
    domain: Option<usize>,
    /// Our address on the network of the robot, such as `192.168.0.5`. The default reaches this machine only.
    #[param(default = "127.0.0.1")]
    network: String,
    /// Time until something must have come, or must read the commands. Keep it below 2 s: a task that gets no first sample
    /// until then is halted, and its message would have no reason yet.
    #[param(unit = "s", range = 0.1..=120.0, default = 1.5)]
    connect_s: f64,
}

/// A place that is checked.
#[derive(Debug, Clone, Copy)]
pub(super) struct Site {
    domain: Option<usize>,
    network: IpAddr,
    pub(super) patience: Duration,
}

impl Place {
    pub(super) fn site(&self) -> Result<Site, Mistakes> {
        let network = self.network.parse().map_err(|_| {
            let message =
                format!("`{}` is no IP address: write one of this machine, such as \"192.168.0.5\"", self.network);
            Mistake::param("network", message)
        })?;
        Ok(Site { domain: self.domain, network, patience: Duration::from_secs_f64(self.connect_s) })
    }
}

impl Site {
    pub(super) fn join(&self) -> Result<Domain, String> {
        Domain::join(domain_of(self.domain)?, self.network)
    }
}

/// Checks the name of a topic.
///
/// # Errors
/// What a name consists of, at the parameter.
pub(super) fn check_topic(param: &str, name: &str) -> Result<(), Mistakes> {
    if is_topic(name) {
        return Ok(());
    }
    let message = format!("`{name}` is no name of a topic: it begins with `/`, and has letters, digits and `_`");
    let with_slash = format!("/{name}");
    let mistake = Mistake::param(param, message);
    Err(if is_topic(&with_slash) { mistake.help(format!("write `\"{with_slash}\"`")) } else { mistake }.into())
}

/// Whether a text is the absolute name of a topic.
pub(super) fn is_topic(name: &str) -> bool {
    let is_part = |part: &str| {
        part.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') && part.starts_with(|c: char| !c.is_ascii_digit())
    };
    name.strip_prefix('/').is_some_and(|rest| rest.split('/').all(is_part))
}

//! The domain that the commands of `tactflow ros2` join.

use std::net::IpAddr;

use tactflow_runtime::cli::clap;

/// A domain, and the network over which it is reached.
#[derive(clap::Args)]
pub(super) struct DomainArgs {
    /// The domain; that of ROS_DOMAIN_ID, or 0, if not given
    #[arg(long = "domain", value_name = "ID", value_parser = clap::value_parser!(u16).range(0..=101))]
    id: Option<u16>,
    /// Address of this machine on the network of the others; the default reaches this machine only
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    pub(super) network: IpAddr,
}

impl DomainArgs {
    /// Returns the number of the domain, if it is given.
    pub(super) fn id(&self) -> Option<usize> {
        self.id.map(usize::from)
    }
}

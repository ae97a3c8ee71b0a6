//! `tactflow ros2 topics`: what others publish and read in a domain.

use std::time::{Duration, Instant};

use tactflow_runtime::cli::{Shell, clap, duration, table};

use super::domain::DomainArgs;
use crate::devices::ros2::offers;

/// List the topics that others publish and read, with their types
#[derive(clap::Parser)]
#[command(
    name = "topics",
    after_help = "Example:
  tactflow ros2 topics --domain 42

An arm listens on a topic that somebody reads as trajectory_msgs/msg/JointTrajectory, or as the type that `message` of
the bench chooses. Its joints are published as sensor_msgs/msg/JointState.

Exit codes: 0 there is a topic; 1 there is none; 2 the domain cannot be joined."
)]
pub(super) struct TopicsArgs {
    #[command(flatten)]
    domain: DomainArgs,
    /// How long to listen
    #[arg(long = "for", value_name = "TIME", value_parser = duration, default_value = "2s")]
    duration: f64,
}

pub(super) fn run(args: &TopicsArgs, shell: &Shell) -> Result<u8, u8> {
    let end = Instant::now() + Duration::from_secs_f64(args.duration);
    let (domain, offers) = offers(args.domain.id(), args.domain.network, end).map_err(|why| shell.refuse(why))?;
    if offers.is_empty() {
        shell.warning(format!(
            "no topic of ROS was seen in the domain {domain} over {}: check ROS_DOMAIN_ID or `--domain`, and `--network`",
            args.domain.network
        ));
        return Ok(1);
    }
    let mut rows = vec![["topic", "type", "publishers", "readers"].map(String::from)];
    rows.extend(offers.into_iter().map(|offer| {
        let [writers, readers] = [offer.writers, offer.readers].map(|count| count.to_string());
        [offer.topic, offer.kind, writers, readers]
    }));
    shell.say(table(&rows, 2, usize::MAX).trim_end());
    Ok(0)
}

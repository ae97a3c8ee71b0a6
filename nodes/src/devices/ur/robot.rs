//! A robot, as the bench describes it.

use std::net::IpAddr;
use std::time::Duration;

use tactflow_runtime::device::{DeviceError, Link};
use tactflow_runtime::signal::Twist;

use super::checks::{Checks, in_order};
use super::geometry;
use super::program::{Listeners, PortNumbers};
use super::recipe::{JOINTS, State};
use super::rtde::Request;
use super::script::{Ports, Script};
use super::status::Allowed;
use crate::arm::chain::Chain;
use crate::devices::arm::ArmPorts;
use crate::devices::wrench::WrenchPorts;

/// A robot, as the bench describes it.
#[derive(Debug)]
pub(super) struct Robot {
    pub(super) ports: ArmPorts,
    pub(super) force: WrenchPorts,
    /// Pose of the tip from the joints of the model.
    pub(super) chain: Chain,
    pub(super) request: Request,
    /// Where the controller takes programs, as `host:port`.
    pub(super) script_address: String,
    /// Our address, as the robot sees it; that of the connection if not given.
    pub(super) host: Option<String>,
    /// Where its program connects from; the address of the connection if not given.
    pub(super) peer: Option<IpAddr>,
    pub(super) port_numbers: PortNumbers,
    pub(super) script: Script,
    /// Whether we send the program; otherwise a node of External Control asks for it.
    pub(super) sends_program: bool,
    pub(super) allowed: Allowed,
    pub(super) checks: Checks,
    /// Samples per second [Hz].
    pub(super) rate_hz: f64,
    /// Time after which the program stops without a message [ms].
    pub(super) timeout_ms: i32,
    /// Time without a sample after which the connection is lost.
    pub(super) silence: Duration,
    /// Longest time until the program on the robot runs.
    pub(super) start: Duration,
    /// Maximum acceleration of a joint [rad/s²].
    pub(super) acceleration: f64,
}

impl Robot {
    /// Returns where the program connects to.
    pub(super) fn script_ports<'h>(&self, host: &'h str, listeners: &Listeners) -> Ports<'h> {
        let [reverse, trajectory, command] = listeners.ports();
        Ports { host, reverse, trajectory, command }
    }

    /// Returns an error of this robot.
    pub(super) fn failure(&self, why: &str) -> DeviceError {
        DeviceError(format!("the robot at {}: {why}", self.request.address))
    }

    /// Publishes a state, with the joints in the order of the model.
    pub(super) fn write(&self, link: &mut Link, state: &State, stamp: i64, sequence: u64, follows: bool) {
        let [position, equilibrium] = [&state.q, &state.target_q].map(|q| in_order(&self.checks.order, q));
        let tip = self.chain.forward(&position, &mut [Twist::default(); JOINTS]).0;
        let wrench = state.tcp_force.map(|force| geometry::wrench_at(&tip, &self.checks.base, state.tcp_pose, force));
        link.publish(|samples| {
            self.ports.write_with_safety(samples, stamp, sequence, [&position, &equilibrium], follows);
            if let Some(wrench) = wrench {
                self.force.write(samples, stamp, sequence, &wrench);
            }
        });
    }
}

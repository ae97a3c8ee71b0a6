//! The driver: it connects to the robot, again and again.

use std::sync::Arc;
use std::time::Duration;

use async_trait::async_trait;
use tactflow_runtime::device::{DeviceError, Link, Live};

use super::checks::Checks;
use super::program::{Listeners, PortNumbers};
use super::rtde::{Failure, Request, Stream};
use super::script::{Ports, Script};
use super::session::{End, Phase, Session};
use super::status::Allowed;
use crate::arm::chain::Chain;
use crate::devices::arm::ArmPorts;
use crate::devices::wrench::WrenchPorts;

/// Time between two attempts to connect.
const RETRY: Duration = Duration::from_millis(500);

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

#[async_trait]
impl Live for Robot {
    async fn run(self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        let mut listeners = Listeners::open(self.port_numbers).await.map_err(DeviceError)?;
        let mut phase = Phase::start();
        loop {
            let Some(stream) = idle(&mut link, Stream::open(&self.request)).await else { return Ok(()) };
            let end = match stream {
                Ok(stream) => {
                    let end = self.serve(stream, &mut listeners, phase, &mut link).await?;
                    phase = Phase::Refused;
                    end
                }
                Err(Failure::Final(why)) => return Err(self.failure(&why)),
                Err(Failure::Without(_)) => return Err(self.failure("it does not know its own outputs")),
                Err(Failure::Again(why)) => End::Lost(why),
            };
            let End::Lost(why) = end else { return Ok(()) };
            link.count("reconnects");
            let why = self.failure(&why).0;
            link.refuse(why.clone());
            self.ports.lose(&mut link, &why);
            self.force.lose(&mut link, &why);
            if idle(&mut link, tokio::time::sleep(RETRY)).await.is_none() {
                return Ok(());
            }
        }
    }
}

impl Robot {
    /// Follows the robot on a connection, until the run or the connection ends.
    async fn serve(
        &self,
        stream: Stream,
        listeners: &mut Listeners,
        phase: Phase,
        link: &mut Link,
    ) -> Result<End, DeviceError> {
        let own = stream.own_address().map(|address| address.to_string());
        let Ok(host) = self.host.clone().map_or(own, Ok) else {
            return Ok(End::Lost("the connection has no address of its own".into()));
        };
        if !self.sends_program {
            let ports = self.script_ports(&host, listeners);
            let body = self.script.body(&ports, stream.version).map_err(|why| self.failure(&why))?;
            listeners.serve(Arc::from(body));
        }
        let mut session = Session::new(self, listeners, stream, host, phase);
        let end = session.follow(link).await;
        if matches!(end, End::Lost(_)) {
            // Nobody sees what the robot does now, so its program is to end.
            session.abort();
        }
        Ok(end)
    }

    pub(super) fn script_ports<'h>(&self, host: &'h str, listeners: &Listeners) -> Ports<'h> {
        let [reverse, trajectory, command] = listeners.ports();
        Ports { host, reverse, trajectory, command }
    }

    fn failure(&self, why: &str) -> DeviceError {
        DeviceError(format!("the robot at {}: {why}", self.request.address))
    }
}

/// Waits for a future while the robot is not commanded. Returns `None` when the run ends.
async fn idle<T>(link: &mut Link, future: impl Future<Output = T>) -> Option<T> {
    tokio::pin!(future);
    loop {
        let (stopped, commanded) = (link.stopped(), link.commanded());
        tokio::select! {
            biased;
            () = stopped => return None,
            value = &mut future => return Some(value),
            // Nothing is sent, but the graph must see that the commands come to rest.
            () = commanded => {
                link.commands();
            }
        }
    }
}

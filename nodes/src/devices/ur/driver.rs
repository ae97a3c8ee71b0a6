//! The driver: it connects to the robot, again and again.

use std::sync::Arc;
use std::time::Duration;

use async_trait::async_trait;
use tactflow_runtime::device::{DeviceError, Link, Live};

use super::course::Phase;
use super::program::Listeners;
use super::robot::Robot;
use super::rtde::{Failure, Stream};
use super::session::Session;

/// Time between two attempts to connect.
const RETRY: Duration = Duration::from_millis(500);

#[async_trait]
impl Live for Robot {
    async fn run(self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        let mut listeners = Listeners::open(self.port_numbers).await.map_err(DeviceError)?;
        let (mut phase, mut is_first) = (Phase::start(), true);
        loop {
            let Some(stream) = idle(&mut link, Stream::open(&self.request)).await else { return Ok(()) };
            let served = match stream {
                Ok(stream) => {
                    if matches!(phase, Phase::Starting { .. }) {
                        // The time until the robot answers is not that of its program.
                        phase = Phase::start();
                    }
                    let start = std::mem::replace(&mut phase, Phase::Refused);
                    self.serve(stream, &mut listeners, (start, &mut is_first), &mut link).await
                }
                Err(failure) => Err(failure),
            };
            let why = match served {
                Ok(()) => return Ok(()),
                Err(Failure::Final(why)) => return Err(self.failure(&why)),
                Err(Failure::Without(_)) => return Err(self.failure("it does not know its own outputs")),
                Err(Failure::Again(why)) => why,
            };
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
    /// Follows the robot on a connection, until the run ends. `is_first` is whether no velocity has moved the robot in
    /// this run.
    ///
    /// # Errors
    /// Why the connection has ended before, or that the program cannot be written.
    async fn serve(
        &self,
        stream: Stream,
        listeners: &mut Listeners,
        (phase, is_first): (Phase, &mut bool),
        link: &mut Link,
    ) -> Result<(), Failure> {
        let own = stream.own_address().map(|address| address.to_string());
        let Ok(host) = self.host.clone().map_or(own, Ok) else {
            return Err(Failure::Again("the connection has no address of its own".into()));
        };
        let Ok(peer) = self.peer.map_or_else(|| stream.peer_address(), Ok) else {
            return Err(Failure::Again("the connection is closed".into()));
        };
        if !self.sends_program && !link.is_mute() {
            let ports = self.script_ports(&host, listeners);
            let body = self.script.body(&ports, stream.version).map_err(Failure::Final)?;
            listeners.serve(Arc::from(body), peer);
        }
        let mut session = Session::new(self, listeners, stream, (host, peer), (phase, *is_first));
        let end = session.follow(link).await;
        *is_first = session.is_first;
        if end.is_err() {
            // Nobody sees what the robot does now, so its program is to end.
            session.abort();
        }
        end.map_err(Failure::Again)
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

//! A client of a run: it connects, asks and waits for the answer.

use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

use serde::de::DeserializeOwned;

use super::asks::{Answer, Ask, Followed, PortFacts};

/// Longest wait for an answer.
const MAX_ANSWER: Duration = Duration::from_secs(3);
/// The same for a change, whose check can take a while.
const MAX_CHECK: Duration = Duration::from_secs(25);

/// A connection to a run.
pub(crate) struct Client {
    reader: BufReader<UnixStream>,
}

/// What a watched run sends.
pub(crate) enum Sample {
    /// A line with values.
    Line(String),
    /// The run has ended, or the wanted number is reached.
    End,
}

impl Client {
    /// Connects to a socket.
    ///
    /// # Errors
    /// If nobody listens.
    pub(crate) fn connect(path: &Path) -> Result<Self, String> {
        let fail = |error: std::io::Error| format!("cannot connect to `{}`: {error}", path.display());
        let stream = UnixStream::connect(path).map_err(fail)?;
        stream.set_write_timeout(Some(MAX_ANSWER)).map_err(fail)?;
        Ok(Self { reader: BufReader::new(stream) })
    }

    /// Asks, and returns the answer.
    ///
    /// # Errors
    /// Why the run refuses the request, or that it does not answer.
    pub(crate) fn ask<T: DeserializeOwned>(&mut self, ask: &Ask) -> Result<T, String> {
        let wait = if matches!(ask, Ask::Set { .. }) { MAX_CHECK } else { MAX_ANSWER };
        let waits = self.reader.get_ref().set_read_timeout(Some(wait));
        waits.map_err(|error| format!("the run does not answer: {error}"))?;
        let line = serde_json::to_string(ask).expect("every key is a string") + "\n";
        match self.reader.get_mut().write_all(line.as_bytes()) {
            Ok(()) => {}
            // A run that has too many clients says so without being asked, and closes the connection.
            Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => {}
            Err(error) => return Err(format!("the run does not answer: {error}")),
        }
        let Sample::Line(line) = self.line()? else { return Err("the run has ended".into()) };
        match serde_json::from_str(&line) {
            Ok(Answer::Ok(value)) => Ok(value),
            Ok(Answer::Error(why)) => Err(why),
            Err(error) => Err(format!("the run answers in another version of the protocol: {error}")),
        }
    }

    /// Lets samples come at any time.
    ///
    /// # Errors
    /// Those of the connection.
    pub(crate) fn wait_for_ever(&self) -> Result<(), String> {
        self.reader.get_ref().set_read_timeout(None).map_err(|error| error.to_string())
    }

    /// Returns the next line.
    ///
    /// # Errors
    /// If it does not come in time.
    pub(crate) fn line(&mut self) -> Result<Sample, String> {
        let mut line = String::new();
        match self.reader.read_line(&mut line) {
            Ok(0) => Ok(Sample::End),
            // The run has ended with a request on the way.
            Err(error) if error.kind() == std::io::ErrorKind::ConnectionReset => Ok(Sample::End),
            Ok(_) => Ok(Sample::Line(line)),
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {
                Err("the run does not answer in time".into())
            }
            Err(error) => Err(format!("the run does not answer: {error}")),
        }
    }
}

/// Ports of a run that are followed: their newest values, images included.
pub struct Following {
    client: Client,
    ports: Vec<PortFacts>,
}

impl Following {
    /// Follows the ports that names and patterns mean, with at least `period_ms` between two lines.
    ///
    /// # Errors
    /// If a name means no port, or the run does not answer.
    pub(crate) fn begin(path: &Path, ports: Vec<String>, period_ms: f64) -> Result<Self, String> {
        let mut client = Client::connect(path)?;
        let ports = client.ask(&Ask::Follow { ports, period_ms })?;
        client.wait_for_ever()?;
        Ok(Self { client, ports })
    }

    /// Returns what does not change of the ports.
    #[must_use]
    pub fn ports(&self) -> &[PortFacts] {
        &self.ports
    }

    /// Waits for the next values. `None` if the run is gone. Before that, a run that has ended by itself says how.
    ///
    /// # Errors
    /// If the run sends something else.
    pub fn wait(&mut self) -> Result<Option<Followed>, String> {
        match self.client.line()? {
            Sample::End => Ok(None),
            Sample::Line(line) => serde_json::from_str(&line)
                .map(Some)
                .map_err(|error| format!("the run answers in another version of the protocol: {error}")),
        }
    }
}

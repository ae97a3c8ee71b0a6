//! A domain of DDS: the topics that are read and written, and what its other participants offer.
//!
//! The names are those that ROS 2 gives to its topics and types on the wire of DDS. There is no node of ROS behind them:
//! `ros2 topic info -v` lists the endpoints, and `ros2 node list` lists nothing.

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::Mutex;
use std::time::Duration;

use futures_util::StreamExt;
use rustdds::no_key::{DataReaderStream, DataWriter};
use rustdds::policy::{Durability, History, Lifespan, Reliability};
use rustdds::qos::QosPolicyId;
use rustdds::{
    CDRDeserializerAdapter, CDRSerializerAdapter, DataWriterStatus, DomainParticipant, DomainParticipantBuilder, GUID,
    Publisher, QosPolicies, QosPolicyBuilder, RTPSEntity, StatusEvented, Subscriber, TopicKind,
};

use super::message::{Message, dds_type, ros_type};

/// Highest number of a domain whose ports exist on every system.
pub(super) const MAX_DOMAIN: usize = 101;

/// Depth of a topic that others see.
#[cfg(all(feature = "cli", unix))]
const SHOWN_DEPTH: i32 = 10;

/// The participants of this process. A message does not list their topics: somebody who reads it looks for the others.
static OURS: Mutex<Vec<GUID>> = Mutex::new(Vec::new());

/// Number of topics that a message lists.
const MAX_LISTED: usize = 6;

/// Number of writers of a topic whose types are remembered.
const MAX_TRUSTED: usize = 16;

/// A participant of a domain.
pub(super) struct Domain {
    id: u16,
    network: IpAddr,
    participant: DomainParticipant,
    publisher: Publisher,
    subscriber: Subscriber,
}

/// Somebody else who writes or reads a topic.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Peer {
    pub(super) guid: GUID,
    /// Name of the type, as ROS writes it.
    pub(super) kind: String,
}

/// A topic of ROS with one type, as others use it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Offer {
    /// Its name, such as `/joint_states`.
    pub(crate) topic: String,
    /// The type of its messages, as ROS writes it.
    pub(crate) kind: String,
    /// Number of those who write it, and who read it.
    pub(crate) writers: usize,
    pub(crate) readers: usize,
}

/// The messages of a topic.
pub(super) struct Reader<M: Message> {
    messages: DataReaderStream<M, CDRDeserializerAdapter<M>>,
    participant: DomainParticipant,
    /// Writers that have our type.
    trusted: Vec<GUID>,
}

/// Writes messages to a topic.
pub(super) struct Writer<M: Message> {
    writer: DataWriter<M, CDRSerializerAdapter<M>>,
    /// Number of readers that get the messages.
    readers: i32,
    /// What a reader asks for that is not offered.
    refused: Option<QosPolicyId>,
}

/// Returns the domain that is meant: the one of the bench, or that of the environment, or 0.
pub(super) fn domain_of(given: Option<usize>) -> Result<u16, String> {
    if let Some(given) = given {
        return Ok(given as u16);
    }
    match std::env::var("ROS_DOMAIN_ID") {
        Err(_) => Ok(0),
        Ok(text) if text.is_empty() => Ok(0),
        Ok(text) => text.parse().ok().filter(|id| usize::from(*id) <= MAX_DOMAIN).ok_or_else(|| {
            format!(
                "ROS_DOMAIN_ID is `{text}`, and not a number from 0 to {MAX_DOMAIN}; `domain` of the bench, or `--domain`, replaces it"
            )
        }),
    }
}

impl Domain {
    /// Joins a domain over the network interface with an address.
    ///
    /// # Errors
    /// If the sockets cannot be opened, or this machine does not have the address.
    pub(super) fn join(id: u16, network: IpAddr) -> Result<Self, String> {
        // The library would join without an interface, and hear nothing.
        std::net::UdpSocket::bind((network, 0))
            .map_err(|error| format!("this machine has no address {network} (`network`): {error}"))?;
        let failed = |error: &dyn std::fmt::Debug| format!("cannot join the domain {id} over {network}: {error:?}");
        let participant = DomainParticipantBuilder::new(id).with_only_networks([network]).build();
        let participant = participant.map_err(|error| failed(&error))?;
        let qos = QosPolicyBuilder::new().build();
        let publisher = participant.create_publisher(&qos).map_err(|error| failed(&error))?;
        let subscriber = participant.create_subscriber(&qos).map_err(|error| failed(&error))?;
        ours().push(participant.guid());
        Ok(Self { id, network, participant, publisher, subscriber })
    }

    /// Reads a topic: best effort, which every writer offers, and the newest message only.
    pub(super) fn read<M: Message>(&self, name: &str) -> Result<Reader<M>, String> {
        let qos = QosPolicyBuilder::new()
            .reliability(Reliability::BestEffort)
            .durability(Durability::Volatile)
            .history(History::KeepLast { depth: 1 })
            .build();
        let topic = self.topic::<M>(name, &qos)?;
        let reader = self.subscriber.create_datareader_no_key(&topic, None);
        let reader = reader.map_err(|error| refused(name, &error))?;
        let messages = reader.async_sample_stream();
        Ok(Reader { messages, participant: self.participant.clone(), trusted: Vec::new() })
    }

    /// Writes a topic of commands: reliable, the newest message only, and none that is older than `lifespan`.
    pub(super) fn write<M: Message>(&self, name: &str, lifespan: Duration) -> Result<Writer<M>, String> {
        self.writer(name, &reliable(1).lifespan(Lifespan { duration: lifespan.into() }).build())
    }

    /// Writes a topic that others see: reliable, which a best-effort reader takes too, and the last messages.
    #[cfg(all(feature = "cli", unix))]
    pub(super) fn show<M: Message>(&self, name: &str) -> Result<Writer<M>, String> {
        self.writer(name, &reliable(SHOWN_DEPTH).build())
    }

    fn writer<M: Message>(&self, name: &str, qos: &QosPolicies) -> Result<Writer<M>, String> {
        let qos = qos.clone();
        let topic = self.topic::<M>(name, &qos)?;
        let writer = self.publisher.create_datawriter_no_key(&topic, None);
        writer.map(|writer| Writer { writer, readers: 0, refused: None }).map_err(|error| refused(name, &error))
    }

    fn topic<M: Message>(&self, name: &str, qos: &QosPolicies) -> Result<rustdds::Topic, String> {
        let topic = self.participant.create_topic(dds_name(name), dds_type(M::TYPE), qos, TopicKind::NoKey);
        topic.map_err(|error| refused(name, &error))
    }

    /// Returns who else writes a topic.
    pub(super) fn writers(&self, name: &str) -> Vec<Peer> {
        let topic = dds_name(name);
        self.all_writers().filter(|(of, peer)| *of == topic && self.is_other(peer.guid)).map(|(_, peer)| peer).collect()
    }

    /// Returns who else reads a topic.
    pub(super) fn readers(&self, name: &str) -> Vec<Peer> {
        let topic = dds_name(name);
        self.all_readers().filter(|(of, peer)| *of == topic && self.is_other(peer.guid)).map(|(_, peer)| peer).collect()
    }

    /// Whether somebody is another participant. Two arms of one bench are two: only one may command a topic.
    fn is_other(&self, guid: GUID) -> bool {
        guid.prefix != self.participant.guid().prefix
    }

    /// Returns who writes, each with the topic on the wire.
    fn all_writers(&self) -> impl Iterator<Item = (String, Peer)> {
        let found = self.participant.discovered_writers().into_iter().map(|writer| writer.publication_topic_data);
        found.map(|data| (data.topic_name, Peer { guid: data.key, kind: ros_type(&data.type_name) }))
    }

    /// Returns who reads, each with the topic on the wire.
    fn all_readers(&self) -> impl Iterator<Item = (String, Peer)> {
        let found = self.participant.discovered_readers().into_iter();
        found.map(|reader| {
            let data = reader.subscription_topic_data;
            let kind = ros_type(data.type_name());
            (data.topic_name().clone(), Peer { guid: reader.reader_proxy.remote_reader_guid, kind })
        })
    }

    /// Returns the topics of ROS that programs other than this one use, by name.
    pub(crate) fn offers(&self) -> Vec<Offer> {
        let mut counts: BTreeMap<(String, String), [usize; 2]> = BTreeMap::new();
        let writers = self.all_writers().map(|found| (found, 0));
        for ((topic, peer), side) in writers.chain(self.all_readers().map(|found| (found, 1))) {
            if let Some(name) = topic.strip_prefix("rt/").filter(|_| is_foreign(peer.guid)) {
                counts.entry((format!("/{name}"), peer.kind)).or_default()[side] += 1;
            }
        }
        counts.into_iter().map(|((topic, kind), [writers, readers])| Offer { topic, kind, writers, readers }).collect()
    }

    /// Says why no message of a topic has come.
    pub(super) fn why_silent<M: Message>(&self, name: &str) -> String {
        let writers = self.writers(name);
        match writers.iter().find(|writer| writer.kind != M::TYPE) {
            Some(other) if writers.iter().all(|writer| writer.kind != M::TYPE) => {
                format!("`{name}` has messages of the type {}, and not {}", other.kind, M::TYPE)
            }
            _ if !writers.is_empty() => {
                format!(
                    "`{name}` is published as {}, but no message arrives: check the publisher and the network",
                    M::TYPE
                )
            }
            _ => format!("nobody publishes `{name}` {}", self.neighbours()),
        }
    }

    /// Says what is heard in the domain.
    fn neighbours(&self) -> String {
        let written = self.offers().into_iter().filter(|offer| offer.writers > 0);
        let topics: Vec<String> = written.map(|offer| format!("`{}` ({})", offer.topic, offer.kind)).collect();
        let id = self.id;
        match topics.as_slice() {
            [] => format!("in the domain {id}, where no topic of ROS is published: check `domain` and `network`"),
            few if few.len() <= MAX_LISTED => format!("in the domain {id}; published there: {}", few.join(", ")),
            many => {
                let (few, more, network) = (many[..MAX_LISTED].join(", "), many.len() - MAX_LISTED, self.network);
                format!(
                    "in the domain {id}; published there: {few} and {more} more: `tactflow ros2 topics --domain {id} \
                     --network {network}` lists them"
                )
            }
        }
    }

    /// Says where messages of a type are read, if not what is heard in the domain.
    fn who_reads(&self, kind: &str) -> String {
        let read = self.offers().into_iter().filter(|offer| offer.readers > 0 && offer.kind == kind);
        let topics: Vec<String> = read.map(|offer| format!("`{}`", offer.topic)).collect();
        match topics.as_slice() {
            [] => self.neighbours(),
            topics => {
                format!("in the domain {}; messages of the type {kind} are read on {}", self.id, topics.join(", "))
            }
        }
    }
}

/// Listens in a domain until `end`. Returns its number, and the topics that others use.
///
/// # Errors
/// If the domain cannot be joined.
#[cfg(all(feature = "cli", unix))]
pub(crate) fn offers(
    domain: Option<usize>,
    network: IpAddr,
    end: std::time::Instant,
) -> Result<(u16, Vec<Offer>), String> {
    let domain = Domain::join(domain_of(domain)?, network)?;
    std::thread::sleep(end.saturating_duration_since(std::time::Instant::now()));
    Ok((domain.id, domain.offers()))
}

impl Drop for Domain {
    fn drop(&mut self) {
        ours().retain(|guid| *guid != self.participant.guid());
    }
}

fn ours() -> std::sync::MutexGuard<'static, Vec<GUID>> {
    OURS.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Whether somebody is not of this process.
fn is_foreign(guid: GUID) -> bool {
    !ours().iter().any(|our| our.prefix == guid.prefix)
}

impl<M: Message> Reader<M> {
    /// Waits for the next message. Returns it with its writer.
    ///
    /// # Errors
    /// If a message is not of our type, or not of the one that its writer states.
    pub(super) async fn next(&mut self) -> Result<(M, GUID), String> {
        match self.messages.next().await {
            Some(Ok(sample)) => {
                let writer = sample.sample_info().publication_handle();
                self.trust(writer)?;
                Ok((sample.into_value(), writer))
            }
            Some(Err(error)) => Err(format!("a message is no {}: {error}", M::TYPE)),
            // The stream of a reader has no end.
            None => std::future::pending().await,
        }
    }

    /// Compares the type of a writer with ours. The library does not, and the bytes of a twist are those of a wrench.
    fn trust(&mut self, writer: GUID) -> Result<(), String> {
        if self.trusted.contains(&writer) {
            return Ok(());
        }
        let writers = self.participant.discovered_writers().into_iter().map(|writer| writer.publication_topic_data);
        let kind = writers.filter(|data| data.key == writer).map(|data| ros_type(&data.type_name)).next();
        check_type(kind.as_deref(), M::TYPE)?;
        self.trusted.truncate(MAX_TRUSTED - 1);
        self.trusted.insert(0, writer);
        Ok(())
    }
}

/// Compares the type that a writer states with the one that is read.
fn check_type(stated: Option<&str>, read: &str) -> Result<(), String> {
    match stated {
        Some(stated) if stated == read => Ok(()),
        Some(stated) => Err(format!("a message of the type {stated}, and not {read}")),
        None => Err(format!("a message of a publisher that states no type, and not {read}")),
    }
}

impl<M: Message> Writer<M> {
    /// Sends a message. Returns whether it was taken.
    pub(super) fn send(&self, message: M) -> bool {
        self.writer.write(message, None).is_ok()
    }

    /// Waits until those who read reliably have all messages, but not longer than `patience`.
    #[cfg(all(feature = "cli", unix))]
    pub(super) fn settle(&self, patience: Duration) {
        // Who has not got them until then does not read.
        let _ = self.writer.wait_for_acknowledgments(patience);
    }

    /// Says why nobody gets the messages; `None` if somebody does.
    pub(super) fn why_unread(&mut self, domain: &Domain, name: &str) -> Option<String> {
        while let Some(status) = self.writer.try_recv_status() {
            match status {
                DataWriterStatus::PublicationMatched { current, .. } => self.readers = current.count(),
                DataWriterStatus::OfferedIncompatibleQos { last_policy_id, .. } => self.refused = Some(last_policy_id),
                DataWriterStatus::LivelinessLost { .. } | DataWriterStatus::OfferedDeadlineMissed { .. } => {}
            }
        }
        let (kind, readers) = (M::TYPE, domain.readers(name));
        let is_read = readers.iter().any(|reader| reader.kind == kind);
        // The library matches a reader of another type too, which gets nothing.
        if self.readers > 0 && is_read {
            return None;
        }
        Some(match (readers.first(), self.refused) {
            (Some(_), Some(policy)) if is_read => format!(
                "`{name}` is read, but its reader asks for another {policy:?} than commands have: they are reliable and \
                 volatile, with a depth of 1 and no deadline"
            ),
            (Some(_), _) if is_read => format!("the reader of `{name}` has not answered yet"),
            (Some(other), _) => format!("`{name}` is read as {}, and not as {kind}", other.kind),
            (None, _) => format!("nobody reads `{name}` {}", domain.who_reads(kind)),
        })
    }
}

/// A quality of service that never waits for a reader.
fn reliable(depth: i32) -> QosPolicyBuilder {
    QosPolicyBuilder::new()
        .reliability(Reliability::Reliable { max_blocking_time: rustdds::Duration::ZERO })
        .durability(Durability::Volatile)
        .history(History::KeepLast { depth })
}

/// Returns the name of a topic on the wire of DDS.
fn dds_name(name: &str) -> String {
    format!("rt{name}")
}

fn refused(name: &str, error: &dyn std::fmt::Debug) -> String {
    format!("the topic `{name}` cannot be used: {error:?}")
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;

    use super::super::message::{TwistStamped, WrenchStamped};
    use super::*;

    /// Returns what a reader of wrenches gets from a writer of another participant.
    async fn received<M: Message + Default>(topic: &str) -> Result<(), String> {
        let join = || Domain::join(99, Ipv4Addr::LOCALHOST.into()).unwrap();
        let (ours, other) = (join(), join());
        let mut reader = ours.read::<WrenchStamped>(topic).unwrap();
        let writer = other.write::<M>(topic, Duration::from_secs(1)).unwrap();
        let mut sending = tokio::time::interval(Duration::from_millis(20));
        let send = async {
            for _ in 0..500 {
                sending.tick().await;
                writer.send(M::default());
            }
        };
        tokio::select! {
            message = reader.next() => message.map(|_| ()),
            () = send => panic!("nothing arrives on {topic}"),
        }
    }

    #[tokio::test]
    async fn a_message_of_another_type_with_the_same_bytes_is_not_taken() {
        assert_eq!(received::<WrenchStamped>("/wrench").await, Ok(()));
        let expected = "a message of the type geometry_msgs/msg/TwistStamped, and not geometry_msgs/msg/WrenchStamped";
        assert_eq!(received::<TwistStamped>("/twist").await, Err(expected.to_owned()));
    }
}

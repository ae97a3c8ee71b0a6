//! The socket of a run in real time: other processes of the same user read its values, change its live parameters and
//! stop it.
//!
//! The tick writes what is wanted to a ring ([`Feed`]). It neither waits nor allocates nor calls the operating system. A
//! thread of its own reads the ring and talks to the clients, one line of JSON for each request and each answer
//! (docs/live.md). Each client has a bounded queue, so that a client that does not read loses samples and delays nobody.

mod asks;
mod client;
mod described;
mod feed;
mod folder;
mod follower;
mod frames;
mod hub;
mod lines;
mod server;

pub use asks::{About, Followed, ImageFacts, PortFacts, PortSample, RunEnd, TaskState};
pub use client::Following;
pub use described::RunFacts;
pub use feed::Feed;
pub use server::{OpenedSocket, RunSocket, open};

pub(crate) use asks::{Ask, Got, LiveState, Origin, PortState, WalkAnswer};
pub(crate) use client::{Client, Sample};
pub(crate) use folder::sockets;

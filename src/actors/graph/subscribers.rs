//! The subscribers of a topic, each with its subscriptions, their throttle and their encoding.
//!
//! **Invariant:** the encoding and the throttle of a subscriber are merged from all its subscriptions.

use std::sync::Arc;
use std::time::Duration;

use super::registrations::Entry;
use crate::actors::ConnectionId;
use crate::protocol::catalog::Topic;
use crate::protocol::op::{Compression, Encoding, Subscribe};
use crate::protocol::outbox::Throttle;
use crate::protocol::ros::stamps::is_ros1_name;

/// One `subscribe` of a connection to a topic. `id` distinguishes several of them.
#[derive(Debug)]
pub struct Subscription {
    /// The frame's `id`.
    pub id: Option<Box<str>>,
    throttle: Duration,
    queue_length: usize,
    encoding: Encoding,
    /// Its part of the client's limit [`MAX_REGISTERED`](super::registrations::MAX_REGISTERED).
    pub entry: Entry,
}

/// A connection that subscribes to a topic under one spelling.
pub struct Subscriber<M> {
    /// The connection.
    pub connection: ConnectionId,
    /// Its spelling of the topic. Its messages have this name.
    pub spelling: Arc<str>,
    /// The way to it.
    pub mailbox: M,
    /// The merged encoding of its subscriptions.
    pub encoding: Encoding,
    subscriptions: Vec<Subscription>,
}

impl Subscription {
    /// The subscription with this `id` of its frame. If it names the ROS 1 type of a topic of the runtime, stamps also
    /// have the names of ROS 1. CDR has no names.
    pub fn new(id: Option<Box<str>>, subscribe: &Subscribe, entry: Entry) -> Self {
        let own = Topic::from_name(&subscribe.topic).filter(|topic| !topic.is_subscribed());
        let mut asked = own.zip(subscribe.type_name.as_deref()).into_iter();
        let is_ros1 = asked.any(|(topic, asked)| is_ros1_name(asked, topic.type_name()));
        Self {
            id,
            throttle: subscribe.throttle,
            queue_length: subscribe.queue_length,
            encoding: Encoding {
                ros1_stamps: is_ros1 && subscribe.encoding.compression != Compression::CborRaw,
                ..subscribe.encoding
            },
            entry,
        }
    }
}

impl<M> Subscriber<M> {
    /// A subscriber without subscriptions.
    pub fn new(connection: ConnectionId, spelling: Arc<str>, mailbox: M) -> Self {
        Self {
            connection,
            spelling,
            mailbox,
            encoding: Encoding::default(),
            subscriptions: Vec::new(),
        }
    }

    /// The subscription with this `id`.
    pub fn subscription(&self, id: Option<&str>) -> Option<&Subscription> {
        let mut all = self.subscriptions.iter();
        all.find(|one| one.id.as_deref() == id)
    }

    /// Ends the subscriptions that `stays` rejects, and adds `new`, if there is one.
    pub fn change(&mut self, stays: impl FnMut(&Subscription) -> bool, new: Option<Subscription>) {
        self.subscriptions.retain(stays);
        self.subscriptions.extend(new);
        let all = self.subscriptions.iter().map(|one| one.encoding);
        self.encoding = all.reduce(Encoding::merged).unwrap_or_default();
    }

    /// The smallest of each value over its subscriptions. `None` if there are none.
    pub fn throttle(&self) -> Option<Throttle> {
        let all = &self.subscriptions;
        let queue_lengths = || all.iter().map(|one| one.queue_length);
        Some(Throttle {
            interval: all.iter().map(|one| one.throttle).min()?,
            held_back: queue_lengths().min()?.max(1),
            queue_length: queue_lengths().filter(|length| *length > 0).min(),
        })
    }
}

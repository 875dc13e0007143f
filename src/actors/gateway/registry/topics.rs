//! The registry's table of topics and their subscribers.
//!
//! **Invariant:** a connection stands at most once under a topic, however often it subscribed.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;

use super::kept::KeptEntry;
use crate::actors::ConnectionId;
use crate::actors::gateway::messages::{Deliver, Throttle};
use crate::protocol::names;
use crate::protocol::op::Encoding;

/// One `subscribe` of a connection to a topic; `id` tells several of them apart.
#[derive(Debug)]
pub(crate) struct Subscription {
    pub(crate) id: Option<Box<str>>,
    pub(crate) throttle: Duration,
    pub(crate) queue_length: usize,
    pub(crate) encoding: Encoding,
    /// The part of its client's room that it takes.
    pub(crate) entry: KeptEntry,
}

/// A connection under a topic.
pub(crate) struct Subscriber {
    pub(crate) connection: ConnectionId,
    pub(crate) outlet: Recipient<Deliver>,
    /// The encoding that its subscriptions come to.
    pub(crate) encoding: Encoding,
}

/// The smallest of each value over a connection's subscriptions to one topic; `None` for none.
pub(crate) fn throttle_of(subscriptions: &[Subscription]) -> Option<Throttle> {
    let queue_lengths = || subscriptions.iter().map(|one| one.queue_length);
    Some(Throttle {
        interval: subscriptions.iter().map(|one| one.throttle).min()?,
        held_back: queue_lengths().min()?.max(1),
        queue_length: queue_lengths().filter(|length| *length > 0).min(),
    })
}

/// The encoding that a connection's subscriptions to one topic come to.
fn encoding_of(subscriptions: &[Subscription]) -> Encoding {
    let all = subscriptions.iter().map(|one| one.encoding);
    all.reduce(Encoding::merged).unwrap_or_default()
}

/// Every topic that somebody subscribes to, by the spelling that the subscriber used.
#[derive(Default)]
pub(crate) struct Topics {
    subscribers: HashMap<Arc<str>, Vec<Subscriber>>,
}

impl Topics {
    /// Adds a subscriber under its spelling of the topic. Gives the spelling, shared, and whether that is new to this
    /// subscriber.
    pub(crate) fn add(
        &mut self,
        topic: &str,
        connection: ConnectionId,
        outlet: Recipient<Deliver>,
    ) -> (Arc<str>, bool) {
        let name = self
            .subscribers
            .get_key_value(topic)
            .map_or_else(|| Arc::from(topic), |(name, _)| Arc::clone(name));
        let subscribers = self.subscribers.entry(Arc::clone(&name)).or_default();
        let new = !subscribers.iter().any(|one| one.connection == connection);
        if new {
            subscribers.push(Subscriber {
                connection,
                outlet,
                encoding: Encoding::default(),
            });
        }
        (name, new)
    }

    /// Sets how a subscriber's messages are written, by what its subscriptions come to.
    pub(crate) fn configure(
        &mut self,
        topic: &Arc<str>,
        connection: ConnectionId,
        subscriptions: &[Subscription],
    ) {
        let subscribers = self.subscribers.get_mut(topic).into_iter().flatten();
        for subscriber in subscribers.filter(|one| one.connection == connection) {
            subscriber.encoding = encoding_of(subscriptions);
        }
    }

    /// Removes a subscriber.
    pub(crate) fn remove(&mut self, topic: &Arc<str>, connection: ConnectionId) {
        let Entry::Occupied(mut entry) = self.subscribers.entry(Arc::clone(topic)) else {
            return;
        };
        entry.get_mut().retain(|one| one.connection != connection);
        if entry.get().is_empty() {
            entry.remove();
        }
    }

    /// Whether anybody subscribes to the topic of that absolute name, under whichever spelling.
    pub(crate) fn has_subscribers(&self, topic: &str) -> bool {
        names::spellings(topic).any(|spelling| self.subscribers.contains_key(spelling))
    }

    /// A spelling, shared, and those who subscribed with it, if there are any.
    pub(crate) fn subscribers(&self, topic: &str) -> Option<(&Arc<str>, &[Subscriber])> {
        self.subscribers
            .get_key_value(topic)
            .map(|(name, list)| (name, list.as_slice()))
    }
}

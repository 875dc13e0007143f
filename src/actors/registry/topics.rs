//! Who subscribes to what: the registry's table of topics.
//!
//! **Invariant:** a connection stands at most once under a topic, however often it subscribed.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;

use crate::actors::ConnectionId;
use crate::actors::budget::Share;
use crate::actors::connection::Deliver;
use crate::protocol::names;
use crate::protocol::op::Encoding;

/// One `subscribe` of a connection to a topic; `id` tells several of them apart.
#[derive(Debug)]
pub(super) struct Subscription {
    pub(super) id: Option<Box<str>>,
    pub(super) throttle: Duration,
    pub(super) queue_length: usize,
    pub(super) encoding: Encoding,
    /// What it takes of the total of names.
    pub(super) _share: Share,
}

/// What a connection's subscriptions to one topic come to: the smallest of each value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Throttle {
    /// Least time between two deliveries; zero is no limit.
    pub interval: Duration,
    /// How many messages may be held back, newest kept; at least 1.
    pub queue_length: usize,
}

impl Throttle {
    /// The smallest of each over `subscriptions`; `None` for none.
    pub(super) fn of(subscriptions: &[Subscription]) -> Option<Self> {
        Some(Self {
            interval: subscriptions.iter().map(|one| one.throttle).min()?,
            queue_length: subscriptions
                .iter()
                .map(|one| one.queue_length.max(1))
                .min()?,
        })
    }
}

/// A connection under a topic.
pub(super) struct Subscriber {
    pub(super) connection: ConnectionId,
    pub(super) outlet: Recipient<Deliver>,
    /// What its subscriptions come to.
    pub(super) encoding: Encoding,
    /// Whether some of its messages are held back or left out.
    pub(super) throttled: bool,
}

/// What a connection's subscriptions to one topic come to.
fn encoding_of(subscriptions: &[Subscription]) -> Encoding {
    let all = subscriptions.iter().map(|one| one.encoding);
    all.reduce(Encoding::merged).unwrap_or_default()
}

/// Every topic that somebody subscribes to, by the spelling that the subscriber used.
#[derive(Default)]
pub(super) struct Topics {
    subscribers: HashMap<Arc<str>, Vec<Subscriber>>,
}

impl Topics {
    /// Adds a subscriber under its spelling of the topic. Gives the spelling, shared, and whether that is new to this subscriber.
    pub(super) fn add(
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
                throttled: false,
            });
        }
        (name, new)
    }

    /// Sets how a subscriber's messages are written, by what its subscriptions come to.
    pub(super) fn configure(
        &mut self,
        topic: &Arc<str>,
        connection: ConnectionId,
        subscriptions: &[Subscription],
    ) {
        let subscribers = self.subscribers.get_mut(topic).into_iter().flatten();
        for subscriber in subscribers.filter(|one| one.connection == connection) {
            subscriber.encoding = encoding_of(subscriptions);
            let throttle = Throttle::of(subscriptions);
            subscriber.throttled = throttle.is_some_and(|throttle| !throttle.interval.is_zero());
        }
    }

    /// Removes a subscriber.
    pub(super) fn remove(&mut self, topic: &Arc<str>, connection: ConnectionId) {
        let Entry::Occupied(mut entry) = self.subscribers.entry(Arc::clone(topic)) else {
            return;
        };
        entry.get_mut().retain(|one| one.connection != connection);
        if entry.get().is_empty() {
            entry.remove();
        }
    }

    /// Whether anybody subscribes to the topic of that absolute name, under whichever spelling.
    pub(super) fn has_subscribers(&self, topic: &str) -> bool {
        names::spellings(topic).any(|spelling| self.subscribers.contains_key(spelling))
    }

    /// A spelling, shared, and those who subscribed with it, if there are any.
    pub(super) fn subscribers(&self, topic: &str) -> Option<(&Arc<str>, &[Subscriber])> {
        self.subscribers
            .get_key_value(topic)
            .map(|(name, list)| (name, list.as_slice()))
    }
}

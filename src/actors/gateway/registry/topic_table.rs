//! The table of topics: the clients that use each topic, and their subscriptions.
//!
//! **Invariant:** the table has a topic exactly as long as a client uses it. It has a connection at most once for each
//! spelling of a topic, with any number of subscriptions.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;

use super::kept::KeptEntry;
use super::mailbox::ToClient;
use crate::actors::ConnectionId;
use crate::protocol::catalog::types::{self, Type};
use crate::protocol::op::Encoding;
use crate::protocol::outbox::Throttle;
use crate::protocol::ros::rosapi::Listed;

/// One `subscribe` of a connection to a topic. `id` distinguishes several of them.
#[derive(Debug)]
pub(super) struct Subscription {
    pub(super) id: Option<Box<str>>,
    pub(super) throttle: Duration,
    pub(super) queue_length: usize,
    pub(super) encoding: Encoding,
    /// Its part of the client's limit [`MAX_KEPT`](crate::actors::gateway::limits::MAX_KEPT).
    pub(super) entry: KeptEntry,
}

/// The topics, by their absolute names.
#[derive(Default)]
pub(super) struct Topics {
    by_name: BTreeMap<Arc<str>, TopicUsers>,
}

/// Clients that use a topic.
#[derive(Default)]
struct TopicUsers {
    publishers: usize,
    subscribers: Vec<Subscriber>,
    /// The first type that a client named.
    type_name: Option<Arc<str>>,
    /// The first known type that a client named. Messages are encoded by it.
    known: Option<Type>,
}

/// A connection that subscribes to a topic under one spelling.
pub(super) struct Subscriber {
    pub(super) connection: ConnectionId,
    /// Its spelling of the topic. Its messages have this name.
    pub(super) spelling: Arc<str>,
    pub(super) mailbox: Recipient<ToClient>,
    /// The merged encoding of its subscriptions.
    pub(super) encoding: Encoding,
    subscriptions: Vec<Subscription>,
}

impl Subscriber {
    /// The subscription with this `id`.
    pub(super) fn subscription(&self, id: Option<&str>) -> Option<&Subscription> {
        let mut all = self.subscriptions.iter();
        all.find(|one| one.id.as_deref() == id)
    }

    /// Ends the subscriptions that `stays` rejects, and adds `new`, if there is one.
    pub(super) fn change(
        &mut self,
        stays: impl FnMut(&Subscription) -> bool,
        new: Option<Subscription>,
    ) {
        self.subscriptions.retain(stays);
        self.subscriptions.extend(new);
        let all = self.subscriptions.iter().map(|one| one.encoding);
        self.encoding = all.reduce(Encoding::merged).unwrap_or_default();
    }

    /// The smallest of each value over its subscriptions. `None` if there are none.
    pub(super) fn throttle(&self) -> Option<Throttle> {
        let all = &self.subscriptions;
        let queue_lengths = || all.iter().map(|one| one.queue_length);
        Some(Throttle {
            interval: all.iter().map(|one| one.throttle).min()?,
            held_back: queue_lengths().min()?.max(1),
            queue_length: queue_lengths().filter(|length| *length > 0).min(),
        })
    }

    /// Sends the topic's throttle to the connection.
    pub(super) fn configure(&self, throttle: Option<Throttle>) {
        self.mailbox.do_send(ToClient::Configure {
            topic: Arc::clone(&self.spelling),
            throttle,
        });
    }
}

impl Topics {
    /// A client has begun to advertise a topic.
    pub(super) fn add_publisher(&mut self, topic: &str) {
        self.by_name.entry(topic.into()).or_default().publishers += 1;
    }

    /// A client has begun to subscribe to a topic under a spelling.
    pub(super) fn add_subscriber(
        &mut self,
        topic: &str,
        spelling: Arc<str>,
        connection: ConnectionId,
        mailbox: Recipient<ToClient>,
    ) {
        let users = self.by_name.entry(topic.into()).or_default();
        users.subscribers.push(Subscriber {
            connection,
            spelling,
            mailbox,
            encoding: Encoding::default(),
            subscriptions: Vec::new(),
        });
    }

    /// A client that uses a topic has named its type. Returns whether it is the topic's first type.
    pub(super) fn note_type(&mut self, topic: &str, type_name: &str) -> bool {
        let Some(users) = self.by_name.get_mut(topic) else {
            return false;
        };
        if users.known.is_none() {
            users.known = types::find(type_name);
        }
        let is_first = users.type_name.is_none();
        users.type_name.get_or_insert_with(|| type_name.into());
        is_first
    }

    /// A client has stopped advertising a topic.
    pub(super) fn remove_publisher(&mut self, topic: &str) {
        self.remove(topic, |users| {
            users.publishers = users.publishers.saturating_sub(1);
        });
    }

    /// A client has stopped subscribing to a topic under this spelling.
    pub(super) fn remove_subscriber(&mut self, topic: &str, spelling: &str, client: ConnectionId) {
        self.remove(topic, |users| {
            users
                .subscribers
                .retain(|one| one.connection != client || *one.spelling != *spelling);
        });
    }

    fn remove(&mut self, topic: &str, change: impl FnOnce(&mut TopicUsers)) {
        let Some(users) = self.by_name.get_mut(topic) else {
            debug_assert!(false, "{topic} was not counted");
            return;
        };
        change(users);
        if users.publishers == 0 && users.subscribers.is_empty() {
            self.by_name.remove(topic);
        }
    }

    /// The subscribers to a topic, under all its spellings.
    pub(super) fn subscribers(&self, topic: &str) -> &[Subscriber] {
        let users = self.by_name.get(topic);
        users.map_or(&[], |users| &users.subscribers)
    }

    /// The client that subscribes to a topic under this spelling.
    pub(super) fn subscriber(
        &mut self,
        topic: &str,
        spelling: &str,
        client: ConnectionId,
    ) -> Option<&mut Subscriber> {
        let mut all = self.by_name.get_mut(topic)?.subscribers.iter_mut();
        all.find(|one| one.connection == client && *one.spelling == *spelling)
    }

    /// The type of a topic, if a client has named a known type.
    pub(super) fn known_type(&self, topic: &str) -> Option<Type> {
        self.by_name.get(topic)?.known
    }

    /// The topics in the form of rosapi.
    pub(super) fn listed(&self) -> impl Iterator<Item = Listed> {
        self.by_name.iter().map(|(name, users)| Listed {
            name: Arc::clone(name),
            type_name: users.type_name.clone(),
            published: users.publishers > 0,
            subscribed: !users.subscribers.is_empty(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_type_stays_with_a_topic_and_a_topic_with_its_last_user() {
        let mut topics = Topics::default();
        topics.add_publisher("/t");
        topics.add_publisher("/t");
        assert!(topics.note_type("/t", "a/b") && !topics.note_type("/t", "c/d"));
        for _ in 0..2 {
            let listed: Vec<Listed> = topics.listed().collect();
            let one = Listed {
                name: "/t".into(),
                type_name: Some("a/b".into()),
                published: true,
                subscribed: false,
            };
            assert_eq!(listed, [one]);
            topics.remove_publisher("/t");
        }
        assert_eq!(topics.listed().count(), 0);
        assert!(!topics.note_type("/t", "a/b"));
    }
}

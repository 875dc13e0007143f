//! The topics that clients use: their publishers and their subscribers.
//!
//! **Invariant:** the table has a topic exactly as long as a client publishes or subscribes to it. Subscribers keep the
//! order of their subscriptions.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::subscribers::Subscriber;
use crate::actors::ConnectionId;
use crate::protocol::catalog::Topic;
use crate::protocol::catalog::types::{self, Type};
use crate::protocol::names;
use crate::protocol::ros::rosapi::Listed;

/// The topics, by their absolute names. `M` is the mailbox of a subscriber.
pub struct Topics<M> {
    by_name: BTreeMap<Arc<str>, TopicUsers<M>>,
}

/// Clients that use a topic.
struct TopicUsers<M> {
    publishers: usize,
    subscribers: Vec<Subscriber<M>>,
    /// The first type that a client named.
    type_name: Option<Arc<str>>,
    /// The first known type that a client named. Messages are encoded by it.
    known: Option<Type>,
}

impl<M> Default for Topics<M> {
    fn default() -> Self {
        let by_name = BTreeMap::new();
        Self { by_name }
    }
}

impl<M> Default for TopicUsers<M> {
    fn default() -> Self {
        Self {
            publishers: 0,
            subscribers: Vec::new(),
            type_name: None,
            known: None,
        }
    }
}

impl<M> Topics<M> {
    /// A client has begun to advertise a topic.
    pub fn add_publisher(&mut self, topic: &str) {
        self.by_name.entry(topic.into()).or_default().publishers += 1;
    }

    /// A client has begun to subscribe to a topic under a spelling.
    pub fn add_subscriber(
        &mut self,
        topic: &str,
        spelling: Arc<str>,
        connection: ConnectionId,
        mailbox: M,
    ) {
        let users = self.by_name.entry(topic.into()).or_default();
        let subscriber = Subscriber::new(connection, spelling, mailbox);
        users.subscribers.push(subscriber);
    }

    /// A client that uses a topic has named its type.
    pub fn note_type(&mut self, topic: &str, type_name: &str) {
        if let Some(users) = self.by_name.get_mut(topic) {
            users.known = users.known.or_else(|| types::find(type_name));
            users.type_name.get_or_insert_with(|| type_name.into());
        }
    }

    /// A client has stopped advertising a topic.
    pub fn remove_publisher(&mut self, topic: &str) {
        self.remove(topic, |users| {
            users.publishers = users.publishers.saturating_sub(1);
        });
    }

    /// A client has stopped subscribing to a topic under this spelling.
    pub fn remove_subscriber(&mut self, topic: &str, spelling: &str, client: ConnectionId) {
        self.remove(topic, |users| {
            users
                .subscribers
                .retain(|one| one.connection != client || *one.spelling != *spelling);
        });
    }

    fn remove(&mut self, topic: &str, change: impl FnOnce(&mut TopicUsers<M>)) {
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
    pub fn subscribers(&self, topic: &str) -> &[Subscriber<M>] {
        let users = self.by_name.get(topic);
        users.map_or(&[], |users| &users.subscribers)
    }

    /// The client that subscribes to a topic under this spelling.
    pub fn subscriber(
        &mut self,
        topic: &str,
        spelling: &str,
        client: ConnectionId,
    ) -> Option<&mut Subscriber<M>> {
        let mut all = self.by_name.get_mut(topic)?.subscribers.iter_mut();
        all.find(|one| one.connection == client && *one.spelling == *spelling)
    }

    /// The type of a topic's messages: the runtime's own, or a known type that a client has named.
    pub fn known_type(&self, topic: &str) -> Option<&'static str> {
        match Topic::from_name(topic) {
            Some(topic) => Some(topic.type_name()),
            None => Some(self.by_name.get(&*names::absolute(topic))?.known?.name),
        }
    }

    /// The topics in the form of rosapi.
    pub fn listed(&self) -> impl Iterator<Item = Listed> {
        self.by_name.iter().map(|(name, users)| Listed {
            name: Arc::clone(name),
            type_name: users.type_name.clone(),
            published: users.publishers > 0,
            subscribed: !users.subscribers.is_empty(),
        })
    }
}

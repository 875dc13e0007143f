//! Topics and services that clients have, kept in order of their names, so that telling them costs no search.
//!
//! **Invariant:** a topic stands here as long as a client advertises it or subscribes to it, and no longer.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::protocol::catalog::types::{self, Type};
use crate::protocol::ros::rosapi::{Census, ListedService, ListedTopic, MAX_LISTED};

/// How a client uses a topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Use {
    Advertised,
    Subscribed,
}

/// The tallies. Names are shared with whoever asks for them: a list of thousands costs no copies.
#[derive(Default)]
pub(super) struct Tally {
    topics: BTreeMap<Arc<str>, Users>,
    services: BTreeMap<Arc<str>, Option<Arc<str>>>,
    actions: BTreeMap<Arc<str>, Option<Arc<str>>>,
}

/// Who uses a topic.
#[derive(Default)]
struct Users {
    publishers: usize,
    subscribers: usize,
    /// As the first that named one has it.
    type_name: Option<Arc<str>>,
    /// The first that was named and is known: messages are encoded by it.
    known: Option<Type>,
}

impl Users {
    fn count(&mut self, how: Use) -> &mut usize {
        match how {
            Use::Advertised => &mut self.publishers,
            Use::Subscribed => &mut self.subscribers,
        }
    }

    /// Somebody has named a type; true if it stays with the topic.
    fn note(&mut self, type_name: &str) -> bool {
        if self.known.is_none() {
            self.known = types::find(type_name);
        }
        let is_first = self.type_name.is_none();
        if is_first {
            self.type_name = Some(type_name.into());
        }
        is_first
    }
}

impl Tally {
    /// A client has begun to use a topic.
    pub(super) fn add(&mut self, topic: &str, how: Use, type_name: Option<&str>) {
        if !self.topics.contains_key(topic) {
            self.topics.insert(topic.into(), Users::default());
        }
        if let Some(users) = self.topics.get_mut(topic) {
            *users.count(how) += 1;
            if let Some(type_name) = type_name {
                users.note(type_name);
            }
        }
    }

    /// A client that uses a topic already has named its type; true if that stays with the topic.
    pub(super) fn note_type(&mut self, topic: &str, type_name: &str) -> bool {
        let users = self.topics.get_mut(topic);
        users.is_some_and(|users| users.note(type_name))
    }

    /// A client has ceased to use a topic in this way.
    pub(super) fn remove(&mut self, topic: &str, how: Use) {
        let Some(users) = self.topics.get_mut(topic) else {
            debug_assert!(false, "{topic} was not counted");
            return;
        };
        let count = users.count(how);
        *count = count.saturating_sub(1);
        if users.publishers == 0 && users.subscribers == 0 {
            self.topics.remove(topic);
        }
    }

    /// The type of a topic that clients use, if one has named it and it is known.
    pub(super) fn known_type(&self, topic: &str) -> Option<Type> {
        self.topics.get(topic)?.known
    }

    /// A client provides a service.
    pub(super) fn provide(&mut self, service: &str, type_name: Option<&str>) {
        self.services
            .insert(service.into(), type_name.map(Into::into));
    }

    /// Nobody provides it any more.
    pub(super) fn withdraw(&mut self, service: &str) {
        self.services.remove(service);
    }

    /// A client pursues an action.
    pub(super) fn pursue(&mut self, action: &str, type_name: Option<&str>) {
        self.actions
            .insert(action.into(), type_name.map(Into::into));
    }

    /// Nobody pursues it any more.
    pub(super) fn drop_action(&mut self, action: &str) {
        self.actions.remove(action);
    }

    /// All that there is, up to the limit of what is listed.
    pub(super) fn census(&self) -> Census {
        let topics = self.topics.iter().take(MAX_LISTED);
        let listed = |(name, type_name): (&Arc<str>, &Option<Arc<str>>)| ListedService {
            name: Arc::clone(name),
            type_name: type_name.clone(),
        };
        Census {
            topics: topics
                .map(|(name, users)| ListedTopic {
                    name: Arc::clone(name),
                    type_name: users.type_name.clone(),
                    published: users.publishers > 0,
                    subscribed: users.subscribers > 0,
                })
                .collect(),
            services: self.services.iter().take(MAX_LISTED).map(listed).collect(),
            actions: self.actions.iter().take(MAX_LISTED).map(listed).collect(),
            replayed: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn so_many_topics_and_services_are_listed_and_no_more() {
        let mut tally = Tally::default();
        for n in 0..=MAX_LISTED {
            tally.add(&format!("/{n:05}"), Use::Advertised, None);
            tally.provide(&format!("/{n:05}"), None);
        }
        let census = tally.census();
        assert_eq!(
            (census.topics.len(), census.services.len()),
            (MAX_LISTED, MAX_LISTED)
        );
        tally.remove("/00000", Use::Advertised);
        assert_eq!(
            &*tally.census().topics[MAX_LISTED - 1].name,
            format!("/{MAX_LISTED:05}")
        );
    }
}

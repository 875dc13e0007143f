//! Topics and services that clients have, kept in order of their names, so that telling them costs no search.
//!
//! **Invariant:** a topic stands here as long as a client advertises it or subscribes to it, and no longer.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::protocol::catalog::types::{self, Type};
use crate::protocol::ros::rosapi::{Census, ListedService, ListedTopic, MAX_LISTED};

/// How a client uses a topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Use {
    Advertised,
    Subscribed,
}

/// The tallies. Entries are shared with whoever asks for them: a list of thousands costs no copies.
#[derive(Default)]
pub(crate) struct Tally {
    topics: BTreeMap<Arc<str>, Users>,
    services: BTreeMap<Arc<str>, Arc<ListedService>>,
    actions: BTreeMap<Arc<str>, Arc<ListedService>>,
    /// The last census, if nothing has changed since.
    taken: Option<Arc<Census>>,
}

/// Clients that use a topic.
struct Users {
    publishers: usize,
    subscribers: usize,
    /// The first type that was named and is known: messages are encoded by it.
    known: Option<Type>,
    /// The topic as rosapi lists it, with the first type that was named.
    listed: Arc<ListedTopic>,
}

impl Users {
    fn of(topic: &Arc<str>) -> Self {
        Self {
            publishers: 0,
            subscribers: 0,
            known: None,
            listed: Arc::new(ListedTopic {
                name: Arc::clone(topic),
                type_name: None,
                published: false,
                subscribed: false,
            }),
        }
    }

    fn count(&mut self, how: Use, change: impl FnOnce(&mut usize)) {
        match how {
            Use::Advertised => change(&mut self.publishers),
            Use::Subscribed => change(&mut self.subscribers),
        }
        let (published, subscribed) = (self.publishers > 0, self.subscribers > 0);
        if (self.listed.published, self.listed.subscribed) != (published, subscribed) {
            let listed = Arc::make_mut(&mut self.listed);
            (listed.published, listed.subscribed) = (published, subscribed);
        }
    }

    /// Somebody has named a type; true if it stays with the topic.
    fn note(&mut self, type_name: &str) -> bool {
        if self.known.is_none() {
            self.known = types::find(type_name);
        }
        let is_first = self.listed.type_name.is_none();
        if is_first {
            Arc::make_mut(&mut self.listed).type_name = Some(type_name.into());
        }
        is_first
    }
}

impl Tally {
    /// A client has begun to use a topic.
    pub(crate) fn add(&mut self, topic: &str, how: Use, type_name: Option<&str>) {
        self.taken = None;
        if !self.topics.contains_key(topic) {
            let name = Arc::from(topic);
            let users = Users::of(&name);
            self.topics.insert(name, users);
        }
        if let Some(users) = self.topics.get_mut(topic) {
            users.count(how, |count| *count += 1);
            if let Some(type_name) = type_name {
                users.note(type_name);
            }
        }
    }

    /// A client that uses a topic already has named its type; true if that stays with the topic.
    pub(crate) fn note_type(&mut self, topic: &str, type_name: &str) -> bool {
        let users = self.topics.get_mut(topic);
        let is_noted = users.is_some_and(|users| users.note(type_name));
        if is_noted {
            self.taken = None;
        }
        is_noted
    }

    /// A client has ceased to use a topic in this way.
    pub(crate) fn remove(&mut self, topic: &str, how: Use) {
        self.taken = None;
        let Some(users) = self.topics.get_mut(topic) else {
            debug_assert!(false, "{topic} was not counted");
            return;
        };
        users.count(how, |count| *count = count.saturating_sub(1));
        if users.publishers == 0 && users.subscribers == 0 {
            self.topics.remove(topic);
        }
    }

    /// The type of a topic that clients use, if one has named it and it is known.
    pub(crate) fn known_type(&self, topic: &str) -> Option<Type> {
        self.topics.get(topic)?.known
    }

    /// A client provides a service.
    pub(crate) fn provide(&mut self, service: &str, type_name: Option<&str>) {
        self.taken = None;
        let listed = listed(service, type_name);
        self.services.insert(Arc::clone(&listed.name), listed);
    }

    /// Notes that nobody provides the service any more.
    pub(crate) fn withdraw(&mut self, service: &str) {
        self.taken = None;
        self.services.remove(service);
    }

    /// A client serves an action.
    pub(crate) fn serve_action(&mut self, action: &str, type_name: Option<&str>) {
        self.taken = None;
        let listed = listed(action, type_name);
        self.actions.insert(Arc::clone(&listed.name), listed);
    }

    /// Notes that nobody serves the action any more.
    pub(crate) fn drop_action(&mut self, action: &str) {
        self.taken = None;
        self.actions.remove(action);
    }

    /// Topics and services, up to the limit of what is listed; none if there are more than `at_most`. The list is made
    /// anew only if something has changed.
    pub(crate) fn census(&mut self, at_most: usize) -> Option<Arc<Census>> {
        if self.topics.len() + self.services.len() + self.actions.len() > at_most {
            return None;
        }
        let census = self.taken.take().unwrap_or_else(|| Arc::new(self.count()));
        self.taken = Some(Arc::clone(&census));
        Some(census)
    }

    fn count(&self) -> Census {
        let topics = self.topics.values().map(|users| &users.listed);
        let (services, actions) = (self.services.values(), self.actions.values());
        Census {
            topics: topics.take(MAX_LISTED).cloned().collect(),
            services: services.take(MAX_LISTED).cloned().collect(),
            actions: actions.take(MAX_LISTED).cloned().collect(),
        }
    }
}

fn listed(name: &str, type_name: Option<&str>) -> Arc<ListedService> {
    Arc::new(ListedService {
        name: name.into(),
        type_name: type_name.map(Into::into),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn whole(tally: &mut Tally) -> Arc<Census> {
        tally.census(usize::MAX).unwrap()
    }

    #[test]
    fn so_many_topics_and_services_are_listed_and_no_more() {
        let mut tally = Tally::default();
        for n in 0..=MAX_LISTED {
            tally.add(&format!("/{n:05}"), Use::Advertised, None);
            tally.provide(&format!("/{n:05}"), None);
        }
        let census = whole(&mut tally);
        assert_eq!(
            (census.topics.len(), census.services.len()),
            (MAX_LISTED, MAX_LISTED)
        );
        tally.remove("/00000", Use::Advertised);
        assert_eq!(
            &*whole(&mut tally).topics[MAX_LISTED - 1].name,
            format!("/{MAX_LISTED:05}")
        );
    }

    #[test]
    fn a_census_is_shared_until_something_changes_and_none_is_made_of_more_than_is_wanted() {
        let mut tally = Tally::default();
        assert_eq!(*tally.census(0).unwrap(), Census::default());
        let changes: [fn(&mut Tally); 9] = [
            |tally| tally.add("/t", Use::Subscribed, None),
            |tally| assert!(tally.note_type("/t", "a/b")),
            |tally| tally.add("/t", Use::Advertised, Some("c/d")),
            |tally| tally.remove("/t", Use::Subscribed),
            |tally| tally.provide("/s", None),
            |tally| tally.provide("/s", Some("a/b")),
            |tally| tally.serve_action("/a", None),
            |tally| tally.withdraw("/s"),
            |tally| tally.drop_action("/a"),
        ];
        for (n, change) in changes.into_iter().enumerate() {
            let before = whole(&mut tally);
            assert!(Arc::ptr_eq(&before, &whole(&mut tally)));
            change(&mut tally);
            assert_ne!(*before, *whole(&mut tally), "change {n}");
            assert!(tally.census(0).is_none());
        }
        let census = whole(&mut tally);
        let topic = &census.topics[0];
        assert_eq!(topic.type_name.as_deref(), Some("a/b"));
        assert!(topic.published && !topic.subscribed);
    }
}

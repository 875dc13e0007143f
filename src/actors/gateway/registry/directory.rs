//! The names that clients have registered: topics that they use, services and actions that they serve. They are kept in
//! order, so that telling them costs no search.
//!
//! **Invariant:** a name is here exactly as long as a client has it registered.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::actors::ConnectionId;
use crate::protocol::catalog::types::{self, Type};
use crate::protocol::ros::rosapi::{Census, ListedService, ListedTopic, MAX_LISTED};

/// How a client uses a topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Use {
    Advertised,
    Subscribed,
}

/// What a client may serve to others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Served {
    Service,
    Action,
}

impl Served {
    /// The word for it.
    pub(crate) const fn noun(self) -> &'static str {
        match self {
            Self::Service => "service",
            Self::Action => "action",
        }
    }

    /// What its provider does.
    pub(crate) const fn verb(self) -> &'static str {
        match self {
            Self::Service => "provide",
            Self::Action => "serve",
        }
    }

    /// What comes to its provider.
    pub(crate) const fn request(self) -> &'static str {
        match self {
            Self::Service => "call",
            Self::Action => "goal",
        }
    }
}

/// The names, each with all that is known of it. Listed entries are shared with each census.
#[derive(Default)]
pub(crate) struct Directory {
    topics: BTreeMap<Arc<str>, Users>,
    services: BTreeMap<Arc<str>, Provider>,
    actions: BTreeMap<Arc<str>, Provider>,
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

/// The client that serves a service or an action.
#[derive(Clone)]
pub(crate) struct Provider {
    pub(crate) connection: ConnectionId,
    /// The name as the provider spells it: it is called by that.
    pub(crate) spelling: Box<str>,
    listed: Arc<ListedService>,
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

impl Directory {
    /// A client has begun to use a topic.
    pub(crate) fn add(&mut self, topic: &str, how: Use, type_name: Option<&str>) {
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
        users.is_some_and(|users| users.note(type_name))
    }

    /// A client has ceased to use a topic in this way.
    pub(crate) fn remove(&mut self, topic: &str, how: Use) {
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

    fn served(&mut self, kind: Served) -> &mut BTreeMap<Arc<str>, Provider> {
        match kind {
            Served::Service => &mut self.services,
            Served::Action => &mut self.actions,
        }
    }

    /// Makes a client the provider of `name`; the newest registration wins. Returns the provider before it.
    pub(crate) fn provide(
        &mut self,
        kind: Served,
        name: &str,
        (connection, spelling): (ConnectionId, &str),
        type_name: Option<&str>,
    ) -> Option<ConnectionId> {
        let listed = Arc::new(ListedService {
            name: name.into(),
            type_name: type_name.map(Into::into),
        });
        let provider = Provider {
            connection,
            spelling: spelling.into(),
            listed: Arc::clone(&listed),
        };
        let before = self
            .served(kind)
            .insert(Arc::clone(&listed.name), provider)?;
        Some(before.connection)
    }

    pub(crate) fn provider(&self, kind: Served, name: &str) -> Option<&Provider> {
        match kind {
            Served::Service => self.services.get(name),
            Served::Action => self.actions.get(name),
        }
    }

    /// Withdraws a name if `connection` is its provider; true if it was.
    pub(crate) fn withdraw(&mut self, kind: Served, name: &str, connection: ConnectionId) -> bool {
        let is_ours = |one: &Provider| one.connection == connection;
        let is_served = self.provider(kind, name).is_some_and(is_ours);
        if is_served {
            self.served(kind).remove(name);
        }
        is_served
    }

    /// All names, up to the limit of a list; none if there are more than `at_most`.
    pub(crate) fn census(&self, at_most: usize) -> Option<Census> {
        if self.topics.len() + self.services.len() + self.actions.len() > at_most {
            return None;
        }
        let listed = |all: &BTreeMap<Arc<str>, Provider>| {
            let all = all.values().take(MAX_LISTED);
            all.map(|one| Arc::clone(&one.listed)).collect()
        };
        let topics = self.topics.values().take(MAX_LISTED);
        Some(Census {
            topics: topics.map(|users| Arc::clone(&users.listed)).collect(),
            services: listed(&self.services),
            actions: listed(&self.actions),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLIENT: ConnectionId = ConnectionId(1);

    fn whole(directory: &Directory) -> Census {
        directory.census(usize::MAX).unwrap()
    }

    fn provide(directory: &mut Directory, kind: Served, name: &str, type_name: Option<&str>) {
        directory.provide(kind, name, (CLIENT, name), type_name);
    }

    #[test]
    fn so_many_topics_and_services_are_listed_and_no_more() {
        let mut directory = Directory::default();
        for n in 0..=MAX_LISTED {
            directory.add(&format!("/{n:05}"), Use::Advertised, None);
            provide(&mut directory, Served::Service, &format!("/{n:05}"), None);
        }
        let census = whole(&directory);
        assert_eq!(
            (census.topics.len(), census.services.len()),
            (MAX_LISTED, MAX_LISTED)
        );
        directory.remove("/00000", Use::Advertised);
        assert_eq!(
            &*whole(&directory).topics[MAX_LISTED - 1].name,
            format!("/{MAX_LISTED:05}")
        );
    }

    #[test]
    fn a_census_shows_every_change_and_none_is_made_of_more_than_is_wanted() {
        let mut directory = Directory::default();
        assert_eq!(directory.census(0).unwrap(), Census::default());
        let changes: [fn(&mut Directory); 9] = [
            |directory| directory.add("/t", Use::Subscribed, None),
            |directory| assert!(directory.note_type("/t", "a/b")),
            |directory| directory.add("/t", Use::Advertised, Some("c/d")),
            |directory| directory.remove("/t", Use::Subscribed),
            |directory| provide(directory, Served::Service, "/s", None),
            |directory| provide(directory, Served::Service, "/s", Some("a/b")),
            |directory| provide(directory, Served::Action, "/a", None),
            |directory| assert!(directory.withdraw(Served::Service, "/s", CLIENT)),
            |directory| assert!(directory.withdraw(Served::Action, "/a", CLIENT)),
        ];
        for (n, change) in changes.into_iter().enumerate() {
            let before = whole(&directory);
            change(&mut directory);
            assert_ne!(before, whole(&directory), "change {n}");
            assert!(directory.census(0).is_none());
        }
        let census = whole(&directory);
        let topic = &census.topics[0];
        assert_eq!(topic.type_name.as_deref(), Some("a/b"));
        assert!(topic.published && !topic.subscribed);
    }
}

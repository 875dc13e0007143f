//! The names that clients serve to others: services and actions. They are kept in order, and so are the topics, so that
//! telling them costs no search.
//!
//! **Invariant:** a name is here exactly as long as a client has it registered.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::actors::ConnectionId;
use crate::protocol::ros::rosapi::{Census, ListedService, ListedTopic, MAX_LISTED};

/// What a client may serve to others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
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

/// The services and actions by their absolute names, each with all that is known of it.
#[derive(Default)]
pub(crate) struct Directory {
    services: BTreeMap<Arc<str>, Provider>,
    actions: BTreeMap<Arc<str>, Provider>,
}

/// The client that serves a service or an action.
#[derive(Clone)]
pub(crate) struct Provider {
    pub(crate) connection: ConnectionId,
    /// The name as the provider spells it: it is called by that.
    pub(crate) spelling: Box<str>,
    type_name: Option<Arc<str>>,
}

impl Directory {
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
        let provider = Provider {
            connection,
            spelling: spelling.into(),
            type_name: type_name.map(Into::into),
        };
        let before = self.served(kind).insert(name.into(), provider)?;
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

    /// These and the topics, up to the limit of a list; none if there are more than `at_most`.
    pub(crate) fn census(
        &self,
        topics: impl ExactSizeIterator<Item = ListedTopic>,
        at_most: usize,
    ) -> Option<Census> {
        if topics.len() + self.services.len() + self.actions.len() > at_most {
            return None;
        }
        let listed = |all: &BTreeMap<Arc<str>, Provider>| {
            let all = all.iter().take(MAX_LISTED);
            let all = all.map(|(name, one)| ListedService {
                name: Arc::clone(name),
                type_name: one.type_name.clone(),
            });
            all.collect()
        };
        Some(Census {
            topics: topics.take(MAX_LISTED).collect(),
            services: listed(&self.services),
            actions: listed(&self.actions),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLIENT: ConnectionId = ConnectionId(1);

    /// This many topics, and services.
    fn census(topics: usize, services: usize, at_most: usize) -> Option<Census> {
        let mut directory = Directory::default();
        for n in 0..services {
            provide(&mut directory, Served::Service, &format!("/{n:05}"), None);
        }
        let topics = (0..topics).map(|n| ListedTopic {
            name: format!("/{n:05}").into(),
            type_name: None,
            published: true,
            subscribed: false,
        });
        directory.census(topics, at_most)
    }

    fn provide(directory: &mut Directory, kind: Served, name: &str, type_name: Option<&str>) {
        directory.provide(kind, name, (CLIENT, name), type_name);
    }

    #[test]
    fn so_many_topics_and_services_are_listed_and_no_more() {
        let census = census(MAX_LISTED + 1, MAX_LISTED + 1, usize::MAX).unwrap();
        let listed = (census.topics.len(), census.services.len());
        assert_eq!(listed, (MAX_LISTED, MAX_LISTED));
        let last = format!("/{:05}", MAX_LISTED - 1);
        let names = (
            &*census.topics[MAX_LISTED - 1].name,
            &*census.services[MAX_LISTED - 1].name,
        );
        assert_eq!(names, (&*last, &*last));
    }

    #[test]
    fn a_census_shows_every_change_and_none_is_made_of_more_than_is_wanted() {
        assert_eq!(census(0, 0, 0), Some(Census::default()));
        assert!(census(2, 1, 3).is_some() && census(2, 1, 2).is_none());
        let mut directory = Directory::default();
        let whole = |directory: &Directory| directory.census([].into_iter(), 1).unwrap();
        let changes: [fn(&mut Directory); 5] = [
            |directory| provide(directory, Served::Service, "/s", None),
            |directory| provide(directory, Served::Service, "/s", Some("a/b")),
            |directory| assert!(directory.withdraw(Served::Service, "/s", CLIENT)),
            |directory| provide(directory, Served::Action, "/a", None),
            |directory| assert!(directory.withdraw(Served::Action, "/a", CLIENT)),
        ];
        for (n, change) in changes.into_iter().enumerate() {
            let before = whole(&directory);
            change(&mut directory);
            assert_ne!(before, whole(&directory), "change {n}");
        }
    }
}

//! The names that clients serve to others: services and actions. They and the topics are sorted, so that listing them
//! needs no search.
//!
//! **Invariant:** the directory has a name exactly as long as a client has registered it.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::actors::ConnectionId;
use crate::protocol::op::Served;
use crate::protocol::ros::rosapi::{Census, ListedService, ListedTopic, MAX_LISTED};

/// The services and actions by their absolute names, each with its provider.
#[derive(Default)]
pub(crate) struct Directory {
    services: BTreeMap<Arc<str>, Provider>,
    actions: BTreeMap<Arc<str>, Provider>,
}

/// The client that serves a service or an action.
#[derive(Clone)]
pub(crate) struct Provider {
    pub(crate) connection: ConnectionId,
    /// The provider's spelling of the name. Requests to it have this spelling.
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

    /// Makes a client the provider of `name`. The newest registration wins. Returns the previous provider.
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

    /// Withdraws a name if `connection` is its provider. Returns whether it was.
    pub(crate) fn withdraw(&mut self, kind: Served, name: &str, connection: ConnectionId) -> bool {
        let is_ours = |one: &Provider| one.connection == connection;
        let is_served = self.provider(kind, name).is_some_and(is_ours);
        if is_served {
            self.served(kind).remove(name);
        }
        is_served
    }

    /// Lists the topics, services and actions, up to the limit of each list.
    pub(crate) fn census(&self, topics: impl Iterator<Item = ListedTopic>) -> Census {
        let listed = |all: &BTreeMap<Arc<str>, Provider>| {
            let all = all.iter().take(MAX_LISTED);
            let all = all.map(|(name, one)| ListedService {
                name: Arc::clone(name),
                type_name: one.type_name.clone(),
            });
            all.collect()
        };
        Census {
            topics: topics.take(MAX_LISTED).collect(),
            services: listed(&self.services),
            actions: listed(&self.actions),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bounded_number_of_topics_and_services_is_listed() {
        let mut directory = Directory::default();
        let name = |n: usize| format!("/{n:05}");
        for n in 0..=MAX_LISTED {
            let provider = (ConnectionId(1), &*name(n));
            directory.provide(Served::Service, &name(n), provider, None);
        }
        let topics = (0..=MAX_LISTED).map(|n| ListedTopic {
            name: name(n).into(),
            type_name: None,
            published: true,
            subscribed: false,
        });
        let census = directory.census(topics);
        let listed = (census.topics.len(), census.services.len());
        assert_eq!(listed, (MAX_LISTED, MAX_LISTED));
        let last = (
            &*census.topics[MAX_LISTED - 1].name,
            &*census.services[MAX_LISTED - 1].name,
        );
        assert_eq!(last, (&*name(MAX_LISTED - 1), &*name(MAX_LISTED - 1)));
    }
}

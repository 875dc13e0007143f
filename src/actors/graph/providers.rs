//! The names that clients serve to others: services and actions. They and the topics are kept sorted for the lists.
//!
//! **Invariant:** the table has a name exactly as long as a client has registered it.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::actors::ConnectionId;
use crate::protocol::op::Served;
use crate::protocol::ros::rosapi::{Census, Listed, MAX_LISTED};

/// The services and the actions by their absolute names, each with its provider.
#[derive(Default)]
pub struct Providers(BTreeMap<Served, BTreeMap<Arc<str>, Provider>>);

/// The client that serves a service or an action.
pub struct Provider {
    /// The client.
    pub connection: ConnectionId,
    /// The provider's spelling of the name. Requests to it have this spelling.
    pub spelling: Box<str>,
    type_name: Option<Arc<str>>,
}

impl Provider {
    /// The provider that is this client. `spelling` is its spelling of the name.
    pub fn new(connection: ConnectionId, spelling: &str, type_name: Option<&str>) -> Self {
        Self {
            connection,
            spelling: spelling.into(),
            type_name: type_name.map(Into::into),
        }
    }
}

impl Providers {
    /// Makes a client the provider of `name`. The newest registration wins. Returns the previous provider.
    pub fn provide(
        &mut self,
        kind: Served,
        name: &str,
        provider: Provider,
    ) -> Option<ConnectionId> {
        let served = self.0.entry(kind).or_default();
        let before = served.insert(name.into(), provider)?;
        Some(before.connection)
    }

    /// The client that serves `name`.
    pub fn provider(&self, kind: Served, name: &str) -> Option<&Provider> {
        self.0.get(&kind)?.get(name)
    }

    /// Withdraws a name if `connection` is its provider. Returns whether it was.
    pub fn withdraw(&mut self, kind: Served, name: &str, connection: ConnectionId) -> bool {
        let is_ours = |one: &Provider| one.connection == connection;
        let is_served = self.provider(kind, name).is_some_and(is_ours);
        if is_served && let Some(served) = self.0.get_mut(&kind) {
            served.remove(name);
        }
        is_served
    }

    /// Lists the topics, services and actions, up to the limit of each list.
    pub fn census(&self, topics: impl Iterator<Item = Listed>) -> Census {
        let listed = |kind| {
            let all = self.0.get(&kind).into_iter().flatten().take(MAX_LISTED);
            let all = all.map(|(name, one)| Listed {
                name: Arc::clone(name),
                type_name: one.type_name.clone(),
                published: true,
                subscribed: false,
            });
            all.collect()
        };
        Census {
            topics: topics.take(MAX_LISTED).collect(),
            services: listed(Served::Service),
            actions: listed(Served::Action),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bounded_number_of_topics_and_services_is_listed() {
        let mut providers = Providers::default();
        let name = |n: usize| format!("/{n:05}");
        for n in 0..=MAX_LISTED {
            let provider = Provider::new(ConnectionId(1), &name(n), None);
            providers.provide(Served::Service, &name(n), provider);
        }
        let topics = (0..=MAX_LISTED).map(|n| Listed {
            name: name(n).into(),
            type_name: None,
            published: true,
            subscribed: false,
        });
        let census = providers.census(topics);
        let listed = (census.topics.len(), census.services.len());
        assert_eq!(listed, (MAX_LISTED, MAX_LISTED));
        let last = (
            &*census.topics[MAX_LISTED - 1].name,
            &*census.services[MAX_LISTED - 1].name,
        );
        assert_eq!(last, (&*name(MAX_LISTED - 1), &*name(MAX_LISTED - 1)));
    }
}

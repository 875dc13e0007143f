//! Actions that clients serve: their servers, and the goals that are on their way.
//!
//! **Invariant:** a forwarded goal ends by the result of its own server, or with that client, and only once. A goal
//! outlives its sender, but then nobody hears of it any more.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use super::kept::KeptEntry;
use super::numbers::NumbersByClient;
use super::services::{Provider, Services};
use crate::actors::ConnectionId;
use crate::protocol::names;
use crate::protocol::wire::payload::Payload;

/// A goal that was forwarded to its server and has not ended yet.
pub(crate) struct ForwardedGoal {
    /// The client that sent it.
    pub(crate) sender: ConnectionId,
    /// The sender's id for it.
    pub(crate) id: Option<Payload>,
    pub(crate) server: ConnectionId,
    /// The action's name as the sender spells it.
    pub(crate) action: Arc<str>,
    /// The same as the server spells it.
    pub(crate) spelling: Box<str>,
    pub(crate) wants_feedback: bool,
    /// The part of its sender's room that it takes.
    pub(crate) _entry: KeptEntry,
}

/// Action servers, and goals on their way.
#[derive(Default)]
pub(crate) struct ActionServers {
    /// The servers, by absolute name of the action.
    servers: HashMap<Box<str>, Provider>,
    goals: HashMap<u64, ForwardedGoal>,
    by_sender: NumbersByClient,
    by_server: NumbersByClient,
    goals_made: u64,
}

impl ActionServers {
    /// Makes `server` the one who serves the action; the newest registration wins. Returns the former server.
    pub(crate) fn serve(&mut self, action: &str, server: Provider) -> Option<Provider> {
        self.servers.insert(action.into(), server)
    }

    pub(crate) fn server(&self, action: &str) -> Option<&Provider> {
        self.servers.get(action)
    }

    /// Withdraws the action if `connection` serves it; true if it did.
    pub(crate) fn withdraw(&mut self, action: &str, connection: ConnectionId) -> bool {
        let is_ours = |one: &Provider| one.connection == connection;
        let serves = self.server(action).is_some_and(is_ours);
        if serves {
            self.servers.remove(action);
        }
        serves
    }

    /// Adds a goal. Returns the id under which it goes to its server.
    pub(crate) fn remember(&mut self, goal: ForwardedGoal) -> String {
        self.goals_made += 1;
        let number = self.goals_made;
        self.by_sender.add(goal.sender, number);
        self.by_server.add(goal.server, number);
        self.goals.insert(number, goal);
        Services::call_id(number)
    }

    /// The number of the goal that `server` means by `id`, if it is that server's. Without an id, it is the only one
    /// that `server` carries out, if it is of `action`.
    pub(crate) fn meant_by_server(
        &self,
        id: Option<&Payload>,
        action: Option<&str>,
        server: ConnectionId,
    ) -> Option<u64> {
        let number = match id {
            Some(id) => Services::number_of(id)?,
            None => self.by_server.only(server)?,
        };
        let goal = self.goals.get(&number)?;
        let is_meant =
            id.is_some() || action.is_none_or(|name| names::are_same(&goal.action, name));
        (goal.server == server && is_meant).then_some(number)
    }

    /// The id at its server, and the goal, that `sender` means by `id`.
    pub(crate) fn meant_by_sender(
        &self,
        id: Option<&Payload>,
        action: &str,
        sender: ConnectionId,
    ) -> Option<(String, &ForwardedGoal)> {
        let sent = self.by_sender.newest(sender);
        let mut goals = sent.filter_map(|number| Some((number, self.goals.get(&number)?)));
        let (number, goal) = goals
            .find(|(_, goal)| goal.id.as_ref() == id && names::are_same(&goal.action, action))?;
        Some((Services::call_id(number), goal))
    }

    pub(crate) fn goal(&self, number: u64) -> Option<&ForwardedGoal> {
        self.goals.get(&number)
    }

    /// Removes a goal that has ended.
    pub(crate) fn take(&mut self, number: u64) -> Option<ForwardedGoal> {
        let goal = self.goals.remove(&number)?;
        self.by_sender.remove(goal.sender, number);
        self.by_server.remove(goal.server, number);
        Some(goal)
    }

    /// Takes every goal that has not ended, oldest first.
    pub(crate) fn take_all(&mut self) -> Vec<ForwardedGoal> {
        let numbers: BTreeSet<u64> = self.goals.keys().copied().collect();
        let goals = numbers.into_iter().map(|number| self.take(number));
        goals.flatten().collect()
    }

    /// Takes the numbers of the goals that `server` has not ended, and will not end.
    pub(crate) fn take_numbers(&mut self, server: ConnectionId) -> BTreeSet<u64> {
        self.by_server.take(server)
    }

    /// Forgets the goals that `sender` has sent.
    pub(crate) fn forget_sender(&mut self, sender: ConnectionId) {
        for number in self.by_sender.take(sender) {
            self.take(number);
        }
    }
}

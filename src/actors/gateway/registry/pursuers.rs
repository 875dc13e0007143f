//! Actions that clients pursue: who pursues which, and the goals that are on their way.
//!
//! **Invariant:** a forwarded goal ends by its own pursuer's result, or with that client, and only once. Goals outlive
//! who sent them; then nobody hears of them any more.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use super::numbers::Numbers;
use crate::actors::ConnectionId;
use crate::actors::gateway::registry::services::{Provider, Services};
use crate::actors::resources::budget::Share;
use crate::protocol::names;
use crate::protocol::wire::payload::Payload;

/// A goal that was forwarded to its pursuer and has not ended yet.
pub(super) struct ForwardedGoal {
    /// Who sent it.
    pub(super) sender: ConnectionId,
    /// The sender's id for it.
    pub(super) id: Option<Payload>,
    pub(super) pursuer: ConnectionId,
    /// The action's name as the sender spells it.
    pub(super) action: Arc<str>,
    /// The same as the pursuer spells it.
    pub(super) spelling: Box<str>,
    pub(super) wants_feedback: bool,
    /// Its share of its sender's account.
    pub(super) _share: Share,
}

/// Pursuers and goals on their way.
#[derive(Default)]
pub(super) struct Pursuers {
    /// By absolute name.
    pursuers: HashMap<Box<str>, Provider>,
    goals: HashMap<u64, ForwardedGoal>,
    by_sender: Numbers,
    by_pursuer: Numbers,
    goals_made: u64,
}

impl Pursuers {
    /// Makes `pursuer` the one who pursues the action; the newest registration wins. Gives the one before.
    pub(super) fn pursue(&mut self, action: &str, pursuer: Provider) -> Option<Provider> {
        self.pursuers.insert(action.into(), pursuer)
    }

    pub(super) fn pursuer(&self, action: &str) -> Option<&Provider> {
        self.pursuers.get(action)
    }

    /// Withdraws the action if `connection` pursues it; true if it did.
    pub(super) fn withdraw(&mut self, action: &str, connection: ConnectionId) -> bool {
        let is_ours = |one: &Provider| one.connection == connection;
        let pursues = self.pursuer(action).is_some_and(is_ours);
        if pursues {
            self.pursuers.remove(action);
        }
        pursues
    }

    /// Goals of `sender` that have not ended.
    pub(super) fn sent_by(&self, sender: ConnectionId) -> usize {
        self.by_sender.count(sender)
    }

    /// Takes a goal in; gives the id under which it goes to its pursuer.
    pub(super) fn remember(&mut self, goal: ForwardedGoal) -> String {
        self.goals_made += 1;
        let number = self.goals_made;
        self.by_sender.add(goal.sender, number);
        self.by_pursuer.add(goal.pursuer, number);
        self.goals.insert(number, goal);
        Services::call_id(number)
    }

    /// The number of the goal that `pursuer` means by `id`, if it is that pursuer's and of that action.
    pub(super) fn meant_by_pursuer(
        &self,
        id: Option<&Payload>,
        action: &str,
        pursuer: ConnectionId,
    ) -> Option<u64> {
        let number = Services::number_of(id?)?;
        let goal = self.goals.get(&number)?;
        let is_its =
            goal.pursuer == pursuer && names::absolute(&goal.action) == names::absolute(action);
        is_its.then_some(number)
    }

    /// The id at its pursuer, and the goal, that `sender` means by `id`.
    pub(super) fn meant_by_sender(
        &self,
        id: Option<&Payload>,
        action: &str,
        sender: ConnectionId,
    ) -> Option<(String, &ForwardedGoal)> {
        let sent = self.by_sender.newest(sender);
        let mut goals = sent.filter_map(|number| Some((number, self.goals.get(&number)?)));
        let action = names::absolute(action);
        let (number, goal) = goals
            .find(|(_, goal)| goal.id.as_ref() == id && names::absolute(&goal.action) == action)?;
        Some((Services::call_id(number), goal))
    }

    pub(super) fn goal(&self, number: u64) -> Option<&ForwardedGoal> {
        self.goals.get(&number)
    }

    /// Takes a goal out, which has ended.
    pub(super) fn take(&mut self, number: u64) -> Option<ForwardedGoal> {
        let goal = self.goals.remove(&number)?;
        self.by_sender.remove(goal.sender, number);
        self.by_pursuer.remove(goal.pursuer, number);
        Some(goal)
    }

    /// Takes every goal that has not ended, oldest first.
    pub(super) fn take_all(&mut self) -> Vec<ForwardedGoal> {
        let numbers: BTreeSet<u64> = self.goals.keys().copied().collect();
        let goals = numbers.into_iter().map(|number| self.take(number));
        goals.flatten().collect()
    }

    /// Takes the numbers of the goals that `pursuer` has not ended, and will not end.
    pub(super) fn take_numbers(&mut self, pursuer: ConnectionId) -> BTreeSet<u64> {
        self.by_pursuer.take(pursuer)
    }

    /// Forgets the goals that `sender` has sent.
    pub(super) fn forget_sender(&mut self, sender: ConnectionId) {
        for number in self.by_sender.take(sender) {
            self.take(number);
        }
    }
}

//! Goals for actions of clients: to the client that pursues them, and what it says of them back to who sent them.
//!
//! **Invariant:** every goal that is forwarded has one `action_result`, unless its sender goes first.

use std::sync::Arc;

use super::pursuers::ForwardedGoal;
use super::refusal::Refusal;
use super::services::Provider;
use super::state::{FrameOrigin, Registry};
use crate::actors::ConnectionId;
use crate::actors::gateway::limits::{CALL_BYTES, MAX_BACKLOG, MAX_PROVIDED, MAX_WAITING_GOALS};
use crate::actors::gateway::messages::{Deliver, Frames};
use crate::protocol::catalog::Action;
use crate::protocol::messages::{self, Level};
use crate::protocol::names;
use crate::protocol::op::{ActionGoal, Arguments, GoalStatus, PursuerOp};
use crate::protocol::wire::payload::Payload;

impl Registry {
    /// Does what a client says that pursues goals.
    pub(super) fn pursue(
        &mut self,
        origin: &FrameOrigin,
        action: &str,
        pursuit: PursuerOp,
    ) -> Result<(), Refusal> {
        match pursuit {
            PursuerOp::Advertise { type_name } => {
                self.advertise_action(origin, action, type_name.as_deref())
            }
            PursuerOp::Unadvertise => self.unadvertise_action(origin, action),
            PursuerOp::Feedback { values } => self.pass_feedback(origin, action, &values),
            PursuerOp::End {
                values,
                status,
                result,
            } => self.pass_end(origin, action, |goal| {
                messages::action_result_raw(&goal.action, goal.id.as_ref(), &values, status, result)
            }),
        }
    }

    fn advertise_action(
        &mut self,
        origin: &FrameOrigin,
        spelling: &str,
        type_name: Option<&str>,
    ) -> Result<(), Refusal> {
        if Action::from_name(spelling).is_some() {
            return Err(Refusal::RuntimeAction(spelling.to_owned()));
        }
        let action = &*names::absolute(spelling);
        let Some(client) = self.clients.get_mut(&origin.from) else {
            return Ok(());
        };
        let provided = client.provided.len() + client.pursued.len();
        if provided >= MAX_PROVIDED && !client.pursued.contains_key(action) {
            return Err(Refusal::TooManyProvided);
        }
        let share = client.register(spelling.len() + type_name.map_or(0, str::len));
        client.pursued.insert(action.into(), share);
        let pursuer = Provider {
            connection: origin.from,
            spelling: spelling.into(),
        };
        let before = self.pursuers.pursue(action, pursuer);
        if let Some(before) = before.filter(|one| one.connection != origin.from)
            && let Some(before) = self.clients.get_mut(&before.connection)
        {
            before.pursued.remove(action);
        }
        self.tally.pursue(action, type_name);
        let msg = format!("advertised action {spelling}");
        self.send_status(origin.from, Level::Info, &msg, origin.id.as_ref());
        Ok(())
    }

    /// The goals that are on their way stay with the client.
    fn unadvertise_action(&mut self, origin: &FrameOrigin, spelling: &str) -> Result<(), Refusal> {
        let action = &*names::absolute(spelling);
        if !self.withdraw_action(action, origin.from) {
            return Err(Refusal::NotPursuer(spelling.to_owned()));
        }
        if let Some(client) = self.clients.get_mut(&origin.from) {
            client.pursued.remove(action);
        }
        Ok(())
    }

    /// Withdraws an action by its absolute name, if `connection` pursues it; true if it did.
    pub(super) fn withdraw_action(&mut self, action: &str, connection: ConnectionId) -> bool {
        let pursued = self.pursuers.withdraw(action, connection);
        if pursued {
            self.tally.drop_action(action);
        }
        pursued
    }

    /// Passes a goal on to the client that pursues the action.
    pub(super) fn forward_goal(
        &mut self,
        from: ConnectionId,
        id: Option<Payload>,
        goal: &ActionGoal,
    ) -> Result<(), Refusal> {
        let action = goal.action.as_str();
        if let Some(why) = self.closed {
            return Err(Refusal::Closed(why));
        }
        let unknown = || Refusal::NoAction(action.to_owned());
        let name = &*names::absolute(action);
        let pursuer = self.pursuers.pursuer(name).ok_or_else(unknown)?.clone();
        if matches!(goal.args, Arguments::Neither(_)) {
            return Err(Refusal::BadArguments);
        }
        if self.pursuers.sent_by(from) >= MAX_WAITING_GOALS {
            return Err(Refusal::TooManyGoals);
        }
        let (Some(client), Some(sender)) = (
            self.clients.get(&pursuer.connection),
            self.clients.get(&from),
        ) else {
            return Err(unknown());
        };
        if !client.pursued.contains_key(name) {
            return Err(unknown());
        }
        if client.backlog() > MAX_BACKLOG {
            return Err(Refusal::ProviderBusy(action.to_owned()));
        }
        let id_bytes = id.as_ref().map_or(0, Payload::allocated);
        let names = 2 * action.len() + pursuer.spelling.len();
        let share = sender.outlets.account.take(CALL_BYTES + id_bytes + names);
        let known_as = self.pursuers.remember(ForwardedGoal {
            sender: from,
            id,
            pursuer: pursuer.connection,
            action: Arc::from(action),
            spelling: pursuer.spelling.clone(),
            wants_feedback: goal.feedback,
            _share: share,
        });
        client.send(messages::action_goal(
            &pursuer.spelling,
            &known_as,
            goal.type_name.as_deref(),
            goal.args.payload(),
            goal.feedback,
        ));
        Ok(())
    }

    /// Asks the client that pursues a goal of this client to end it.
    pub(super) fn forward_cancellation(
        &self,
        origin: &FrameOrigin,
        action: &str,
    ) -> Result<(), Refusal> {
        let meant = self
            .pursuers
            .meant_by_sender(origin.id.as_ref(), action, origin.from);
        let Some((id, goal)) = meant else {
            let is_known = self.pursuers.pursuer(&names::absolute(action)).is_some();
            let why = if is_known {
                Refusal::NoGoal
            } else {
                Refusal::NoAction
            };
            return Err(why(action.to_owned()));
        };
        if let Some(pursuer) = self.clients.get(&goal.pursuer) {
            if pursuer.backlog() > MAX_BACKLOG {
                return Err(Refusal::ProviderBusy(action.to_owned()));
            }
            pursuer.send(messages::cancellation(&goal.spelling, &id));
        }
        Ok(())
    }

    /// Progress goes to who sent the goal, if it was asked for; a slow client may miss some.
    fn pass_feedback(
        &self,
        origin: &FrameOrigin,
        action: &str,
        values: &Payload,
    ) -> Result<(), Refusal> {
        let meant = self
            .pursuers
            .meant_by_pursuer(origin.id.as_ref(), action, origin.from);
        let goal = meant.and_then(|number| self.pursuers.goal(number));
        let goal = goal.ok_or_else(|| Refusal::StaleGoal(action.to_owned()))?;
        if let Some(sender) = self
            .clients
            .get(&goal.sender)
            .filter(|_| goal.wants_feedback)
        {
            let frame = messages::action_feedback_raw(&goal.action, goal.id.as_ref(), values);
            sender.outlets.deliver.do_send(Deliver {
                topic: Arc::clone(&goal.action),
                frames: Frames::Feedback(self.count(frame)),
                underway: None,
            });
        }
        Ok(())
    }

    /// The end of a goal goes to who sent it.
    fn pass_end(
        &mut self,
        origin: &FrameOrigin,
        action: &str,
        encode: impl FnOnce(&ForwardedGoal) -> bytes::Bytes,
    ) -> Result<(), Refusal> {
        let meant = self
            .pursuers
            .meant_by_pursuer(origin.id.as_ref(), action, origin.from);
        let goal = meant.and_then(|number| self.pursuers.take(number));
        let goal = goal.ok_or_else(|| Refusal::StaleGoal(action.to_owned()))?;
        if let Some(sender) = self.clients.get(&goal.sender) {
            if sender.backlog() > MAX_BACKLOG {
                let why = Refusal::CallerBusy(action.to_owned());
                self.abort(&goal, &why);
            } else {
                sender.send(encode(&goal));
            }
        }
        Ok(())
    }

    /// Tells who sent a goal that it has ended without a result of its pursuer.
    pub(super) fn abort(&self, goal: &ForwardedGoal, why: &Refusal) {
        if let Some(sender) = self.clients.get(&goal.sender) {
            let (id, why) = (goal.id.as_ref(), why.to_string());
            let status = GoalStatus::Aborted as u8;
            sender.send(messages::action_result(
                &goal.action,
                id,
                &why,
                status,
                false,
            ));
        }
    }
}

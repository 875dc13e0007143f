//! Goals of actions that a client serves: they go to that client, and its feedback and results back to the sender.
//!
//! **Invariant:** every goal that is forwarded has one `action_result`, unless its sender goes first.

use std::sync::Arc;

use crate::actors::ConnectionId;
use crate::actors::gateway::limits::MAX_BACKLOG;
use crate::actors::gateway::messages::Deliver;
use crate::actors::gateway::registry::refusal::Refusal;
use crate::actors::gateway::registry::state::{FrameOrigin, Registry};
use crate::actors::gateway::registry::tables::action_servers::ForwardedGoal;
use crate::actors::gateway::registry::tables::services::Provider;
use crate::actors::resources::memory::cover_message;
use crate::protocol::catalog::Action;
use crate::protocol::messages::{self, Level};
use crate::protocol::names;
use crate::protocol::op::{ActionGoal, ActionServerOp, Arguments, GoalStatus};
use crate::protocol::wire::payload::Payload;

impl Registry {
    /// Performs an op of an action server.
    pub(crate) fn serve_action(
        &mut self,
        origin: &FrameOrigin,
        action: &str,
        op: ActionServerOp,
    ) -> Result<(), Refusal> {
        match op {
            ActionServerOp::Advertise { type_name } => {
                self.advertise_action(origin, action, type_name.as_deref())
            }
            ActionServerOp::Unadvertise => self.unadvertise_action(origin, action),
            ActionServerOp::Feedback { values } => self.pass_feedback(origin, action, &values),
            ActionServerOp::End {
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
        let names = spelling.len() + type_name.map_or(0, str::len);
        let before = client.served_actions.get(action);
        let entry = client.kept.enter(names, before)?;
        client.served_actions.insert(action.into(), entry);
        let server = Provider {
            connection: origin.from,
            spelling: spelling.into(),
        };
        let before = self.action_servers.serve(action, server);
        if let Some(before) = before.filter(|one| one.connection != origin.from)
            && let Some(before) = self.clients.get_mut(&before.connection)
        {
            before.served_actions.remove(action);
        }
        self.tally.serve_action(action, type_name);
        let msg = format!("advertised action {spelling}");
        self.send_status(origin.from, Level::Info, &msg, origin.id.as_ref());
        Ok(())
    }

    /// The goals that are on their way stay with the client.
    fn unadvertise_action(&mut self, origin: &FrameOrigin, spelling: &str) -> Result<(), Refusal> {
        let action = &*names::absolute(spelling);
        if !self.withdraw_action(action, origin.from) {
            return Err(Refusal::NotActionServer(spelling.to_owned()));
        }
        if let Some(client) = self.clients.get_mut(&origin.from) {
            client.served_actions.remove(action);
        }
        Ok(())
    }

    /// Withdraws an action by its absolute name, if `connection` serves it; true if it did.
    pub(crate) fn withdraw_action(&mut self, action: &str, connection: ConnectionId) -> bool {
        let served = self.action_servers.withdraw(action, connection);
        if served {
            self.tally.drop_action(action);
        }
        served
    }

    /// Passes a goal on to the client that serves the action.
    pub(crate) fn forward_goal(
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
        let server = self
            .action_servers
            .server(name)
            .ok_or_else(unknown)?
            .clone();
        if matches!(goal.args, Arguments::Neither(_)) {
            return Err(Refusal::BadArguments);
        }
        let (Some(client), Some(sender)) = (
            self.clients.get(&server.connection),
            self.clients.get(&from),
        ) else {
            return Err(unknown());
        };
        if !client.served_actions.contains_key(name) {
            return Err(unknown());
        }
        if client.backlog() > MAX_BACKLOG {
            return Err(Refusal::ProviderBusy(action.to_owned()));
        }
        let id_bytes = id.as_ref().map_or(0, Payload::allocated);
        let names = 2 * action.len() + server.spelling.len();
        let entry = sender.kept.enter(id_bytes + names, None)?;
        let known_as = self.action_servers.remember(ForwardedGoal {
            sender: from,
            id,
            server: server.connection,
            action: Arc::from(action),
            spelling: server.spelling.clone(),
            wants_feedback: goal.feedback,
            _entry: entry,
        });
        client.send(self.covered(messages::action_goal(
            &server.spelling,
            &known_as,
            goal.type_name.as_deref(),
            goal.args.payload(),
            goal.feedback,
        )));
        Ok(())
    }

    /// Asks the action server of a goal of this client to end it.
    pub(crate) fn forward_cancellation(
        &self,
        origin: &FrameOrigin,
        action: &str,
    ) -> Result<(), Refusal> {
        let meant = self
            .action_servers
            .meant_by_sender(origin.id.as_ref(), action, origin.from);
        let Some((id, goal)) = meant else {
            let is_known = self
                .action_servers
                .server(&names::absolute(action))
                .is_some();
            let why = if is_known {
                Refusal::NoGoal
            } else {
                Refusal::NoAction
            };
            return Err(why(action.to_owned()));
        };
        if let Some(server) = self.clients.get(&goal.server) {
            if server.backlog() > MAX_BACKLOG {
                return Err(Refusal::ProviderBusy(action.to_owned()));
            }
            server.send(messages::cancellation(&goal.spelling, &id));
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
            .action_servers
            .meant_by_server(origin.id.as_ref(), None, origin.from);
        let goal = meant.and_then(|number| self.action_servers.goal(number));
        let goal = goal.ok_or_else(|| Refusal::StaleGoal(action.to_owned()))?;
        if !names::are_same(&goal.action, action) {
            return Err(Refusal::OtherAction(goal.action.to_string()));
        }
        if let Some(sender) = self
            .clients
            .get(&goal.sender)
            .filter(|_| goal.wants_feedback)
        {
            let frame = messages::action_feedback_raw(&goal.action, goal.id.as_ref(), values);
            sender.outlets.deliver.do_send(Deliver {
                topic: None,
                frame: cover_message(self.permit.as_ref(), frame),
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
        let goal = self
            .take_ended(origin, None)
            .ok_or_else(|| Refusal::StaleGoal(action.to_owned()))?;
        if !names::are_same(&goal.action, action) {
            return self.discard_result(&goal, Refusal::OtherAction(goal.action.to_string()));
        }
        if let Some(sender) = self.clients.get(&goal.sender) {
            if sender.backlog() > MAX_BACKLOG {
                let why = Refusal::CallerBusy(action.to_owned());
                self.abort(&goal, &why);
            } else {
                sender.send(self.covered(encode(&goal)));
            }
        }
        Ok(())
    }

    /// Ends the goal that a bad result is for, if there is one.
    pub(crate) fn fail_goal(
        &mut self,
        origin: &FrameOrigin,
        action: Option<&str>,
        why: Refusal,
    ) -> Result<(), Refusal> {
        match self.take_ended(origin, action) {
            Some(goal) => self.discard_result(&goal, why),
            None => Err(why),
        }
    }

    fn take_ended(&mut self, origin: &FrameOrigin, action: Option<&str>) -> Option<ForwardedGoal> {
        let meant = self
            .action_servers
            .meant_by_server(origin.id.as_ref(), action, origin.from);
        self.action_servers.take(meant?)
    }

    /// The goal's sender is told why the result is discarded, and so is the action server.
    fn discard_result(&self, goal: &ForwardedGoal, why: Refusal) -> Result<(), Refusal> {
        let action = goal.action.to_string();
        self.abort(goal, &Refusal::BadAnswer(action, Box::new(why.clone())));
        Err(why)
    }

    /// Tells who sent a goal that it has ended without a result of its server.
    pub(crate) fn abort(&self, goal: &ForwardedGoal, why: &Refusal) {
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

//! Goals of actions and their cancellation: to the node or the client that serves the action.
//!
//! **Invariant:** every goal has one `action_result`, unless its sender disconnects first.

use std::fmt::Display;
use std::sync::Arc;

use serde_json::json;

use super::calls::ToForward;
use super::{FrameOrigin, Registry};
use crate::actors::graph::refusal::Refusal;
use crate::actors::node::{
    ActionClient, ActionRequest, CancelSent, Completion, ForwardGoal, Route,
};
use crate::actors::resources::memory::{MAX_BACKLOG, cover_message};
use crate::protocol::catalog::Action;
use crate::protocol::messages;
use crate::protocol::names;
use crate::protocol::op::{ActionGoal, CallService, GoalStatus, Served};
use crate::protocol::wire::json::Payload;

impl Registry {
    /// Sends a goal to the node, or the client, that serves its action. A failure is the goal's one result.
    pub(super) fn send_action_goal(&mut self, origin: FrameOrigin, goal: ActionGoal) -> Completion {
        let Some(client) = self.clients.get(&origin.from) else {
            return Completion::at_once();
        };
        let refusal = match (self.closed, Action::from_name(&goal.action)) {
            (Some(why), _) => Err(Refusal::Closed(why)),
            (None, Some(action)) => match self.action_route(action, &goal) {
                Ok(node) => {
                    let (working, completion) = Completion::pending();
                    let client = ActionClient {
                        link: client.link.clone(),
                        action: Arc::from(goal.action),
                        id: origin.id,
                        wants_feedback: goal.feedback,
                    };
                    let goal = goal.args;
                    node(ActionRequest::Goal(ForwardGoal {
                        goal,
                        client,
                        working,
                    }));
                    return completion;
                }
                Err(why) => Err(why),
            },
            (None, None) => {
                let to_forward = ToForward {
                    kind: Served::Action,
                    name: &goal.action,
                    args: &goal.args,
                    deadline: None,
                    wants_feedback: goal.feedback,
                };
                let type_name = goal.type_name.as_deref();
                self.forward(&origin, &to_forward, |spelling, id| {
                    messages::action_goal(spelling, id, type_name, &goal.args, goal.feedback)
                })
            }
        };
        if let Err(why) = refusal {
            self.end_goal(&origin, &goal.action, &why, GoalStatus::Unknown);
        }
        Completion::at_once()
    }

    /// The node that serves an action of the runtime.
    fn action_route(
        &self,
        action: Action,
        goal: &ActionGoal,
    ) -> Result<&Route<ActionRequest>, Refusal> {
        match &goal.type_name {
            Some(name) if !names::same_type(name, action.type_name()) => {
                Err(Refusal::ActionType(action.type_name()))
            }
            _ => {
                let unknown = || Refusal::NoAction(goal.action.clone());
                self.nodes.actions.get(&action).ok_or_else(unknown)
            }
        }
    }

    /// Cancels a goal of the same client.
    pub(super) fn cancel_action_goal(&self, origin: &FrameOrigin, action: &str) -> Completion {
        let at_node = self.cancel_at_node(origin, action, origin.id.clone(), false);
        at_node.unwrap_or_else(|| {
            if let Err(why) = self.forward_cancellation(origin, action) {
                self.refuse(origin, &why);
            }
            Completion::at_once()
        })
    }

    /// Cancels the client's goal with this id, or all goals, at the node that serves the action. `None` if no node
    /// does.
    fn cancel_at_node(
        &self,
        origin: &FrameOrigin,
        action: &str,
        id: Option<Payload>,
        all: bool,
    ) -> Option<Completion> {
        let node = self.nodes.actions.get(&Action::from_name(action)?)?;
        let link = self.clients.get(&origin.from)?.link.clone();
        let (working, completion) = Completion::pending();
        node(ActionRequest::Cancel(CancelSent {
            link,
            id,
            all,
            working,
        }));
        Some(completion)
    }

    /// The action whose goals a call of this service cancels, unless a client provides the service itself.
    pub(super) fn action_to_cancel<'a>(&self, service: &'a str) -> Option<&'a str> {
        let action = names::cancelled_action(service)?;
        let has = |kind, name| {
            self.providers
                .provider(kind, &names::absolute(name))
                .is_some()
        };
        let is_known = Action::from_name(action).is_some() || has(Served::Action, action);
        (is_known && !has(Served::Service, service)).then_some(action)
    }

    /// Cancels all goals of an action, also those of other clients, as the service of ROS 2 does. The goals end after
    /// the answer.
    pub(super) fn cancel_all_goals(
        &mut self,
        origin: &FrameOrigin,
        call: &CallService,
        action: &str,
    ) -> Result<Completion, Refusal> {
        let mut args = call.args.get().bytes();
        if !args.all(|byte| b"{}[] \t\r\n".contains(&byte)) {
            return Err(Refusal::OneGoal);
        }
        let handled = match self.cancel_at_node(origin, action, None, true) {
            Some(handled) => handled,
            None => {
                self.forward_all_cancellations(action)?;
                Completion::at_once()
            }
        };
        let values = json!({"return_code": 0, "goals_canceling": []});
        let id = origin.id.as_ref();
        let frame = messages::response(&call.service, id, &values, true, "");
        if let Some(client) = self.clients.get(&origin.from) {
            client.send(self.covered(frame));
        }
        Ok(handled)
    }

    /// Forwards the cancellation of a goal to its action server.
    fn forward_cancellation(&self, origin: &FrameOrigin, action: &str) -> Result<(), Refusal> {
        let requests = &self.requests;
        let goal = requests.newest_goal(origin.id.as_ref(), action, origin.from);
        let Some((id, goal)) = goal else {
            let name = names::absolute(action);
            return Err(match self.providers.provider(Served::Action, &name) {
                Some(_) => Refusal::NoGoal(action.to_owned()),
                None => Refusal::NoAction(action.to_owned()),
            });
        };
        if let (Some(server), Some(spelling)) = (self.clients.get(&goal.provider), &goal.spelling) {
            if server.is_congested() {
                return Err(Refusal::ProviderBusy(action.to_owned()));
            }
            server.send(messages::cancellation(spelling, &id));
        }
        Ok(())
    }

    /// Forwards the cancellation of all goals of an action, as far as its server reads. If goals remain, the caller
    /// gets a refusal and may call again.
    fn forward_all_cancellations(&mut self, action: &str) -> Result<(), Refusal> {
        let provider = self
            .providers
            .provider(Served::Action, &names::absolute(action));
        let server = provider.and_then(|one| Some((one, self.clients.get(&one.connection)?)));
        let Some((provider, server)) = server else {
            return Err(Refusal::NoAction(action.to_owned()));
        };
        let spelling = &*provider.spelling;
        let length = messages::cancellation(spelling, &names::own_id(u64::MAX)).len();
        let most = MAX_BACKLOG.saturating_sub(server.backlog()) / length;
        let (ids, is_rest) = self.requests.cancel_all(action, provider.connection, most);
        for id in &ids {
            server.send(messages::cancellation(spelling, id));
        }
        if is_rest {
            return Err(Refusal::ProviderBusy(action.to_owned()));
        }
        Ok(())
    }

    /// Sends feedback to the sender of the goal, if it requested feedback. A slow client may miss some.
    pub(super) fn pass_feedback(
        &self,
        origin: &FrameOrigin,
        action: &str,
        values: &Payload,
    ) -> Result<(), Refusal> {
        let requests = &self.requests;
        let meant = requests.find_answered(Served::Action, origin.id.as_ref(), None, origin.from);
        let goal = meant.and_then(|number| requests.get(number));
        let goal = goal.ok_or_else(|| Refusal::StaleGoal(action.to_owned()))?;
        if !names::are_same(&goal.name, action) {
            return Err(Refusal::OfAnother(Served::Action, goal.name.to_string()));
        }
        let sender = self.clients.get(&goal.caller);
        if let Some(sender) = sender.filter(|_| goal.wants_feedback) {
            let frame = messages::action_feedback(&goal.name, goal.id.as_ref(), values);
            sender.deliver_feedback(cover_message(self.permit.as_ref(), frame));
        }
        Ok(())
    }

    /// Ends a goal that has no result, for this reason.
    pub(super) fn end_goal(
        &self,
        origin: &FrameOrigin,
        action: &str,
        why: &impl Display,
        status: GoalStatus,
    ) {
        if let Some(client) = self.clients.get(&origin.from) {
            let (id, why) = (origin.id.as_ref(), why.to_string());
            let frame = messages::action_result(action, id, &why, status as u8, false);
            client.send(self.covered(frame));
        }
    }
}

//! Actions: a goal goes to the node that pursues it; the client hears of it under its own id.
//!
//! **Invariant:** a goal that is refused here is answered by one `action_result`.

use std::sync::Arc;

use actix::prelude::*;
use serde_json::value::RawValue;
use tokio::sync::oneshot;

use super::refusal::Refusal;
use super::{Handled, Progress, Registry};
use crate::actors::ConnectionId;
use crate::actors::connection::Deliver;
use crate::actors::follower::{ActionRequest, Canceller, Follower};
use crate::protocol::catalog::Action;
use crate::protocol::messages::Level;
use crate::protocol::names;
use crate::protocol::op::ActionGoal;

impl Registry {
    /// Sends a goal to the node that pursues it.
    pub(super) fn send_action_goal(
        &mut self,
        from: ConnectionId,
        id: Option<Box<RawValue>>,
        goal: ActionGoal,
        ctx: &mut Context<Self>,
    ) -> Handled {
        let follower = Follower {
            respond: ctx.address().recipient(),
            progress: ctx.address().recipient(),
            connection: from,
            action: Arc::from(goal.action.as_str()),
            id,
            wants_feedback: goal.feedback,
        };
        let node = match self.pursuer(&goal) {
            Ok(node) => node,
            Err(why) => {
                follower.refuse(&why.to_string());
                return Handled(None);
            }
        };
        let (done, ended) = oneshot::channel();
        node.do_send(ActionRequest::Goal {
            arguments: goal.args,
            follower,
            done,
        });
        Handled(Some(ended))
    }

    /// Ends a goal of the same client.
    pub(super) fn cancel_action_goal(
        &mut self,
        from: ConnectionId,
        id: Option<Box<RawValue>>,
        action: &str,
        ctx: &mut Context<Self>,
    ) -> Handled {
        let node = Action::from_name(action).and_then(|action| self.nodes.actions.get(&action));
        let Some(node) = node else {
            let why = Refusal::NoAction(action.to_owned()).to_string();
            self.send_status(from, Level::Error, &why, id.as_deref());
            return Handled(None);
        };
        let (done, ended) = oneshot::channel();
        node.do_send(ActionRequest::Cancel {
            from: Canceller {
                respond: ctx.address().recipient(),
                connection: from,
                id,
            },
            done,
        });
        Handled(Some(ended))
    }

    fn pursuer(&self, goal: &ActionGoal) -> Result<&Recipient<ActionRequest>, Refusal> {
        if let Some(why) = self.closed {
            return Err(Refusal::Closed(why));
        }
        let unknown = || Refusal::NoAction(goal.action.clone());
        let action = Action::from_name(&goal.action).ok_or_else(unknown)?;
        match &goal.type_name {
            Some(name) if !names::same_type(name, action.type_name()) => {
                Err(Refusal::ActionType(action.type_name()))
            }
            _ => self.nodes.actions.get(&action).ok_or_else(unknown),
        }
    }
}

impl Handler<Progress> for Registry {
    type Result = ();

    fn handle(&mut self, progress: Progress, _: &mut Context<Self>) {
        if let Some(client) = self.clients.get(&progress.connection) {
            client.outlets.deliver.do_send(Deliver {
                topic: progress.action,
                frame: self.count(progress.frame),
            });
        }
    }
}

//! Actions: a goal goes to its action server, a node or a client; the sender hears of it under its own id.
//!
//! **Invariant:** a goal that is refused here is answered by one `action_result`.

use std::sync::Arc;

use actix::prelude::*;
use tokio::sync::oneshot;

use crate::actors::ConnectionId;
use crate::actors::gateway::messages::{Deliver, Handled};
use crate::actors::gateway::registry::refusal::Refusal;
use crate::actors::gateway::registry::state::{FrameOrigin, Registry};
use crate::actors::node::Feedback;
use crate::actors::wire::Route;
use crate::actors::wire::action_client::{ActionClient, ActionRequest, Canceller, SentGoal};
use crate::protocol::catalog::Action;
use crate::protocol::messages::Level;
use crate::protocol::names;
use crate::protocol::op::ActionGoal;
use crate::protocol::wire::payload::Payload;

impl Registry {
    /// Sends a goal to the node, or the client, that serves its action.
    pub(crate) fn send_action_goal(
        &mut self,
        from: ConnectionId,
        id: Option<Payload>,
        goal: ActionGoal,
        ctx: &mut Context<Self>,
    ) -> Handled {
        let mut refusal = None;
        if Action::from_name(&goal.action).is_none() {
            match self.forward_goal(from, id.clone(), &goal) {
                Ok(()) => return Handled::at_once(),
                Err(why) => refusal = Some(why),
            }
        }
        let Some(client) = self.clients.get(&from) else {
            return Handled::at_once();
        };
        let action_client = ActionClient {
            respond: ctx.address().recipient(),
            feedback: ctx.address().recipient(),
            connection: from,
            action: Arc::from(goal.action.as_str()),
            id,
            wants_feedback: goal.feedback,
            gone: Arc::clone(&client.outlets.gone),
        };
        let node = match refusal.map_or_else(|| self.action_route(&goal), Err) {
            Ok(node) => node,
            Err(why) => {
                action_client.refuse(&why.to_string());
                return Handled::at_once();
            }
        };
        let (done, ended) = oneshot::channel();
        node(ActionRequest::Goal {
            arguments: goal.args,
            client: action_client,
            done,
        });
        Handled::by_node(ended)
    }

    /// Ends a goal of the same client.
    pub(crate) fn cancel_action_goal(
        &mut self,
        from: ConnectionId,
        id: Option<Payload>,
        action: &str,
        ctx: &mut Context<Self>,
    ) -> Handled {
        let node = Action::from_name(action).and_then(|action| self.nodes.actions.get(&action));
        let Some(node) = node else {
            let origin = FrameOrigin { from, id };
            if let Err(why) = self.forward_cancellation(&origin, action) {
                self.send_status(from, Level::Error, &why.to_string(), origin.id.as_ref());
            }
            return Handled::at_once();
        };
        let (done, ended) = oneshot::channel();
        node(ActionRequest::Cancel {
            from: Canceller {
                respond: ctx.address().recipient(),
                goal: SentGoal {
                    connection: from,
                    id,
                },
            },
            done,
        });
        Handled::by_node(ended)
    }

    fn action_route(&self, goal: &ActionGoal) -> Result<&Route<ActionRequest>, Refusal> {
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

impl Handler<Feedback> for Registry {
    type Result = ();

    fn handle(&mut self, feedback: Feedback, _: &mut Context<Self>) {
        if let Some(client) = self.clients.get(&feedback.connection) {
            client.outlets.deliver.do_send(Deliver {
                topic: None,
                frame: feedback.frame.write(),
                underway: None,
            });
        }
    }
}

//! Readers of goals and cancellations, by the services and by the action, and the writers of their answers.
//!
//! **Invariant:** a goal of the service and a goal of the action are read in the same way.

use std::sync::Arc;

use actix::prelude::*;
use bytes::Bytes;

use super::messages::{CancelGoal, CancelRejected, GoalOwner, GoalRejected, Meant, SendGoal};
use crate::actors::node::{Asker, Call, Done, Reply, Unserved};
use crate::actors::wire::action_client::{ActionClient, Canceller};
use crate::actors::wire::{Address, Answered, Callable, Nodes};
use crate::protocol::catalog::{Action, Service};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::Rejections;
use crate::services::goals::{CancelRequest, GoalRequest};

/// Enters the action into the registry's table.
pub(super) fn attach<const N: usize>(
    send: Recipient<Call<SendGoal<N>>>,
    cancel: Recipient<Call<CancelGoal>>,
    nodes: &mut Nodes,
) {
    nodes.carry_out(
        Action::MoveTo,
        move |arguments, client, done| match SendGoal::read(Service::SendGoal, &arguments) {
            Ok(goal) => {
                let client = Arc::new(client);
                let reply = Reply::new(GoalSender(Arc::clone(&client)), Some(done));
                let owner = Some(GoalOwner::Client(client));
                let ask = SendGoal { owner, ..goal };
                send.do_send(Call { ask, reply });
            }
            Err(rejections) => client.refuse(&rejections.status()),
        },
        move |from, done| {
            let goal = Meant::Sent(from.goal.clone());
            let reply = Reply::new(GoalCanceller(from), Some(done));
            let ask = CancelGoal { goal };
            cancel.do_send(Call { ask, reply });
        },
    );
}

/// A client that has sent a goal by the action. Feedback shows that it was accepted.
struct GoalSender(Arc<ActionClient>);

impl Asker<Result<String, GoalRejected>> for GoalSender {
    fn answer(
        self: Box<Self>,
        answer: Result<Result<String, GoalRejected>, Unserved>,
        _: Option<Done>,
    ) {
        match answer {
            Ok(Ok(_)) => {}
            Ok(Err(why)) => self.0.refuse(&why.to_string()),
            Err(why) => self.0.refuse(&why.to_string()),
        }
    }

    fn warn(&self, why: &str) {
        self.0.warn(why);
    }
}

/// A client that cancels a goal of the action. It is informed if that goal is not active. Otherwise the goal's
/// result is the answer.
struct GoalCanceller(Canceller);

impl Asker<Result<(), CancelRejected>> for GoalCanceller {
    fn answer(
        self: Box<Self>,
        answer: Result<Result<(), CancelRejected>, Unserved>,
        _: Option<Done>,
    ) {
        if let Ok(Err(why @ CancelRejected::NotSent)) = answer {
            self.0.refuse(&why.to_string());
        }
    }
}

impl<const N: usize> Callable for SendGoal<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let GoalRequest { target, criteria } = GoalRequest::read::<N>(service, arguments)?;
        Ok(Self {
            target,
            criteria,
            owner: None,
        })
    }
}

impl<const N: usize> Answered for SendGoal<N> {
    fn write(answer: Result<String, GoalRejected>, to: &Address) -> Bytes {
        GoalRequest::write(&answer, to)
    }
}

impl Callable for CancelGoal {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let CancelRequest { goal_id } = CancelRequest::read(service, arguments)?;
        let goal = goal_id.map_or(Meant::Active, Meant::Called);
        Ok(Self { goal })
    }
}

impl Answered for CancelGoal {
    fn write(answer: Result<(), CancelRejected>, to: &Address) -> Bytes {
        CancelRequest::write(answer, to)
    }
}

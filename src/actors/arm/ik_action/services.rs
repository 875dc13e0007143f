//! Readers of goals and cancellations, by the services and by the action, and the writers of their answers.
//!
//! **Invariant:** a goal of the service and a goal of the action are read in the same way.

use std::sync::Arc;

use bytes::Bytes;

use super::messages::{CancelGoal, CancelRejected, GoalRejected, GoalSelector, SendGoal};
use crate::actors::node::{Asker, Done, Unserved};
use crate::actors::wire::action_client::{ActionClient, Goal};
use crate::actors::wire::{Address, Answered, Callable};
use crate::protocol::catalog::{Action, Service};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::Rejections;
use crate::services::goals::{CancelRequest, GoalRequest};

impl<const N: usize> Goal for SendGoal<N> {
    const ACTION: Action = Action::MoveTo;

    fn read(arguments: &Arguments) -> Result<Self, Rejections> {
        <Self as Callable>::read(Service::SendGoal, arguments)
    }
}

/// A client that has sent a goal by the action. Feedback shows that it was accepted.
pub(super) struct GoalSender(pub(super) Arc<ActionClient>);

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
        let goal = goal_id.map_or(GoalSelector::Active, GoalSelector::ById);
        Ok(Self { goal })
    }
}

impl Answered for CancelGoal {
    fn write(answer: Result<(), CancelRejected>, to: &Address) -> Bytes {
        CancelRequest::write(answer, to)
    }
}

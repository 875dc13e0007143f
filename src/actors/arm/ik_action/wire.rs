//! Goals and cancellations in JSON, by the services and by the action, and the responses.
//!
//! **Invariant:** a goal is read in the same way whether it comes by the service or by the action.

use std::sync::Arc;

use actix::prelude::*;
use bytes::Bytes;

use super::{
    CancelFollowed, CancelGoal, CancelRejected, GoalOwner, GoalRejected, IkAction, SendGoal,
};
use crate::actors::arm::ik::read_target;
use crate::actors::node::{Asker, Call, Done, Reply, Unserved};
use crate::actors::wire::follower::{ActionRequest, GoalFollower};
use crate::actors::wire::{Address, Answered, Callable, Nodes, Route};
use crate::math::goal::Criteria;
use crate::protocol::catalog::{Action, Service, Topic};
use crate::protocol::messages::Empty;
use crate::protocol::messages::goal::GoalValues;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};

impl<const N: usize> IkAction<N> {
    /// Enters this node's services and topics into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes.serve::<SendGoal<N>>(Service::SendGoal, address.clone());
        nodes.serve::<CancelGoal>(Service::CancelGoal, address.clone());
        let requests = requests(address.clone().recipient(), address.clone().recipient());
        nodes.actions.insert(Action::MoveTo, requests);
        for topic in [Topic::IkFeedback, Topic::IkResult] {
            nodes.publishers.insert(topic, address.clone().recipient());
        }
    }
}

/// The action's goals and cancellations on their way to the node.
fn requests<const N: usize>(
    send: Recipient<Call<SendGoal<N>>>,
    cancel: Recipient<CancelFollowed>,
) -> Route<ActionRequest> {
    Box::new(move |request| match request {
        ActionRequest::Goal {
            arguments,
            follower,
            done,
        } => match SendGoal::read(Service::SendGoal, &arguments) {
            Ok(goal) => {
                let follower = Arc::new(follower);
                let reply = Reply::new(GoalSender(Arc::clone(&follower)), Some(done));
                let owner = Some(GoalOwner::Client(follower));
                let ask = SendGoal { owner, ..goal };
                send.do_send(Call { ask, reply });
            }
            Err(rejections) => follower.refuse(&rejections.status()),
        },
        ActionRequest::Cancel { from, done } => cancel.do_send(CancelFollowed { from, done }),
    })
}

/// A client that has sent a goal by the action: it hears of a refusal only, since feedback shows that it was accepted.
struct GoalSender(Arc<GoalFollower>);

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
}

impl<const N: usize> Callable for SendGoal<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let target = read_target::<N>(&mut fields);
        let epsilon = fields.number("epsilon", Bound::Positive);
        let success_hold = fields.number("success_hold", Bound::NonNegative);
        let default = Criteria::default();
        match target.filter(|_| fields.accepted()) {
            None => Err(fields.finish()),
            Some(target) => Ok(Self {
                target,
                criteria: Criteria {
                    epsilon: epsilon.unwrap_or(default.epsilon),
                    success_hold: success_hold.unwrap_or(default.success_hold),
                },
                owner: None,
            }),
        }
    }
}

impl<const N: usize> Answered for SendGoal<N> {
    fn write(answer: Result<String, GoalRejected>, to: &Address) -> Bytes {
        let values = answer.as_ref().map(|goal_id| GoalValues { goal_id });
        to.outcome(values)
    }
}

impl Callable for CancelGoal {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let goal_id = fields.text("goal_id").map(std::borrow::Cow::into_owned);
        if fields.accepted() {
            Ok(Self { goal_id })
        } else {
            Err(fields.finish())
        }
    }
}

impl Answered for CancelGoal {
    fn write(answer: Result<(), CancelRejected>, to: &Address) -> Bytes {
        to.outcome(answer.map(|()| Empty {}))
    }
}

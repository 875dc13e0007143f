//! Goals and cancellations, by the services and by the action: what each is, how it is read, how its answer is written;
//! and the news of goals.
//!
//! **Invariant:** a goal is read in the same way whether it comes by the service or by the action, and nobody has to
//! ask twice: every question says what has become of it.

use std::sync::Arc;

use actix::prelude::*;
use bytes::Bytes;

use crate::actors::arm::ik::{SolveError, read_target};
use crate::actors::arm::sim::Pose;
use crate::actors::node::{Ask, Asker, Call, Done, Reply, Unserved};
use crate::actors::wire::action_client::{ActionClient, ActionRequest, Canceller};
use crate::actors::wire::{Address, Answered, Callable, Route};
use crate::math::goal::{Criteria, Outcome};
use crate::math::kinematics::Target;
use crate::protocol::catalog::{Node, Service};
use crate::protocol::messages::Empty;
use crate::protocol::messages::goal::GoalValues;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};

/// Go there. The answer is the goal's id, given before its trajectory goes out.
#[derive(Clone)]
pub struct SendGoal<const N: usize> {
    /// The target.
    pub target: Target,
    /// When it counts as reached.
    pub criteria: Criteria,
    /// Hears how the goal goes, besides the subscribers; its being gone is nobody's trouble.
    pub owner: Option<GoalOwner<N>>,
}

impl<const N: usize> Ask for SendGoal<N> {
    type Answer = Result<String, GoalRejected>;
}

/// Who follows a goal besides the subscribers.
#[derive(Clone)]
pub enum GoalOwner<const N: usize> {
    /// A node.
    Node(Recipient<GoalNews<N>>),
    /// A client that sent it by the action.
    Client(Arc<ActionClient>),
}

/// Why a goal was not accepted; nothing has changed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum GoalRejected {
    /// There is no solution.
    #[error(transparent)]
    Unsolved(#[from] SolveError),
    /// A node has ended.
    #[error("{0} does not answer")]
    NoAnswer(
        /// Its name.
        &'static str,
    ),
}

/// The active goal is preempted; answered after its result has been published.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct CancelGoal {
    /// The goal that is meant; the active one, if none is named.
    pub goal_id: Option<String>,
}

impl Ask for CancelGoal {
    type Answer = Result<(), CancelRejected>;
}

/// The goal that the same client has sent by the action is preempted.
#[derive(Message)]
#[rtype(result = "()")]
pub struct CancelFollowed {
    /// Who wants it; an error status goes there where no such goal is active.
    pub from: Canceller,
    /// Dropped when the goal has ended.
    pub done: Done,
}

/// Why nothing was cancelled.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CancelRejected {
    /// There is nothing to cancel.
    #[error("no goal is active")]
    NotActive,
    /// Another goal was meant.
    #[error("goal_id is not that of the active goal, {active}")]
    OtherGoal {
        /// The active goal.
        active: String,
    },
    /// The arm has ended.
    #[error("{} does not answer", Node::ArmSim.name())]
    NoAnswer,
}

/// How a goal goes. To the owner that its [`SendGoal`] named.
#[derive(Message, Debug, Clone, PartialEq)]
#[rtype(result = "()")]
pub struct GoalNews<const N: usize> {
    /// The goal.
    pub goal_id: String,
    /// Distance between end effector and target \[m\].
    pub distance: f64,
    /// The setpoint that the goal commanded \[rad\].
    pub positions: [f64; N],
    /// The arm at that instant.
    pub pose: Pose<N>,
    /// How it ended; none while it is active.
    pub outcome: Option<Outcome>,
}

/// The action's goals and cancellations on their way to the node.
pub(super) fn requests<const N: usize>(
    send: Recipient<Call<SendGoal<N>>>,
    cancel: Recipient<CancelFollowed>,
) -> Route<ActionRequest> {
    Box::new(move |request| match request {
        ActionRequest::Goal {
            arguments,
            client,
            done,
        } => match SendGoal::read(Service::SendGoal, &arguments) {
            Ok(goal) => {
                let client = Arc::new(client);
                let reply = Reply::new(GoalSender(Arc::clone(&client)), Some(done));
                let owner = Some(GoalOwner::Client(client));
                let ask = SendGoal { owner, ..goal };
                send.do_send(Call { ask, reply });
            }
            Err(rejections) => client.refuse(&rejections.status()),
        },
        ActionRequest::Cancel { from, done } => cancel.do_send(CancelFollowed { from, done }),
    })
}

/// A client that has sent a goal by the action: it hears of a refusal only, since feedback shows that it was accepted.
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

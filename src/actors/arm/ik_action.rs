//! Goals: `/ik_action/send_goal` and `/ik_action/cancel_goal`, feedback on `/ik_action/feedback`, the end on
//! `/ik_action/result`.
//!
//! The arm solves a goal, and checks it at every step once it has the setpoint. Subscribers get that setpoint on
//! `/joint_trajectory`. While a goal starts, the node handles no other message, so goals do not interleave.
//!
//! **Invariant:** at most one goal is active, and each has exactly one result. A preempting goal comes in this order:
//! the old goal's result, the response, the trajectory, feedback, result.

use std::sync::Arc;

use actix::prelude::*;
use serde::Serialize;

use crate::actors::arm::sim::{
    ArmSim, CommandGoal, EndGoal, GoalOrder, GoalProgress, TrackGoal, Tracking,
};
use crate::actors::node::{
    ActionClient, Ask, Asker, Barrier, Call, Callable, CancelSent, ForwardGoal, Goal, Nodes,
    Publish, Reply, ShutDown, Unserved, Working,
};
use crate::math::goal::Outcome;
use crate::math::kinematics::Unreachable;
use crate::protocol::catalog::{Action, Service, Topic};
use crate::protocol::op::fields::Rejections;
use crate::protocol::op::{Arguments, GoalStatus};
use crate::services::goals::{AcceptedGoal, NOT_ACTIVE};
pub use crate::services::goals::{CancelRejected, CancelRequest, GoalRequest};

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `ik_action` for an arm of `N` links.
pub struct IkAction<const N: usize> {
    arm: GoalTracker<N>,
    publish: Recipient<Publish>,
    active: Option<ActiveGoal<N>>,
    /// Goals accepted so far: their numbers make the ids.
    accepted: u64,
}

/// The active goal.
struct ActiveGoal<const N: usize> {
    goal: AcceptedGoal<N>,
    /// The receiver of the goal's news besides the subscribers.
    owner: Option<GoalOwner<N>>,
    /// The status for its client if it ends before it is reached.
    if_preempted: GoalStatus,
}

/// The receiver of a goal's news besides the subscribers.
enum GoalOwner<const N: usize> {
    /// The trial.
    Node(Recipient<GoalReport<N>>),
    /// A client that sent it by the action.
    Client(Arc<ActionClient>),
}

/// The messages to the arm for goals.
#[derive(Clone)]
pub struct GoalTracker<const N: usize> {
    /// Begins a goal.
    pub track: Recipient<TrackGoal<N>>,
    /// Sends its setpoint.
    pub command: Recipient<CommandGoal<N>>,
    /// Ends it.
    pub end: Recipient<EndGoal<N>>,
}

impl<const N: usize> GoalTracker<N> {
    /// The recipients of this arm.
    #[must_use]
    pub fn of(arm: &Addr<ArmSim<N>>) -> Self {
        Self {
            track: arm.clone().recipient(),
            command: arm.clone().recipient(),
            end: arm.clone().recipient(),
        }
    }
}

impl<const N: usize> IkAction<N> {
    /// A node without a goal.
    #[must_use]
    pub fn new(arm: GoalTracker<N>, publish: Recipient<Publish>) -> Self {
        Self {
            arm,
            publish,
            active: None,
            accepted: 0,
        }
    }

    /// Adds this node's services and its action to the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes.serve::<GoalRequest<N>>(Service::SendGoal, address.clone());
        nodes.serve::<CancelRequest>(Service::CancelGoal, address.clone());
        nodes.serve_action::<GoalRequest<N>, _>(address.clone());
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// A goal of the trial. The answer is its id, sent before its trajectory is published.
pub struct SendGoal<const N: usize> {
    /// The goal.
    pub goal: GoalRequest<N>,
    /// The receiver of feedback besides the subscribers. It may end at any time.
    pub owner: Recipient<GoalReport<N>>,
}

impl<const N: usize> Ask for SendGoal<N> {
    type Answer = Result<String, Unreachable>;
}

/// The progress of a goal, for the owner in its [`SendGoal`].
#[derive(Message, Debug, Clone, PartialEq)]
#[rtype(result = "()")]
pub struct GoalReport<const N: usize> {
    /// The goal.
    pub goal: AcceptedGoal<N>,
    /// Its progress, or its end.
    pub progress: GoalProgress<N>,
}

impl<const N: usize> Goal for GoalRequest<N> {
    const ACTION: Action = Action::MoveTo;

    fn read(arguments: &Arguments) -> Result<Self, Rejections> {
        <Self as Callable>::read(Service::SendGoal, arguments)
    }
}

/// A client that has sent a goal by the action. Feedback shows that it was accepted.
struct GoalSender(Arc<ActionClient>);

impl Asker<Result<String, Unreachable>> for GoalSender {
    fn answer(
        self: Box<Self>,
        answer: Result<Result<String, Unreachable>, Unserved>,
        _: Option<Working>,
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

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for IkAction<N> {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<Call<GoalRequest<N>>> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, Call { ask, reply }: Call<GoalRequest<N>>, ctx: &mut Context<Self>) {
        self.start_goal(ask, None, reply, ctx);
    }
}

impl<const N: usize> Handler<Call<SendGoal<N>>> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, Call { ask, reply }: Call<SendGoal<N>>, ctx: &mut Context<Self>) {
        self.start_goal(ask.goal, Some(GoalOwner::Node(ask.owner)), reply, ctx);
    }
}

impl<const N: usize> Handler<ForwardGoal<GoalRequest<N>>> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, forwarded: ForwardGoal<GoalRequest<N>>, ctx: &mut Context<Self>) {
        let ForwardGoal {
            goal,
            client,
            working,
        } = forwarded;
        let client = Arc::new(client);
        let reply = Reply::new(GoalSender(Arc::clone(&client)), Some(working));
        self.start_goal(goal, Some(GoalOwner::Client(client)), reply, ctx);
    }
}

impl<const N: usize> Handler<CancelSent> for IkAction<N> {
    type Result = ();

    /// The client is informed if that goal is not active. Otherwise the goal's result is the answer.
    fn handle(&mut self, cancel: CancelSent, ctx: &mut Context<Self>) {
        let is_meant = |goal: &&ActiveGoal<N>| match &goal.owner {
            Some(GoalOwner::Client(client)) => cancel.is_of(client),
            _ => cancel.all,
        };
        let Some(goal) = self.active.as_ref().filter(is_meant) else {
            return cancel.refuse(NOT_ACTIVE);
        };
        let ended = self.end(goal.goal.number, GoalStatus::Canceled);
        ctx.wait(ended.map(move |_, _, _| drop(cancel.working)));
    }
}

impl<const N: usize> Handler<Call<CancelRequest>> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, call: Call<CancelRequest>, ctx: &mut Context<Self>) {
        let Call { ask, mut reply } = call;
        let Some(ActiveGoal { goal, .. }) = &self.active else {
            return reply.answer(Err(CancelRejected::NotActive));
        };
        if ask.goal_id.is_some_and(|id| id != goal.id) {
            let active = goal.id.clone();
            return reply.answer(Err(CancelRejected::OtherGoal { active }));
        }
        let ended = self.end(goal.number, GoalStatus::Canceled);
        ctx.wait(ended.map(move |ended, _, _| reply.answer(ended)));
    }
}

impl<const N: usize> Handler<ShutDown> for IkAction<N> {
    type Result = ResponseActFuture<Self, ()>;

    fn handle(&mut self, _: ShutDown, _: &mut Context<Self>) -> Self::Result {
        match &self.active {
            Some(goal) => {
                let ended = self.end(goal.goal.number, GoalStatus::Aborted);
                Box::pin(ended.map(|_, _, _| ()))
            }
            None => Box::pin(actix::fut::ready(())),
        }
    }
}

impl<const N: usize> Handler<GoalProgress<N>> for IkAction<N> {
    type Result = ();

    /// From the arm. News of a goal that is no longer active are discarded.
    fn handle(&mut self, progress: GoalProgress<N>, _: &mut Context<Self>) {
        if progress.outcome.is_some() {
            self.conclude(&progress);
        } else if let Some(goal) = self.active.as_ref().filter(|goal| goal.is(&progress)) {
            let accepted = goal.goal.clone();
            let feedback = move || accepted.feedback(progress.distance, progress.elapsed);
            self.publish(Topic::IkFeedback, feedback);
            goal.inform_owner(&progress);
        }
    }
}

impl<const N: usize> Handler<Barrier> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, _: Barrier, _: &mut Context<Self>) {}
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<const N: usize> ActiveGoal<N> {
    fn is(&self, progress: &GoalProgress<N>) -> bool {
        self.goal.number == progress.number
    }

    /// Informs its owner of feedback or of its end.
    fn inform_owner(&self, progress: &GoalProgress<N>) {
        match &self.owner {
            None => {}
            Some(GoalOwner::Client(client)) => {
                let distance = progress.distance;
                let status = match progress.outcome {
                    None => {
                        return client.feed_back(self.goal.feedback(distance, progress.elapsed));
                    }
                    Some(Outcome::Reached) => GoalStatus::Succeeded,
                    Some(Outcome::Preempted) => self.if_preempted,
                };
                client.conclude(self.goal.result(distance, progress.outcome), status);
            }
            Some(GoalOwner::Node(owner)) => owner.do_send(GoalReport {
                goal: self.goal.clone(),
                progress: *progress,
            }),
        }
    }
}

impl<const N: usize> IkAction<N> {
    /// Starts a goal. Its sender is answered before it is set in motion.
    fn start_goal(
        &mut self,
        goal: GoalRequest<N>,
        owner: Option<GoalOwner<N>>,
        mut reply: Reply<Result<String, Unreachable>>,
        ctx: &mut Context<Self>,
    ) {
        let GoalRequest { target, criteria } = goal;
        let order = GoalOrder {
            number: self.accepted + 1,
            target,
            criteria,
        };
        let begun = self.arm.track.send(TrackGoal {
            goal: order,
            owner: ctx.address().recipient(),
        });
        ctx.wait(begun.into_actor(self).map(move |tracking, node, _| {
            let Ok(tracking) = tracking else {
                return reply.refuse(Unserved::NO_ARM);
            };
            let is_accepted = tracking.is_ok();
            if let Ok(Some(obstacle)) = tracking.as_ref().map(|tracking| tracking.obstacle) {
                reply.warn(&obstacle.to_string());
            }
            reply.answer(tracking.map(|tracking| node.accept(&order, owner, tracking)));
            if is_accepted {
                node.set_in_motion();
            }
            drop(reply);
        }));
    }

    /// Publishes the old goal's result and replaces it by the new goal.
    fn accept(
        &mut self,
        order: &GoalOrder,
        owner: Option<GoalOwner<N>>,
        tracking: Tracking<N>,
    ) -> String {
        if let Some(before) = tracking.before {
            self.conclude(&before);
        }
        let goal = AcceptedGoal::new(order.number, order.target, tracking.positions);
        let id = goal.id.clone();
        self.accepted = order.number;
        self.active = Some(ActiveGoal {
            goal,
            owner,
            if_preempted: GoalStatus::Aborted,
        });
        id
    }

    /// Sends the active goal's setpoint to the subscribers, and then to the arm.
    fn set_in_motion(&self) {
        let Some(goal) = &self.active else {
            return;
        };
        let goal = goal.goal.clone();
        let (number, positions) = (goal.number, goal.positions);
        self.publish(Topic::JointTrajectory, move || goal.trajectory());
        self.arm.command.do_send(CommandGoal { number, positions });
    }

    /// Preempts the active goal, unless the arm has reached it already. Its client gets that `status`.
    fn end(
        &self,
        number: u64,
        status: GoalStatus,
    ) -> impl ActorFuture<Self, Output = Result<(), CancelRejected>> + use<N> {
        let ended = self.arm.end.send(EndGoal { number }).into_actor(self);
        ended.map(move |ended, node, _| {
            // An arm that has ended has no goal.
            let ended = ended.ok().flatten().ok_or(CancelRejected::NotActive)?;
            if let Some(goal) = &mut node.active {
                goal.if_preempted = status;
            }
            node.conclude(&ended);
            match ended.outcome {
                Some(Outcome::Preempted) => Ok(()),
                _ => Err(CancelRejected::NotActive),
            }
        })
    }

    /// Publishes the result of the goal and removes it. Does nothing if another goal is active.
    fn conclude(&mut self, progress: &GoalProgress<N>) {
        let Some(goal) = self.active.take_if(|goal| goal.is(progress)) else {
            return;
        };
        let (accepted, progress) = (goal.goal.clone(), *progress);
        let result = move || accepted.result(progress.distance, progress.outcome);
        self.publish(Topic::IkResult, result);
        goal.inform_owner(&progress);
    }

    /// The registry makes the message, if the topic has subscribers.
    fn publish<M: Serialize>(&self, topic: Topic, make: impl FnOnce() -> M + Send + 'static) {
        self.publish.do_send(Publish::made(topic, make));
    }
}

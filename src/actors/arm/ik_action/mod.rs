//! Goals: `/ik_action/send_goal` and `/ik_action/cancel_goal`, feedback on `/ik_action/feedback`, the end on
//! `/ik_action/result`.
//!
//! `ik` solves a goal. The arm is informed of it, and checks it at every step once it has the setpoint. Subscribers
//! get that setpoint on `/joint_trajectory`. While a goal starts, the node handles no other message, so goals do not
//! interleave.
//!
//! **Invariant:** at most one goal is active, and each has exactly one result. A preempting goal comes in this order:
//! the old goal's result, the response, the trajectory, feedback, result.

mod messages;
mod services;

use std::sync::Arc;

use actix::prelude::*;
use serde::Serialize;

pub use self::messages::{
    CancelGoal, CancelRejected, GoalOwner, GoalRejected, GoalReport, GoalSelector, SendGoal,
};
use self::services::GoalSender;
use crate::actors::arm::ik::Solve;
use crate::actors::arm::sim::{
    AddBarrier, ArmSim, CommandGoal, EndGoal, GoalOrder, GoalProgress, TrackGoal, Tracking,
    joint_names,
};
use crate::actors::node::{Barrier, Call, Interest, Publish, Reply, ShutDown, ask};
use crate::actors::wire::Nodes;
use crate::actors::wire::action_client::{CancelSent, ForwardGoal};
use crate::math::goal::Outcome;
use crate::protocol::catalog::{Node, Service, Topic};
use crate::protocol::messages::goal::{IkFeedback, IkResult, setpoint_trajectory};
use crate::protocol::op::GoalStatus;
use crate::services::goals::AcceptedGoal;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `ik_action` for an arm of `N` links.
pub struct IkAction<const N: usize> {
    ik: Recipient<Call<Solve<N>>>,
    arm: GoalTracker<N>,
    publish: Recipient<Publish>,
    active: Option<ActiveGoal<N>>,
    /// Goals accepted so far: their numbers make the ids.
    accepted: u64,
    feedback_wanted: bool,
    result_wanted: bool,
}

/// The active goal.
struct ActiveGoal<const N: usize> {
    goal: AcceptedGoal<N>,
    /// The receiver of the goal's news besides the subscribers.
    owner: Option<GoalOwner<N>>,
    /// The status for its client if it ends before it is reached.
    if_preempted: GoalStatus,
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
    /// Registers a receiver of [`Barrier`]s before the arm reports that it is at rest.
    pub add_barrier: Recipient<AddBarrier>,
}

impl<const N: usize> GoalTracker<N> {
    /// The recipients of this arm.
    #[must_use]
    pub fn of(arm: &Addr<ArmSim<N>>) -> Self {
        Self {
            track: arm.clone().recipient(),
            command: arm.clone().recipient(),
            end: arm.clone().recipient(),
            add_barrier: arm.clone().recipient(),
        }
    }
}

impl<const N: usize> IkAction<N> {
    /// A node without a goal.
    #[must_use]
    pub fn new(
        ik: Recipient<Call<Solve<N>>>,
        arm: GoalTracker<N>,
        publish: Recipient<Publish>,
    ) -> Self {
        Self {
            ik,
            arm,
            publish,
            active: None,
            accepted: 0,
            feedback_wanted: false,
            result_wanted: false,
        }
    }

    /// Adds this node's services and topics to the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes.serve::<SendGoal<N>>(Service::SendGoal, address.clone());
        nodes.serve::<CancelGoal>(Service::CancelGoal, address.clone());
        nodes.carry_out::<SendGoal<N>, _>(address.clone());
        for topic in [Topic::IkFeedback, Topic::IkResult] {
            nodes.publishers.insert(topic, address.clone().recipient());
        }
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for IkAction<N> {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Context<Self>) {
        let own = ctx.address().recipient();
        self.arm.add_barrier.do_send(AddBarrier(own));
    }
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<Call<SendGoal<N>>> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, call: Call<SendGoal<N>>, ctx: &mut Context<Self>) {
        let pursuit = self.start_goal(call.ask, call.reply, ctx.address());
        ctx.wait(pursuit);
    }
}

impl<const N: usize> Handler<ForwardGoal<SendGoal<N>>> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, forwarded: ForwardGoal<SendGoal<N>>, ctx: &mut Context<Self>) {
        let ForwardGoal { goal, client, done } = forwarded;
        let client = Arc::new(client);
        let reply = Reply::new(GoalSender(Arc::clone(&client)), Some(done));
        let owner = Some(GoalOwner::Client(client));
        let pursuit = self.start_goal(SendGoal { owner, ..goal }, reply, ctx.address());
        ctx.wait(pursuit);
    }
}

impl<const N: usize> Handler<CancelSent> for IkAction<N> {
    type Result = ();

    /// The client is informed if that goal is not active. Otherwise the goal's result is the answer.
    fn handle(&mut self, cancel: CancelSent, ctx: &mut Context<Self>) {
        let cancellation = self.end(
            &GoalSelector::Sent(cancel.goal.clone()),
            GoalStatus::Canceled,
        );
        ctx.wait(cancellation.map(move |outcome, _, _| {
            if let Err(why @ CancelRejected::NotSent) = outcome {
                cancel.refuse(&why.to_string());
            }
            drop(cancel.done);
        }));
    }
}

impl<const N: usize> Handler<Call<CancelGoal>> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, call: Call<CancelGoal>, ctx: &mut Context<Self>) {
        let mut reply = call.reply;
        let cancellation = self.end(&call.ask.goal, GoalStatus::Canceled);
        ctx.wait(cancellation.map(move |outcome, _, _| reply.answer(outcome)));
    }
}

impl<const N: usize> Handler<ShutDown> for IkAction<N> {
    type Result = ResponseActFuture<Self, ()>;

    fn handle(&mut self, _: ShutDown, _: &mut Context<Self>) -> Self::Result {
        let end = self.end(&GoalSelector::Active, GoalStatus::Aborted);
        Box::pin(end.map(|_, _, _| ()))
    }
}

impl<const N: usize> Handler<GoalProgress<N>> for IkAction<N> {
    type Result = ();

    /// From the arm. News of a goal that is no longer active are discarded.
    fn handle(&mut self, progress: GoalProgress<N>, _: &mut Context<Self>) {
        if progress.outcome.is_some() {
            self.conclude(&progress);
        } else if let Some(goal) = self.active.as_ref().filter(|goal| goal.is(&progress)) {
            if self.feedback_wanted {
                self.publish(Topic::IkFeedback, goal.feedback(&progress));
            }
            goal.inform_owner(&progress);
        }
    }
}

impl<const N: usize> Handler<Barrier> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, _: Barrier, _: &mut Context<Self>) {}
}

impl<const N: usize> Handler<Interest> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, Interest { topic, wanted }: Interest, _: &mut Context<Self>) {
        match topic {
            Topic::IkFeedback => self.feedback_wanted = wanted,
            Topic::IkResult => self.result_wanted = wanted,
            other => debug_assert!(false, "{} is not this node's", other.name()),
        }
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<const N: usize> ActiveGoal<N> {
    fn is(&self, progress: &GoalProgress<N>) -> bool {
        self.goal.number == progress.number
    }

    fn feedback(&self, progress: &GoalProgress<N>) -> IkFeedback {
        self.goal.feedback(progress.distance, progress.elapsed)
    }

    fn result(&self, progress: &GoalProgress<N>) -> IkResult {
        self.goal.result(progress.distance, progress.outcome)
    }

    fn status(&self, progress: &GoalProgress<N>) -> GoalStatus {
        match progress.outcome {
            Some(Outcome::Reached) => GoalStatus::Succeeded,
            _ => self.if_preempted,
        }
    }

    /// Whether this goal has the given id.
    fn check(&self, selector: &GoalSelector) -> Result<(), CancelRejected> {
        match (selector, &self.owner) {
            (GoalSelector::Active, _) => Ok(()),
            (GoalSelector::ById(id), _) if *id == self.goal.id => Ok(()),
            (GoalSelector::ById(_), _) => Err(CancelRejected::OtherGoal {
                active: self.goal.id.clone(),
            }),
            (GoalSelector::Sent(goal), Some(GoalOwner::Client(client))) if client.is(goal) => {
                Ok(())
            }
            (GoalSelector::Sent(_), _) => Err(CancelRejected::NotSent),
        }
    }

    /// Informs its owner of feedback or of its end.
    fn inform_owner(&self, progress: &GoalProgress<N>) {
        match &self.owner {
            None => {}
            Some(GoalOwner::Client(client)) => match progress.outcome {
                None => client.feed_back(self.feedback(progress)),
                Some(_) => client.conclude(self.result(progress), self.status(progress)),
            },
            Some(GoalOwner::Node(owner)) => owner.do_send(GoalReport {
                goal_id: self.goal.id.clone(),
                distance: progress.distance,
                positions: self.goal.positions,
                pose: progress.pose,
                outcome: progress.outcome,
            }),
        }
    }
}

impl<const N: usize> IkAction<N> {
    /// Solves a goal and starts it. Its sender is answered in between.
    fn start_goal(
        &self,
        goal: SendGoal<N>,
        mut reply: Reply<Result<String, GoalRejected>>,
        own: Addr<Self>,
    ) -> ResponseActFuture<Self, ()> {
        let (ik, arm) = (self.ik.clone(), self.arm.track.clone());
        let number = self.accepted + 1;
        let (target, criteria) = (goal.target, goal.criteria);
        let begun = async move {
            let solution = ask(&ik, Solve(target)).await;
            let solution = solution.map_err(|_| GoalRejected::NoAnswer(Node::Ik.name()))??;
            let goal = GoalOrder {
                number,
                target: target.position,
                criteria,
                solution,
            };
            let owner = own.recipient();
            let tracking = arm.send(TrackGoal { goal, owner }).await;
            tracking.map_err(|_| GoalRejected::NoAnswer(Node::ArmSim.name()))
        };
        Box::pin(begun.into_actor(self).map(move |tracking, node, _| {
            let is_accepted = tracking.is_ok();
            if let Ok(Some(obstacle)) = tracking.as_ref().map(|tracking| tracking.obstacle) {
                reply.warn(&obstacle.to_string());
            }
            reply.answer(tracking.map(|tracking| node.accept(number, goal, tracking)));
            if is_accepted {
                node.set_in_motion();
            }
            drop(reply);
        }))
    }

    /// Publishes the old goal's result and replaces it by the new goal.
    fn accept(&mut self, number: u64, goal: SendGoal<N>, tracking: Tracking<N>) -> String {
        if let Some(before) = tracking.before {
            self.conclude(&before);
        }
        let accepted = AcceptedGoal::new(number, goal.target, tracking.positions);
        let id = accepted.id.clone();
        self.accepted = number;
        self.active = Some(ActiveGoal {
            goal: accepted,
            owner: goal.owner,
            if_preempted: GoalStatus::Aborted,
        });
        id
    }

    /// Sends the active goal's setpoint to the subscribers, and then to the arm.
    fn set_in_motion(&self) {
        let Some(goal) = &self.active else {
            return;
        };
        let (number, positions) = (goal.goal.number, goal.goal.positions);
        let trajectory = move || setpoint_trajectory(&joint_names::<N>(), &positions);
        self.publish
            .do_send(Publish::made(Topic::JointTrajectory, trajectory));
        self.arm.command.do_send(CommandGoal { number, positions });
    }

    /// Preempts the active goal if it has the given id and the arm has not reached it yet. Its client gets that
    /// `status`.
    fn end(
        &self,
        selector: &GoalSelector,
        status: GoalStatus,
    ) -> ResponseActFuture<Self, Result<(), CancelRejected>> {
        let number = match (&self.active, selector) {
            (None, GoalSelector::Sent(_)) => Err(CancelRejected::NotSent),
            (None, _) => Err(CancelRejected::NotActive),
            (Some(goal), _) => goal.check(selector).map(|()| goal.goal.number),
        };
        let arm = self.arm.end.clone();
        let ended = async move {
            let number = number?;
            let ended = arm.send(EndGoal { number }).await;
            ended.map_err(|_| CancelRejected::NoAnswer)
        };
        Box::pin(ended.into_actor(self).map(move |ended, node, _| {
            let ended = ended?.ok_or(CancelRejected::NotActive)?;
            if let Some(goal) = &mut node.active {
                goal.if_preempted = status;
            }
            node.conclude(&ended);
            match ended.outcome {
                Some(Outcome::Preempted) => Ok(()),
                _ => Err(CancelRejected::NotActive),
            }
        }))
    }

    /// Publishes the result of the goal and removes it. Does nothing if another goal is active.
    fn conclude(&mut self, progress: &GoalProgress<N>) {
        let Some(goal) = self.active.take_if(|goal| goal.is(progress)) else {
            return;
        };
        if self.result_wanted {
            self.publish(Topic::IkResult, goal.result(progress));
        }
        goal.inform_owner(progress);
    }

    fn publish(&self, topic: Topic, message: impl Serialize + Send + 'static) {
        self.publish.do_send(Publish::made(topic, move || message));
    }
}

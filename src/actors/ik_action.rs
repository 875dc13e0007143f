//! Goals: `/ik_action/send_goal` and `/ik_action/cancel_goal`, progress on `/ik_action/feedback`, the end on
//! `/ik_action/result`.
//!
//! A goal is solved by `ik`, announced to the arm, which judges it at every step, and set in motion by a trajectory on
//! `/joint_trajectory`. While that is under way the node hears nothing else, so that goals follow one another whole.
//!
//! **Invariant:** at most one goal is active, and each has exactly one result. A preempting goal comes in this order:
//! the old goal's result, the response, the trajectory, feedback, result.

use actix::prelude::*;
use tokio::sync::oneshot;

use super::arm_sim::{EndGoal, GoalJudged, Pose, TrackGoal, Tracking, joint_names};
use super::follower::{ActionRequest, Follower, GoalStatus};
use super::ik::{Solve, SolveError, read_target};
use super::node::{Interest, Reply, ServiceCall};
use super::registry::{Nodes, Publish};
use crate::math::goal::{Criteria, Outcome};
use crate::math::kinematics::Target;
use crate::protocol::catalog::{Action, Node, Service, Topic};
use crate::protocol::fields::{Bound, Fields};
use crate::protocol::goal_messages::{
    GoalValues, IkFeedback, IkResult, TargetMessage, setpoint_trajectory,
};
use crate::protocol::messages::{self, Empty};
use crate::protocol::op::Arguments;

/// What a client hears that wants a goal to end which it has not sent, or which has ended.
const NOT_ACTIVE: &str = "id must be that of this connection's active goal";

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `ik_action` for an arm of `N` links.
pub struct IkAction<const N: usize> {
    ik: Recipient<Solve<N>>,
    arm: GoalTracker<N>,
    publish: Recipient<Publish>,
    active: Option<ActiveGoal<N>>,
    /// Goals accepted so far: their numbers make the ids.
    accepted: u64,
    feedback_wanted: bool,
    result_wanted: bool,
}

/// The arm, as far as goals are concerned.
#[derive(Clone)]
pub struct GoalTracker<const N: usize> {
    /// Begins a goal.
    pub track: Recipient<TrackGoal<N>>,
    /// Ends it.
    pub end: Recipient<EndGoal<N>>,
}

/// The goal that is being pursued.
struct ActiveGoal<const N: usize> {
    number: u64,
    id: String,
    target: Target,
    /// The setpoint that was sent \[rad\].
    positions: [f64; N],
    /// Who follows it besides the subscribers.
    owner: Option<Recipient<GoalNews<N>>>,
    /// The client that sent it by the action.
    follower: Option<Follower>,
    /// Somebody has asked for its end.
    cancelled: bool,
}

/// Who sent a goal, and how it is answered.
enum Caller {
    /// By the service.
    Service(Reply),
    /// By the action; the second value is dropped once the goal is under way.
    Action(
        Option<Follower>,
        #[expect(dead_code, reason = "its end is the news")] oneshot::Sender<()>,
    ),
    /// Another node, which gets the answer as a value.
    Node,
}

impl<const N: usize> IkAction<N> {
    /// A node without a goal.
    #[must_use]
    pub fn new(ik: Recipient<Solve<N>>, arm: GoalTracker<N>, publish: Recipient<Publish>) -> Self {
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

    /// Enters this node's services and topics into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        for service in Service::ALL {
            if service.owner() == Node::IkAction {
                nodes.services.insert(service, address.clone().recipient());
            }
        }
        let pursuer = address.clone().recipient();
        nodes.actions.insert(Action::MoveTo, pursuer);
        for topic in [Topic::IkFeedback, Topic::IkResult] {
            nodes.publishers.insert(topic, address.clone().recipient());
        }
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// Go there. From `ik_trial`; the answer is the goal's id, once its trajectory is on its way.
#[derive(Message, Clone)]
#[rtype(result = "Result<String, GoalRejected>")]
pub struct SendGoal<const N: usize> {
    /// Where to.
    pub target: Target,
    /// When it counts as reached.
    pub criteria: Criteria,
    /// Hears how the goal goes; its being gone is nobody's trouble.
    pub owner: Option<Recipient<GoalNews<N>>>,
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

/// The active goal is preempted. From `ik_trial`; the answer comes after its result has been published.
#[derive(Message, Debug, Clone)]
#[rtype(result = "Result<(), CancelRejected>")]
pub struct CancelGoal {
    /// Which goal is meant; whichever is active, if none is named.
    pub goal_id: Option<String>,
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
    #[error("arm_sim does not answer")]
    NoAnswer,
}

/// How a goal goes. To the owner that its [`SendGoal`] named.
#[derive(Message, Debug, Clone, PartialEq)]
#[rtype(result = "()")]
pub struct GoalNews<const N: usize> {
    /// The goal.
    pub goal_id: String,
    /// Distance between hand and target \[m\].
    pub distance: f64,
    /// The setpoint that the goal commanded \[rad\].
    pub positions: [f64; N],
    /// The arm at that instant.
    pub pose: Pose<N>,
    /// How it ended; none while it is active.
    pub outcome: Option<Outcome>,
}

/// Answered when all that reached this node before has been dealt with. From `ik_trial`, which so hears all that the
/// arm had said about goals before it gave the time.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "()")]
pub struct Settle;

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for IkAction<N> {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<ServiceCall> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, call: ServiceCall, ctx: &mut Context<Self>) {
        let mut reply = call.reply;
        if call.service == Service::SendGoal {
            match read_goal(&call.arguments) {
                Ok(goal) => {
                    let pursuit = self.pursue(goal, Caller::Service(reply), ctx.address());
                    ctx.wait(pursuit.map(|_, _, _| ()));
                }
                Err(why) => reply.refuse(&why),
            }
        } else {
            match read_cancellation(&call.arguments) {
                Ok(goal_id) => {
                    let cancellation = self.cancel(goal_id.as_deref());
                    ctx.wait(cancellation.map(move |outcome, _, _| match outcome {
                        Ok(()) => reply.succeed(&Empty {}),
                        Err(why) => reply.refuse(&why.to_string()),
                    }));
                }
                Err(why) => reply.refuse(&why),
            }
        }
    }
}

impl<const N: usize> Handler<ActionRequest> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, request: ActionRequest, ctx: &mut Context<Self>) {
        match request {
            ActionRequest::Goal {
                arguments,
                follower,
                done,
            } => match read_goal(&arguments) {
                Ok(goal) => {
                    let caller = Caller::Action(Some(follower), done);
                    let pursuit = self.pursue(goal, caller, ctx.address());
                    ctx.wait(pursuit.map(|_, _, _| ()));
                }
                Err(why) => follower.refuse(&why),
            },
            ActionRequest::Cancel { from, done } => {
                let goal = self.active.as_ref().filter(|goal| {
                    let follower = goal.follower.as_ref();
                    follower.is_some_and(|follower| follower.is_meant_by(&from))
                });
                let Some(id) = goal.map(|goal| goal.id.clone()) else {
                    return from.refuse(NOT_ACTIVE);
                };
                let cancellation = self.cancel(Some(&id));
                ctx.wait(cancellation.map(move |_, _, _| drop(done)));
            }
        }
    }
}

impl<const N: usize> Handler<SendGoal<N>> for IkAction<N> {
    type Result = AtomicResponse<Self, Result<String, GoalRejected>>;

    fn handle(&mut self, goal: SendGoal<N>, ctx: &mut Context<Self>) -> Self::Result {
        AtomicResponse::new(self.pursue(goal, Caller::Node, ctx.address()))
    }
}

impl<const N: usize> Handler<CancelGoal> for IkAction<N> {
    type Result = AtomicResponse<Self, Result<(), CancelRejected>>;

    fn handle(&mut self, message: CancelGoal, _: &mut Context<Self>) -> Self::Result {
        AtomicResponse::new(self.cancel(message.goal_id.as_deref()))
    }
}

impl<const N: usize> Handler<GoalJudged<N>> for IkAction<N> {
    type Result = ();

    /// From the arm. Word of a goal that is not active any more comes too late to be passed on.
    fn handle(&mut self, judged: GoalJudged<N>, _: &mut Context<Self>) {
        if judged.outcome.is_some() {
            self.conclude(&judged);
        } else if let Some(goal) = self.active.as_ref().filter(|goal| goal.is(&judged)) {
            if self.feedback_wanted {
                self.publish(Topic::IkFeedback, &goal.feedback(&judged));
            }
            if let Some(follower) = &goal.follower {
                follower.feed_back(&goal.feedback(&judged));
            }
            goal.tell_owner(&judged);
        }
    }
}

impl<const N: usize> Handler<Settle> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, _: Settle, _: &mut Context<Self>) {}
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

impl<const N: usize> IkAction<N> {
    /// Solves a goal and sets it in motion; a client is answered in its place between old and new.
    fn pursue(
        &self,
        goal: SendGoal<N>,
        mut caller: Caller,
        own: Addr<Self>,
    ) -> ResponseActFuture<Self, Result<String, GoalRejected>> {
        let (ik, arm) = (self.ik.clone(), self.arm.track.clone());
        let number = self.accepted + 1;
        let (target, criteria) = (goal.target, goal.criteria);
        let begun = async move {
            let solution = ik.send(Solve(target)).await;
            let solution = solution.map_err(|_| GoalRejected::NoAnswer(Node::Ik.name()))??;
            arm.send(TrackGoal {
                number,
                target: target.position,
                criteria,
                solution,
                owner: own.recipient(),
            })
            .await
            .map_err(|_| GoalRejected::NoAnswer(Node::ArmSim.name()))
        };
        let set_off = move |tracking: Result<_, GoalRejected>, node: &mut Self, _: &mut _| {
            let outcome = tracking.map(|tracking| node.accept(number, goal, tracking));
            match (&mut caller, &outcome) {
                (Caller::Service(reply), Ok(goal_id)) => reply.succeed(&GoalValues { goal_id }),
                (Caller::Service(reply), Err(why)) => reply.refuse(&why.to_string()),
                (Caller::Action(follower, _), Ok(_)) => {
                    if let Some(goal) = &mut node.active {
                        goal.follower = follower.take();
                    }
                }
                (Caller::Action(follower, _), Err(why)) => {
                    if let Some(follower) = follower {
                        follower.refuse(&why.to_string());
                    }
                }
                (Caller::Node, _) => {}
            }
            let trajectory = outcome.is_ok().then(|| node.trajectory());
            let publish = node.publish.clone();
            async move {
                // Once the registry has it, it is on its way to the arm, before anything that is asked of the arm later.
                if let Some(trajectory) = trajectory.flatten() {
                    let _ = publish.send(trajectory).await;
                }
                drop(caller);
                outcome
            }
            .into_actor(node)
        };
        Box::pin(begun.into_actor(self).then(set_off))
    }

    /// The old goal's result goes out, and the new goal takes its place.
    fn accept(&mut self, number: u64, goal: SendGoal<N>, tracking: Tracking<N>) -> String {
        if let Some(before) = tracking.before {
            self.conclude(&before);
        }
        let id = format!("goal-{number}");
        self.accepted = number;
        self.active = Some(ActiveGoal {
            number,
            id: id.clone(),
            target: goal.target,
            positions: tracking.positions,
            owner: goal.owner,
            follower: None,
            cancelled: false,
        });
        id
    }

    /// The active goal's setpoint, for the arm and for whoever subscribes.
    fn trajectory(&self) -> Option<Publish> {
        let goal = self.active.as_ref()?;
        let msg = setpoint_trajectory(&joint_names::<N>(), &goal.positions);
        Some(Publish {
            topic: Topic::JointTrajectory,
            frame: messages::publish_raw(Topic::JointTrajectory.name(), &msg),
            msg: Some(msg),
        })
    }

    /// Preempts the active goal if it is the one that is meant, and if the arm has not found it reached already.
    fn cancel(&self, goal_id: Option<&str>) -> ResponseActFuture<Self, Result<(), CancelRejected>> {
        let number = match &self.active {
            None => Err(CancelRejected::NotActive),
            Some(goal) if goal_id.is_some_and(|id| id != goal.id) => {
                Err(CancelRejected::OtherGoal {
                    active: goal.id.clone(),
                })
            }
            Some(goal) => Ok(goal.number),
        };
        let arm = self.arm.end.clone();
        let ended = async move {
            let number = number?;
            let ended = arm.send(EndGoal { number }).await;
            ended.map_err(|_| CancelRejected::NoAnswer)
        };
        Box::pin(ended.into_actor(self).map(|ended, node, _| {
            let ended = ended?.ok_or(CancelRejected::NotActive)?;
            if let Some(goal) = &mut node.active {
                goal.cancelled = true;
            }
            node.conclude(&ended);
            match ended.outcome {
                Some(Outcome::Preempted) => Ok(()),
                _ => Err(CancelRejected::NotActive),
            }
        }))
    }

    /// Publishes the goal's result, if the goal is still the active one, which then it is no more.
    fn conclude(&mut self, judged: &GoalJudged<N>) {
        let Some(goal) = self.active.take_if(|goal| goal.is(judged)) else {
            return;
        };
        if self.result_wanted {
            self.publish(Topic::IkResult, &goal.result(judged));
        }
        if let Some(follower) = &goal.follower {
            follower.conclude(&goal.result(judged), goal.status(judged));
        }
        goal.tell_owner(judged);
    }

    fn publish(&self, topic: Topic, message: &impl serde::Serialize) {
        self.publish.do_send(Publish {
            topic,
            frame: messages::publish(topic.name(), message),
            msg: None,
        });
    }
}

impl<const N: usize> ActiveGoal<N> {
    fn is(&self, judged: &GoalJudged<N>) -> bool {
        self.number == judged.number
    }

    fn feedback(&self, judged: &GoalJudged<N>) -> IkFeedback<'_> {
        IkFeedback {
            goal_id: &self.id,
            target: target_message(&self.target),
            positions: &self.positions,
            distance_remaining: judged.distance,
            elapsed: judged.elapsed,
        }
    }

    fn result(&self, judged: &GoalJudged<N>) -> IkResult<'_> {
        IkResult {
            goal_id: &self.id,
            outcome: judged.outcome.map_or("", Outcome::name),
            target: target_message(&self.target),
            final_distance: judged.distance,
        }
    }

    fn status(&self, judged: &GoalJudged<N>) -> GoalStatus {
        match judged.outcome {
            Some(Outcome::Reached) => GoalStatus::Succeeded,
            _ if self.cancelled => GoalStatus::Canceled,
            _ => GoalStatus::Aborted,
        }
    }

    fn tell_owner(&self, judged: &GoalJudged<N>) {
        if let Some(owner) = &self.owner {
            owner.do_send(GoalNews {
                goal_id: self.id.clone(),
                distance: judged.distance,
                positions: self.positions,
                pose: judged.pose,
                outcome: judged.outcome,
            });
        }
    }
}

/// A target as messages show it.
pub(super) fn target_message(target: &Target) -> TargetMessage {
    TargetMessage {
        x: target.position.x,
        y: target.position.y,
        phi: target.orientation,
    }
}

/// Reads a goal; all or nothing, and every field that is wrong is named.
fn read_goal<const N: usize>(arguments: &Arguments) -> Result<SendGoal<N>, String> {
    let mut fields = Fields::read(arguments, Service::SendGoal).map_err(|why| why.to_string())?;
    let target = read_target::<N>(&mut fields);
    let epsilon = fields.number("epsilon", Bound::Positive);
    let success_hold = fields.number("success_hold", Bound::NonNegative);
    let default = Criteria::default();
    match target.filter(|_| fields.accepted()) {
        None => Err(fields.status()),
        Some(target) => Ok(SendGoal {
            target,
            criteria: Criteria {
                epsilon: epsilon.unwrap_or(default.epsilon),
                success_hold: success_hold.unwrap_or(default.success_hold),
            },
            owner: None,
        }),
    }
}

fn read_cancellation(arguments: &Arguments) -> Result<Option<String>, String> {
    let mut fields = Fields::read(arguments, Service::CancelGoal).map_err(|why| why.to_string())?;
    let goal_id = fields.text("goal_id");
    if fields.accepted() {
        Ok(goal_id.map(std::borrow::Cow::into_owned))
    } else {
        Err(fields.status())
    }
}

//! Goals: `/ik_action/send_goal` and `/ik_action/cancel_goal`, feedback on `/ik_action/feedback`, the end on
//! `/ik_action/result`. The rules are in `live::ik_action`.
//!
//! The arm solves a goal, and checks it at every step once it has the setpoint. Subscribers get that setpoint on
//! `/joint_trajectory`.
//!
//! **Invariant:** while a goal starts or ends, the node handles no other message, so goals do not interleave.

use std::sync::Arc;

use actix::prelude::*;

use crate::actors::arm::sim::{CommandGoal, EndGoal, GoalProgress, Obstacle, TrackGoal};
use crate::actors::node::{
    ActionClient, Ask, Barrier, Call, CancelSent, ForwardGoal, Nodes, Publish, SentGoal, ShutDown,
    Unserved,
};
pub use crate::live::GoalReport;
use crate::live::{IkGoals, cancelled};
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
    goals: IkGoals<N, GoalOwner<N>>,
}

/// The receiver of a goal's news besides the subscribers.
#[derive(Clone, Default)]
enum GoalOwner<const N: usize> {
    /// Nobody: a client that called the service.
    #[default]
    Subscribers,
    /// The trial.
    Node(Recipient<GoalReport<N>>),
    /// A client that sent it by the action.
    Client(Arc<ActionClient>),
}

/// A goal that the arm tracks, and the reason why it does not move yet.
type Begun<const N: usize> = Result<(AcceptedGoal<N>, Option<Obstacle>), Unreachable>;

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

impl<const N: usize> IkAction<N> {
    /// A node without a goal.
    #[must_use]
    pub fn new(arm: GoalTracker<N>, publish: Recipient<Publish>) -> Self {
        Self {
            arm,
            publish,
            goals: IkGoals::default(),
        }
    }

    /// Adds this node's services and its action to the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes.serve::<GoalRequest<N>>(Service::SendGoal, address.clone());
        nodes.serve::<CancelRequest>(Service::CancelGoal, address.clone());
        nodes.serve_action::<GoalRequest<N>, _>(address.clone());
    }

    /// The arm begins the goal, in place of the previous one. Answer its sender, then call [`Self::set_in_motion`].
    fn begin(
        &self,
        goal: GoalRequest<N>,
        owner: GoalOwner<N>,
        ctx: &Context<Self>,
    ) -> impl ActorFuture<Self, Output = Result<Begun<N>, Unserved>> + use<N> {
        let order = self.goals.order(goal);
        let tracking = self.arm.track.send(TrackGoal {
            goal: order,
            owner: ctx.address().recipient(),
        });
        tracking.into_actor(self).map(move |tracking, node, _| {
            let tracking = tracking.map_err(|_| Unserved::NO_ARM)?;
            Ok(tracking.map(|tracking| {
                let (before, goal) = node.goals.accept(&order, owner, &tracking);
                node.pass_on(before, GoalStatus::Aborted);
                (goal, tracking.obstacle)
            }))
        })
    }

    /// Sends the goal's setpoint to the subscribers, and then to the arm.
    fn set_in_motion(&self, goal: AcceptedGoal<N>) {
        let (number, positions) = (goal.number, goal.positions);
        let trajectory = Publish::made(Topic::JointTrajectory, move || goal.trajectory());
        self.publish.do_send(trajectory);
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
            let latest = ended.ok().flatten();
            let report = latest.and_then(|latest| node.goals.report(latest));
            node.pass_on(report, status);
            cancelled(latest)
        })
    }

    /// Publishes feedback or a result, and informs the owner. The client of a preempted goal gets the status
    /// `if_preempted`.
    fn pass_on(&self, report: Option<(GoalReport<N>, GoalOwner<N>)>, if_preempted: GoalStatus) {
        let Some((report, owner)) = report else {
            return;
        };
        let (topic, frame) = report.message();
        let frame = Box::new(frame);
        self.publish.do_send(Publish { topic, frame });
        match owner {
            GoalOwner::Subscribers => {}
            GoalOwner::Node(owner) => owner.do_send(report),
            GoalOwner::Client(client) => {
                let GoalReport { goal, progress } = report;
                let status = match progress.outcome {
                    None => {
                        let feedback = goal.feedback(progress.distance, progress.elapsed);
                        return client.feed_back(feedback);
                    }
                    Some(Outcome::Reached) => GoalStatus::Succeeded,
                    Some(Outcome::Preempted) => if_preempted,
                };
                client.conclude(goal.result(progress.distance, progress.outcome), status);
            }
        }
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// A goal of the trial. The answer is its id; `None` if it is refused.
#[derive(Message)]
#[rtype(result = "Option<String>")]
pub struct SendGoal<const N: usize> {
    /// The goal.
    pub goal: GoalRequest<N>,
    /// The receiver of feedback besides the subscribers. It may end at any time.
    pub owner: Recipient<GoalReport<N>>,
}

/// For the owner in its [`SendGoal`].
impl<const N: usize> Message for GoalReport<N> {
    type Result = ();
}

impl<const N: usize> SentGoal for GoalRequest<N> {
    const ACTION: Action = Action::MoveTo;

    fn read(arguments: &Arguments) -> Result<Self, Rejections> {
        <Self as Ask>::read(Service::SendGoal, arguments)
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for IkAction<N> {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<Call<GoalRequest<N>>> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, Call { ask, mut reply }: Call<GoalRequest<N>>, ctx: &mut Context<Self>) {
        let begun = self.begin(ask, GoalOwner::Subscribers, ctx);
        ctx.wait(begun.map(move |begun, node, _| match begun {
            Ok(Ok((goal, obstacle))) => {
                if let Some(obstacle) = obstacle {
                    reply.warn(&obstacle.to_string());
                }
                reply.answer(Ok(goal.id.clone()));
                node.set_in_motion(goal);
            }
            Ok(Err(why)) => reply.conclude(Err(why)),
            Err(why) => reply.refuse(why),
        }));
    }
}

impl<const N: usize> Handler<SendGoal<N>> for IkAction<N> {
    type Result = AtomicResponse<Self, Option<String>>;

    fn handle(
        &mut self,
        SendGoal { goal, owner }: SendGoal<N>,
        ctx: &mut Context<Self>,
    ) -> Self::Result {
        let begun = self.begin(goal, GoalOwner::Node(owner), ctx);
        AtomicResponse::new(Box::pin(begun.map(|begun, node, _| {
            let (goal, _) = begun.ok()?.ok()?;
            let id = goal.id.clone();
            node.set_in_motion(goal);
            Some(id)
        })))
    }
}

impl<const N: usize> Handler<ForwardGoal<GoalRequest<N>>> for IkAction<N> {
    type Result = ();

    /// Feedback shows the client that its goal was accepted.
    fn handle(&mut self, forwarded: ForwardGoal<GoalRequest<N>>, ctx: &mut Context<Self>) {
        let ForwardGoal {
            goal,
            client,
            working,
        } = forwarded;
        let client = Arc::new(client);
        let begun = self.begin(goal, GoalOwner::Client(Arc::clone(&client)), ctx);
        ctx.wait(begun.map(move |begun, node, _| {
            match begun {
                Ok(Ok((goal, obstacle))) => {
                    if let Some(obstacle) = obstacle {
                        client.warn(&obstacle.to_string());
                    }
                    node.set_in_motion(goal);
                }
                Ok(Err(why)) => client.refuse(&why.to_string()),
                Err(why) => client.refuse(&why.to_string()),
            }
            drop(working);
        }));
    }
}

impl<const N: usize> Handler<CancelSent> for IkAction<N> {
    type Result = ();

    /// The client is informed if that goal is not active. Otherwise the goal's result is the answer.
    fn handle(&mut self, cancel: CancelSent, ctx: &mut Context<Self>) {
        let number = match self.goals.active() {
            Some((goal, GoalOwner::Client(client))) if cancel.is_of(client) => goal.number,
            Some((goal, GoalOwner::Subscribers | GoalOwner::Node(_))) if cancel.all => goal.number,
            _ => return cancel.refuse(NOT_ACTIVE),
        };
        let ended = self.end(number, GoalStatus::Canceled);
        ctx.wait(ended.map(move |_, _, _| drop(cancel.working)));
    }
}

impl<const N: usize> Handler<Call<CancelRequest>> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, call: Call<CancelRequest>, ctx: &mut Context<Self>) {
        let Call { ask, mut reply } = call;
        let number = match self.goals.to_cancel(ask.goal_id.as_deref()) {
            Ok(number) => number,
            Err(why) => return reply.answer(Err(why)),
        };
        let ended = self.end(number, GoalStatus::Canceled);
        ctx.wait(ended.map(move |ended, _, _| reply.answer(ended)));
    }
}

impl<const N: usize> Handler<ShutDown> for IkAction<N> {
    type Result = ResponseActFuture<Self, ()>;

    fn handle(&mut self, _: ShutDown, _: &mut Context<Self>) -> Self::Result {
        match self.goals.active() {
            Some((goal, _)) => {
                let ended = self.end(goal.number, GoalStatus::Aborted);
                Box::pin(ended.map(|_, _, _| ()))
            }
            None => Box::pin(actix::fut::ready(())),
        }
    }
}

impl<const N: usize> Handler<GoalProgress<N>> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, progress: GoalProgress<N>, _: &mut Context<Self>) {
        let report = self.goals.report(progress);
        self.pass_on(report, GoalStatus::Aborted);
    }
}

impl<const N: usize> Handler<Barrier> for IkAction<N> {
    type Result = ();

    fn handle(&mut self, _: Barrier, _: &mut Context<Self>) {}
}

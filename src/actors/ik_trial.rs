//! Timed trials: `/ik_trial/start`, `/ik_trial/skip`, `/ik_trial/stop`, and the state of things on `/ik_trial/status`.
//!
//! The rules are `math::trial`'s. The node asks the arm for lengths and simulation time before it does anything, and
//! moves it through `ik_action` only. What it wants done there it does whole before it hears of anything else.
//!
//! **Invariant:** time and goals' news are taken in the order in which the arm gave them; nothing ticks while no trial
//! runs and nobody watches.

use std::time::Duration;

use actix::prelude::*;

use super::arm_sim::{ArmPose, Pose};
use super::ik_action::{CancelGoal, GoalNews, SendGoal, Settle, target_message};
use super::node::{Interest, Reply, ServiceCall};
use super::registry::{Nodes, Publish};
use crate::math::trial::{Action, Changes, Conclusion, Rejection, Settings, Trial, sample};
use crate::protocol::catalog::{Node, Service, Topic};
use crate::protocol::fields::{Bound, Fields};
use crate::protocol::goal_messages::{TrialStatus, TrialValues};
use crate::protocol::messages::{self, Empty};
use crate::protocol::op::Arguments;

/// Time between two messages of `/ik_trial/status` while nothing changes.
pub const STATUS_PERIOD: Duration = Duration::from_millis(100);
/// Least time before the clock is looked at again to see whether a trial is over: what remains of it may take long, if
/// the arm is paused or slow.
const SHORTEST_NAP: Duration = Duration::from_millis(20);
/// Longest such time: a timer can't be set to any number of seconds that a client may think of.
const LONGEST_NAP: Duration = Duration::from_secs(3600);

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `ik_trial` for an arm of `N` links.
pub struct IkTrial<const N: usize> {
    arm: Recipient<ArmPose<N>>,
    goals: GoalClient<N>,
    publish: Recipient<Publish>,
    trial: Trial,
    rng: fastrand::Rng,
    /// Lengths as last heard \[m\].
    lengths: [f64; N],
    /// Simulation time as last heard \[s\].
    simulated: f64,
    status_wanted: bool,
    /// A timer for `/ik_trial/status`, while somebody watches.
    status_timer: Option<SpawnHandle>,
    /// The arm has been asked for the time of a status: one question at a time.
    status_asked: bool,
    /// A timer for the end of the trial, while one runs.
    deadline: Option<SpawnHandle>,
}

/// `ik_action`, as its client sees it.
#[derive(Clone)]
pub struct GoalClient<const N: usize> {
    /// Sends a goal.
    pub send: Recipient<SendGoal<N>>,
    /// Cancels it.
    pub cancel: Recipient<CancelGoal>,
    /// Waits until the news so far have arrived.
    pub settle: Recipient<Settle>,
}

impl<const N: usize> IkTrial<N> {
    /// A node that has not run a trial yet; the targets come from `rng`.
    #[must_use]
    pub fn new(
        arm: Recipient<ArmPose<N>>,
        goals: GoalClient<N>,
        publish: Recipient<Publish>,
        rng: fastrand::Rng,
    ) -> Self {
        Self {
            arm,
            goals,
            publish,
            trial: Trial::default(),
            rng,
            lengths: [1.0; N],
            simulated: 0.0,
            status_wanted: false,
            status_timer: None,
            status_asked: false,
            deadline: None,
        }
    }

    /// Enters this node's services and its topic into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        for service in Service::ALL {
            if service.owner() == Node::IkTrial {
                nodes.services.insert(service, address.clone().recipient());
            }
        }
        let node = address.clone().recipient();
        nodes.publishers.insert(Topic::TrialStatus, node);
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// The arm's answer, and what it was asked for. From this node to itself, so that it stands behind all the news that
/// the arm gave before.
#[derive(Message)]
#[rtype(result = "()")]
struct PoseTold<const N: usize> {
    /// None if the arm has ended.
    pose: Option<Pose<N>>,
    occasion: Occasion,
}

/// What the node does once it knows lengths and time.
enum Occasion {
    Start(Changes, Reply),
    Skip(Reply),
    Stop(Reply),
    /// The trial may be over.
    Deadline,
    /// A status is due.
    Status,
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for IkTrial<N> {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<ServiceCall> for IkTrial<N> {
    type Result = ();

    fn handle(&mut self, call: ServiceCall, ctx: &mut Context<Self>) {
        let mut reply = call.reply;
        let occasion = match (call.service, read_changes(&call.arguments, call.service)) {
            (Service::TrialStart, Ok(changes)) => Occasion::Start(changes, reply),
            (Service::TrialStart, Err(why)) => return reply.answer(&self.values(), &why),
            (_, Err(why)) => return reply.refuse(&why),
            (Service::TrialSkip, Ok(_)) => Occasion::Skip(reply),
            (_, Ok(_)) => Occasion::Stop(reply),
        };
        self.ask(occasion, ctx);
    }
}

impl<const N: usize> Handler<PoseTold<N>> for IkTrial<N> {
    type Result = ();

    fn handle(&mut self, told: PoseTold<N>, ctx: &mut Context<Self>) {
        let Some(pose) = told.pose else {
            return told.occasion.refuse("arm_sim does not answer");
        };
        let mut actions = self.hear(&pose);
        let target = || sample(&self.lengths, &mut self.rng);
        let (decided, owed) = match told.occasion {
            Occasion::Start(changes, reply) => {
                let decided = self.trial.start(self.simulated, changes, target);
                if decided.is_ok() {
                    self.cancel_deadline(ctx);
                }
                (decided, Some(Owed::Values(reply)))
            }
            Occasion::Skip(reply) => (self.trial.skip(target), Some(Owed::Nothing(reply))),
            Occasion::Stop(reply) => (self.trial.stop(), Some(Owed::Nothing(reply))),
            Occasion::Deadline => (Ok(Vec::new()), None),
            Occasion::Status => {
                self.status_asked = false;
                (Ok(vec![Action::PublishStatus]), None)
            }
        };
        match decided {
            Ok(more) => {
                actions.extend(more);
                self.perform(actions, owed, ctx);
            }
            Err(why) => {
                self.perform(actions, None, ctx);
                self.reject(owed, why);
            }
        }
    }
}

impl<const N: usize> Handler<GoalNews<N>> for IkTrial<N> {
    type Result = ();

    fn handle(&mut self, news: GoalNews<N>, ctx: &mut Context<Self>) {
        let mut actions = self.hear(&news.pose);
        match news.outcome {
            None => self
                .trial
                .feedback(&news.goal_id, news.distance, &news.positions),
            Some(outcome) => {
                let conclusion = Conclusion {
                    goal_id: news.goal_id,
                    outcome,
                    final_distance: news.distance,
                };
                let target = || sample(&self.lengths, &mut self.rng);
                actions.extend(self.trial.concluded(conclusion, target));
            }
        }
        self.perform(actions, None, ctx);
    }
}

impl<const N: usize> Handler<Interest> for IkTrial<N> {
    type Result = ();

    fn handle(&mut self, interest: Interest, ctx: &mut Context<Self>) {
        self.status_wanted = interest.wanted;
        self.keep_timers(ctx);
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl Occasion {
    /// Tells whoever called why nothing comes of it.
    fn refuse(self, why: &str) {
        if let Self::Start(_, mut reply) | Self::Skip(mut reply) | Self::Stop(mut reply) = self {
            reply.refuse(why);
        }
    }
}

/// A call that is answered once all that it asked for is under way.
enum Owed {
    /// The settings in force.
    Values(Reply),
    /// `{}`.
    Nothing(Reply),
}

/// What `ik_action` said to a goal that the trial sent.
struct Answered<const N: usize> {
    ticket: u64,
    /// The goal's id, if it was accepted.
    goal_id: Option<String>,
    /// Lengths after a refusal \[m\]: they may have been the reason.
    lengths: Option<[f64; N]>,
}

impl<const N: usize> IkTrial<N> {
    /// Asks the arm, and goes on when all that it said before has been heard too.
    fn ask(&self, occasion: Occasion, ctx: &mut Context<Self>) {
        let (arm, settle, own) = (self.arm.clone(), self.goals.settle.clone(), ctx.address());
        let question = async move {
            let pose = arm.send(ArmPose).await.ok();
            let _ = settle.send(Settle).await;
            own.do_send(PoseTold { pose, occasion });
        };
        ctx.spawn(question.into_actor(self));
    }

    /// Takes note of lengths and time. Two questions may be answered in either order: the later time counts.
    fn hear(&mut self, pose: &Pose<N>) -> Vec<Action> {
        self.lengths = pose.lengths;
        self.simulated = self.simulated.max(pose.simulated);
        self.trial.tick(self.simulated)
    }

    /// Does what the trial wants done, then answers the call that led to it.
    fn perform(&mut self, actions: Vec<Action>, owed: Option<Owed>, ctx: &mut Context<Self>) {
        let mut commands = Vec::new();
        for action in actions {
            match action {
                Action::PublishStatus => self.publish_status(),
                command => commands.push(command),
            }
        }
        self.keep_timers(ctx);
        if commands.is_empty() {
            return self.pay(owed);
        }
        let carried_out = carry_out(
            commands,
            self.arm.clone(),
            self.goals.clone(),
            ctx.address().recipient(),
        );
        ctx.wait(carried_out.into_actor(self).map(move |answers, node, ctx| {
            let actions = answers
                .into_iter()
                .flat_map(|answer| node.answered(answer))
                .collect();
            node.perform(actions, owed, ctx);
        }));
    }

    fn answered(&mut self, answer: Answered<N>) -> Vec<Action> {
        self.lengths = answer.lengths.unwrap_or(self.lengths);
        let target = || sample(&self.lengths, &mut self.rng);
        match answer.goal_id {
            Some(goal_id) => self.trial.accepted(answer.ticket, &goal_id, target),
            None => self.trial.refused(answer.ticket, target),
        }
    }

    fn pay(&self, owed: Option<Owed>) {
        match owed {
            Some(Owed::Values(mut reply)) => reply.succeed(&self.values()),
            Some(Owed::Nothing(mut reply)) => reply.succeed(&Empty {}),
            None => {}
        }
    }

    fn reject(&self, owed: Option<Owed>, why: Rejection) {
        match owed {
            Some(Owed::Values(mut reply)) => reply.answer(&self.values(), &why.to_string()),
            Some(Owed::Nothing(mut reply)) => reply.refuse(&why.to_string()),
            None => {}
        }
    }

    fn values(&self) -> TrialValues {
        let Settings { duration, criteria } = self.trial.settings();
        TrialValues {
            duration,
            epsilon: criteria.epsilon,
            success_hold: criteria.success_hold,
        }
    }

    fn publish_status(&self) {
        let Some(status) = self.trial.status().filter(|_| self.status_wanted) else {
            return;
        };
        let message = TrialStatus {
            running: status.running,
            elapsed: status.elapsed,
            duration: status.duration,
            targets_reached: status.targets_reached,
            target: status.target.as_ref().map(target_message),
            error: status.error,
            desired_positions: status.desired_positions.as_deref(),
            action_status: status.action_status.name(),
        };
        let topic = Topic::TrialStatus;
        self.publish.do_send(Publish {
            topic,
            frame: messages::publish(topic.name(), &message),
            msg: None,
        });
    }

    /// The timers that the present state asks for, and no others.
    fn keep_timers(&mut self, ctx: &mut Context<Self>) {
        match self.trial.remaining() {
            None => self.cancel_deadline(ctx),
            Some(remaining) if self.deadline.is_none() => {
                let nap = Duration::try_from_secs_f64(remaining).unwrap_or(LONGEST_NAP);
                let nap = nap.clamp(SHORTEST_NAP, LONGEST_NAP);
                self.deadline = Some(ctx.run_later(nap, |node, ctx| {
                    node.deadline = None;
                    node.ask(Occasion::Deadline, ctx);
                }));
            }
            Some(_) => {}
        }
        let is_watched = self.status_wanted && self.trial.status().is_some();
        if is_watched && self.status_timer.is_none() {
            self.status_timer = Some(ctx.run_interval(STATUS_PERIOD, Self::status_due));
        } else if !is_watched && let Some(timer) = self.status_timer.take() {
            ctx.cancel_future(timer);
        }
    }

    fn cancel_deadline(&mut self, ctx: &mut Context<Self>) {
        if let Some(timer) = self.deadline.take() {
            ctx.cancel_future(timer);
        }
    }

    /// A status shows the present time, which while a trial runs is the arm's to tell.
    fn status_due(&mut self, ctx: &mut Context<Self>) {
        if !self.trial.running() {
            self.publish_status();
        } else if !self.status_asked {
            self.status_asked = true;
            self.ask(Occasion::Status, ctx);
        }
    }
}

/// Takes the trial's wishes to `ik_action`, one after another.
async fn carry_out<const N: usize>(
    commands: Vec<Action>,
    arm: Recipient<ArmPose<N>>,
    goals: GoalClient<N>,
    owner: Recipient<GoalNews<N>>,
) -> Vec<Answered<N>> {
    let mut answers = Vec::new();
    for command in commands {
        match command {
            Action::CancelGoal { goal_id } => {
                let goal_id = Some(goal_id);
                // A refusal means that the goal is over already: all that was wanted.
                let _ = goals.cancel.send(CancelGoal { goal_id }).await;
            }
            Action::SendGoal {
                ticket,
                target,
                criteria,
            } => {
                let goal = SendGoal {
                    target,
                    criteria,
                    owner: Some(owner.clone()),
                };
                let goal_id = goals.send.send(goal).await.ok().and_then(Result::ok);
                let lengths = match goal_id {
                    Some(_) => None,
                    None => arm.send(ArmPose).await.ok().map(|pose| pose.lengths),
                };
                answers.push(Answered {
                    ticket,
                    goal_id,
                    lengths,
                });
            }
            Action::PublishStatus => {}
        }
    }
    answers
}

/// Reads what a start changes; all or nothing, and every field that is wrong is named. The other services have no
/// fields, and nothing but `args` itself can be wrong.
fn read_changes(arguments: &Arguments, service: Service) -> Result<Changes, String> {
    let mut fields = Fields::read(arguments, service).map_err(|why| why.to_string())?;
    if service != Service::TrialStart {
        return Ok(Changes::default());
    }
    let changes = Changes {
        duration: fields.number("duration", Bound::Positive),
        epsilon: fields.number("epsilon", Bound::Positive),
        success_hold: fields.number("success_hold", Bound::NonNegative),
    };
    if fields.accepted() {
        Ok(changes)
    } else {
        Err(fields.status())
    }
}

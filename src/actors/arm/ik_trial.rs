//! Timed trials: `/ik_trial/start`, `/ik_trial/skip`, `/ik_trial/stop`, and the topic `/ik_trial/status`.
//!
//! The rules are in `live::ik_trial`. The node requests the arm's pose before each action, and moves the arm only
//! through `ik_action`. Its request there is completed before it handles its next message.
//!
//! **Invariant:** time and news of goals are handled in the order in which the arm sent them. No timer runs without a
//! trial or a subscriber.

use std::time::Duration;

use actix::prelude::*;

use super::ik_action::{CancelRequest, GoalReport, GoalRequest, SendGoal};
use crate::actors::arm::sim::{ArmPose, Pose};
use crate::actors::node::{Barrier, Call, Interest, Nodes, Publish, Reply, Unserved, ask};
use crate::live::{GoalAnswer, IkTrials};
use crate::math::trial::TrialCommand;
use crate::protocol::catalog::{Service, Topic};
pub use crate::services::trial::{STATUS_PERIOD, Terms, TrialRefused, TrialRequest};

/// Least time between two checks whether a trial is over. The rest of a trial may take long if the arm is paused or
/// slow.
const SHORTEST_NAP: Duration = Duration::from_millis(20);
/// Longest such time, because a timer cannot be set to every duration that a client may request.
const LONGEST_NAP: Duration = Duration::from_secs(3600);

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `ik_trial` for an arm of `N` links.
pub struct IkTrial<const N: usize> {
    arm: TrialArm<N>,
    /// Whether the arm has been told that a trial runs.
    observes: bool,
    goals: GoalClient<N>,
    publish: Recipient<Publish>,
    trial: IkTrials<N>,
    status_wanted: bool,
    /// A timer for `/ik_trial/status`, while it has subscribers.
    status_timer: Option<SpawnHandle>,
    /// Whether a request for the time of a status is pending. There is one at a time.
    status_asked: bool,
    /// A timer for the end of the trial, while one runs.
    deadline: Option<SpawnHandle>,
}

impl<const N: usize> IkTrial<N> {
    /// A node that has not run a trial yet; the targets come from `rng`.
    #[must_use]
    pub fn new(
        arm: TrialArm<N>,
        goals: GoalClient<N>,
        publish: Recipient<Publish>,
        mut rng: fastrand::Rng,
    ) -> Self {
        Self {
            arm,
            observes: false,
            goals,
            publish,
            trial: IkTrials::new(move || rng.f64()),
            status_wanted: false,
            status_timer: None,
            status_asked: false,
            deadline: None,
        }
    }

    /// Adds this node's services and its topic to the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        for service in [Service::TrialStart, Service::TrialSkip, Service::TrialStop] {
            nodes.serve::<TrialRequest>(service, address.clone());
        }
        let node = address.clone().recipient();
        nodes.publishers.insert(Topic::TrialStatus, node);
    }

    /// Sends a request to the arm, and continues after all its earlier news. They are in this node's mailbox before the
    /// barrier is answered, and an actor empties its mailbox before it continues a future.
    fn ask_arm(&self, intent: Intent, ctx: &mut Context<Self>) {
        let (arm, barrier) = (self.arm.pose.clone(), self.goals.barrier.clone());
        let question = async move {
            let pose = arm.send(ArmPose).await.ok();
            let _ = barrier.send(Barrier).await;
            pose
        };
        let asked = question.into_actor(self);
        ctx.spawn(asked.map(move |pose, node, ctx| node.act(pose, intent, ctx)));
    }

    /// Does the next action at this pose of the arm; `None` if the arm has ended.
    fn act(&mut self, pose: Option<Pose<N>>, intent: Intent, ctx: &mut Context<Self>) {
        let Some(pose) = pose else {
            // Without an arm there is nothing to do.
            if let Intent::Perform(mut call) = intent {
                call.reply.refuse(Unserved::NO_ARM);
            }
            return;
        };
        let mut commands = self.trial.tick(&pose);
        match intent {
            Intent::CheckDeadline => self.carry_out(commands, None, ctx),
            Intent::ShowStatus => {
                self.status_asked = false;
                commands.push(TrialCommand::PublishStatus);
                self.carry_out(commands, None, ctx);
            }
            Intent::Perform(call) => {
                let Call { ask, mut reply } = *call;
                match self.trial.decide(ask, &pose) {
                    Ok((more, obstacle)) => {
                        // A new trial has another one.
                        self.cancel_deadline(ctx);
                        if let Some(obstacle) = obstacle {
                            reply.warn(&obstacle.to_string());
                        }
                        commands.extend(more);
                        self.carry_out(commands, Some(reply), ctx);
                    }
                    Err(why) => {
                        self.carry_out(commands, None, ctx);
                        reply.answer(self.trial.terms(Err(why)));
                    }
                }
            }
        }
    }

    /// Executes the trial's commands, then answers the call that caused them.
    fn carry_out(
        &mut self,
        commands: Vec<TrialCommand>,
        reply: Option<Reply<Terms>>,
        ctx: &mut Context<Self>,
    ) {
        let mut about_goals = Vec::new();
        for command in commands {
            match command {
                TrialCommand::PublishStatus => self.publish_status(),
                command => about_goals.push(command),
            }
        }
        self.keep_timers(ctx);
        if about_goals.is_empty() {
            if let Some(mut reply) = reply {
                reply.answer(self.trial.terms(Ok(())));
            }
            return;
        }
        let answered = send_in_turn(
            about_goals,
            self.arm.pose.clone(),
            self.goals.clone(),
            ctx.address().recipient(),
        );
        ctx.wait(answered.into_actor(self).map(move |answers, node, ctx| {
            let answers = answers.into_iter();
            let commands = answers
                .flat_map(|answer| node.trial.answered(answer))
                .collect();
            node.carry_out(commands, reply, ctx);
        }));
    }

    fn publish_status(&self) {
        if let Some(status) = self.trial.status().filter(|_| self.status_wanted) {
            let message = Publish::made(Topic::TrialStatus, move || status);
            self.publish.do_send(message);
        }
    }

    /// Sets the timers of the present state, and no others. A running trial observes the arm, also without a goal.
    fn keep_timers(&mut self, ctx: &mut Context<Self>) {
        let running = self.trial.trial().running();
        if std::mem::replace(&mut self.observes, running) != running {
            self.arm.interest.do_send(Interest {
                topic: Topic::TrialStatus,
                wanted: running,
            });
        }
        match self.trial.trial().remaining() {
            None => self.cancel_deadline(ctx),
            Some(remaining) if self.deadline.is_none() => {
                let nap = Duration::try_from_secs_f64(remaining).unwrap_or(LONGEST_NAP);
                let nap = nap.clamp(SHORTEST_NAP, LONGEST_NAP);
                self.deadline = Some(ctx.run_later(nap, |node, ctx| {
                    node.deadline = None;
                    node.ask_arm(Intent::CheckDeadline, ctx);
                }));
            }
            Some(_) => {}
        }
        let is_watched = self.status_wanted && self.trial.trial().status().is_some();
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

    /// A status has the present time. While a trial runs, the arm provides it.
    fn status_due(&mut self, ctx: &mut Context<Self>) {
        if !self.trial.trial().running() {
            self.publish_status();
        } else if !self.status_asked {
            self.status_asked = true;
            self.ask_arm(Intent::ShowStatus, ctx);
        }
    }
}

/// The node's next action, once it has lengths and time.
enum Intent {
    /// Performs a request.
    Perform(Box<Call<TrialRequest>>),
    /// The trial may be over.
    CheckDeadline,
    /// A status is due.
    ShowStatus,
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for IkTrial<N> {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<Call<TrialRequest>> for IkTrial<N> {
    type Result = ();

    fn handle(&mut self, call: Call<TrialRequest>, ctx: &mut Context<Self>) {
        self.ask_arm(Intent::Perform(Box::new(call)), ctx);
    }
}

impl<const N: usize> Handler<GoalReport<N>> for IkTrial<N> {
    type Result = ();

    fn handle(&mut self, news: GoalReport<N>, ctx: &mut Context<Self>) {
        let commands = self.trial.report(news);
        self.carry_out(commands, None, ctx);
    }
}

impl<const N: usize> Handler<Interest> for IkTrial<N> {
    type Result = ();

    fn handle(&mut self, interest: Interest, ctx: &mut Context<Self>) {
        self.status_wanted = interest.wanted;
        self.keep_timers(ctx);
    }
}

// ---- the arm and the goals of a trial: each command is completed before the next ------------------------------------

/// The messages to the arm.
#[derive(Clone)]
pub struct TrialArm<const N: usize> {
    /// Asks where it is.
    pub pose: Recipient<ArmPose<N>>,
    /// Tells it whether a trial observes it.
    pub interest: Recipient<Interest>,
}

/// The messages to `ik_action`.
#[derive(Clone)]
pub struct GoalClient<const N: usize> {
    /// Sends a goal.
    pub send: Recipient<SendGoal<N>>,
    /// Cancels it.
    pub cancel: Recipient<Call<CancelRequest>>,
    /// Waits until all earlier news have arrived.
    pub barrier: Recipient<Barrier>,
}

/// Sends the trial's commands to `ik_action`, one after another.
async fn send_in_turn<const N: usize>(
    commands: Vec<TrialCommand>,
    arm: Recipient<ArmPose<N>>,
    goals: GoalClient<N>,
    owner: Recipient<GoalReport<N>>,
) -> Vec<GoalAnswer<N>> {
    let mut answers = Vec::new();
    for command in commands {
        match command {
            TrialCommand::CancelGoal { goal_id } => {
                let goal_id = Some(goal_id);
                // A refusal means that the goal has already ended, as wanted.
                let _ = ask(&goals.cancel, CancelRequest { goal_id }).await;
            }
            TrialCommand::SendGoal {
                ticket,
                target,
                criteria,
            } => {
                let goal = SendGoal {
                    goal: GoalRequest { target, criteria },
                    owner: owner.clone(),
                };
                let goal_id = goals.send.send(goal).await.ok().flatten();
                let lengths = match goal_id {
                    Some(_) => None,
                    None => arm.send(ArmPose).await.ok().map(|pose| pose.lengths),
                };
                answers.push(GoalAnswer {
                    ticket,
                    goal_id,
                    lengths,
                });
            }
            TrialCommand::PublishStatus => {}
        }
    }
    answers
}

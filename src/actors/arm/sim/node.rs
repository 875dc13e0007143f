//! The actor: reads the clock, advances the simulation, wakes for the next tick.
//!
//! The arm wakes 60 times a second, or 10 times while nothing observes it. It advances to the present time before it
//! handles a message, so every answer has the present state. Work per wake-up is bounded by
//! [`WAKE_UP_BUDGET`](crate::live::WAKE_UP_BUDGET). Steps beyond that are taken after [`STEP_PAUSE`]. Waiting messages do
//! not delay the wake-up, because it is checked at the end of every [turn](super::turn).
//!
//! **Invariant:** nothing here decides physics; the live arm does what `Simulation` does offline, bit for bit. An
//! answer that the arm is at rest follows all news of goals.

use std::collections::VecDeque;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use tokio::time::Instant;

use super::messages::{ArmSettings, AttachNodes, HeldLimit};
use super::turn::Turn;
use super::world::ArmWorld;
use crate::actors::node::{Barrier, ClientLink, Interest, Publish, Reply, Unserved};
use crate::actors::resources::gauges::Gauges;
use crate::live::{GoalProgress, LiveArm, PUBLISH_RATE, STEP_PAUSE, StepsAsked};
use crate::math::arm::Arm;
use crate::math::pid::Gains;
use crate::math::simulation::ArmInput;
use crate::protocol::op::fields::Rejections;
use crate::services::arm::Stepped;

// ---- state ----------------------------------------------------------------------------------------------------------

/// Nanoseconds between two ticks.
const TICK: u64 = 1_000_000_000 / PUBLISH_RATE as u64;

/// The node `arm_sim` for an arm of `N` links.
pub struct ArmSim<const N: usize> {
    pub(super) arm: LiveArm<N, ArmWorld<N>>,
    turn: Turn,
    /// Requested steps that are not yet taken, at most one request per client. While there are any, the next turn is
    /// scheduled.
    steps: VecDeque<Steps<N>>,
    /// Whether they are being taken.
    is_stepping: bool,
    /// The client with the commanded effort.
    pub(super) commander: Option<ClientLink>,
    /// The node that predicts limits, if there is one.
    study: Option<Recipient<HeldLimit<N>>>,
    /// The actors that inform clients of goals, which get barriers.
    goal_reporters: Vec<Recipient<Barrier>>,
    /// The next wake-up.
    tick: Option<Tick>,
    /// Wake-ups that have been scheduled.
    scheduled: u64,
    /// Feedback of the goal that has been sent and not yet arrived.
    feedback_sent: Option<Pin<Box<RecipientRequest<GoalProgress<N>>>>>,
}

/// A scheduled wake-up.
struct Tick {
    timer: SpawnHandle,
    /// Its number among the scheduled wake-ups. A cancelled timer that is already due may still fire.
    number: u64,
    /// The number of the tick before it, since the start.
    after: u64,
    /// The number of ticks until it: more than 1 while nothing observes the arm.
    count: u64,
}

/// Requested steps that are not all taken, with the reply.
pub(super) struct Steps<const N: usize> {
    pub(super) asked: StepsAsked<N>,
    pub(super) reply: Reply<Result<Stepped<N>, Rejections>>,
}

impl<const N: usize> ArmSim<N> {
    /// An arm in the starting pose, running, with its controller off.
    #[must_use]
    pub fn new(
        arm: Arm<N>,
        gains: Gains<N>,
        publish: Recipient<Publish>,
        gauges: Arc<Gauges>,
    ) -> Self {
        let world = ArmWorld {
            epoch: Instant::now(),
            publish,
            gauges,
            owner: None,
        };
        Self {
            arm: LiveArm::new(arm, gains, world),
            turn: Turn::new(),
            steps: VecDeque::new(),
            is_stepping: false,
            commander: None,
            study: None,
            goal_reporters: Vec::new(),
            tick: None,
            scheduled: 0,
            feedback_sent: None,
        }
    }

    /// The same with another control period \[s\], not negative.
    #[must_use]
    pub fn with_period(mut self, period: f64) -> Self {
        self.arm.set_period(period);
        self
    }

    /// Wakes at the next multiple of the tick's length, or at a later one while nothing observes the arm. Missed ticks
    /// are skipped, not made up. tokio sorts a wait of more than 64 ms in two stages, so an arm at rest has two wake-ups for
    /// each tick.
    fn schedule_tick(&mut self, ctx: &mut Context<Self>) {
        let count = match self.commander {
            Some(_) => 1,
            None => self.arm.ticks_to_wake(),
        };
        let after = self.ticks_passed();
        let due = Duration::from_nanos(TICK.saturating_mul(after + count));
        let wait = due.saturating_sub(self.arm.world.epoch.elapsed());
        self.scheduled += 1;
        let number = self.scheduled;
        let timer = ctx.run_later(wait, move |arm, ctx| {
            let is_it = |tick: &mut Tick| tick.number == number;
            if arm.tick.take_if(is_it).is_none() {
                return;
            }
            arm.advance_to_now(ctx);
            arm.ask_limit(ctx);
            arm.arm.skip_ticks(count - 1);
            arm.arm.tick();
            arm.schedule_tick(ctx);
        });
        self.tick = Some(Tick {
            timer,
            number,
            after,
            count,
        });
    }

    /// The multiples of the tick's length since the start.
    fn ticks_passed(&self) -> u64 {
        let passed = self.arm.world.epoch.elapsed().as_nanos() / u128::from(TICK);
        u64::try_from(passed).unwrap_or(u64::MAX)
    }

    /// Wakes at the next tick, if the arm has rested and something observes it now. Call this after every message that
    /// may begin that.
    pub(super) fn end_rest(&mut self, ctx: &mut Context<Self>) {
        let is_observed = self.commander.is_some() || self.arm.is_observed();
        let Some(tick) = self.tick.take_if(|tick| tick.count > 1 && is_observed) else {
            return;
        };
        ctx.cancel_future(tick.timer);
        let passed = self.ticks_passed().saturating_sub(tick.after);
        self.arm.skip_ticks(passed.min(tick.count - 1));
        self.schedule_tick(ctx);
    }

    /// Call this at every message. It ends the turn after a limited amount of work.
    pub(super) fn count_message(&mut self, ctx: &mut Context<Self>) {
        if self.turn.count() {
            let others = tokio::task::yield_now().into_actor(self);
            ctx.wait(others.map(|(), arm, _| arm.turn = Turn::new()));
        }
    }

    /// Call this at every message that depends on the present state or changes it.
    pub(super) fn take_due_steps(&mut self, ctx: &mut Context<Self>) {
        self.count_message(ctx);
        self.advance_to_now(ctx);
    }

    /// Takes the steps that are due, within the budget of one wake-up. The rest follows after a pause.
    fn advance_to_now(&mut self, ctx: &mut Context<Self>) {
        self.end_orphaned_command();
        let is_behind = self.arm.advance_to_now();
        Self::pause_steps(is_behind, ctx);
    }

    /// Takes the remaining steps after a pause.
    fn pause_steps(is_behind: bool, ctx: &mut Context<Self>) {
        if is_behind {
            ctx.run_later(STEP_PAUSE, |node, ctx| {
                node.end_orphaned_command();
                let is_behind = node.arm.catch_up();
                Self::pause_steps(is_behind, ctx);
            });
        }
    }

    /// Ends the command of a client that has disconnected.
    fn end_orphaned_command(&mut self) {
        if self.commander.take_if(|client| client.is_gone()).is_some() {
            self.arm.change(ArmInput::Command([0.0; N]));
        }
    }

    // ---- requested steps ---------------------------------------------------------------------------------------------

    /// Takes the first row of the steps. Steps that are checked wait for those of others.
    pub(super) fn step(&mut self, steps: Steps<N>, ctx: &mut Context<Self>) {
        if self.is_stepping && self.arm.judges_steps() {
            return self.steps.push_back(steps);
        }
        self.take_row(steps);
        if !self.is_stepping {
            self.go_on_stepping(ctx);
        }
    }

    /// Refuses all requested steps that are not taken.
    pub(super) fn refuse_steps(&mut self, why: Unserved) {
        for mut steps in self.steps.drain(..) {
            steps.reply.refuse(why);
        }
    }

    /// Yields to all other messages, and waits until the goal's feedback has been published. Otherwise the registry
    /// would get it faster than it delivers it. Then the remaining requests continue, one after the other.
    fn go_on_stepping(&mut self, ctx: &mut Context<Self>) {
        let feedback_sent = self.feedback_sent.take();
        self.is_stepping = feedback_sent.is_some() || !self.steps.is_empty();
        if !self.is_stepping {
            return;
        }
        let reporters = self.goal_reporters.clone();
        let others = async move {
            let Some(progress) = feedback_sent else {
                return tokio::task::yield_now().await;
            };
            let _ = progress.await;
            pass_barriers(&reporters).await;
        };
        ctx.spawn(others.into_actor(self).map(|(), arm, ctx| {
            if let Some(next) = arm.steps.pop_front() {
                arm.take_row(next);
            }
            arm.go_on_stepping(ctx);
        }));
    }

    /// Takes the next row of steps. Answers after the last one, otherwise puts the request at the end of the queue.
    /// Nothing is stepped for a client that has left, because another one may have reset the arm since.
    fn take_row(&mut self, mut steps: Steps<N>) {
        if steps.reply.caller_has_left() {
            return steps.reply.refuse(Unserved::CALLER_GONE);
        }
        let (stepped, progress) = self.arm.take_row(&mut steps.asked);
        if let (Some(progress), Some(owner)) = (progress, &self.arm.world.owner) {
            self.feedback_sent = Some(Box::pin(owner.send(progress)));
        }
        match stepped {
            Some(stepped) => steps.reply.conclude(Ok(stepped)),
            None => self.steps.push_back(steps),
        }
    }

    // ---- messages of others -----------------------------------------------------------------------------------------

    /// Answers after all feedback and results of goals have been sent. None may follow the answer that the arm is at
    /// rest.
    pub(super) fn after_barriers(&self, ctx: &mut Context<Self>, answer: impl FnOnce() + 'static) {
        if self.goal_reporters.is_empty() {
            return answer();
        }
        let passed = pass_barriers(&self.goal_reporters).into_actor(self);
        ctx.spawn(passed.map(move |(), _, _| answer()));
    }

    /// Requests the limit of the active loop, if it is needed. `study` predicts it on its workers.
    pub(super) fn ask_limit(&mut self, ctx: &mut Context<Self>) {
        let Some(study) = &self.study else {
            return;
        };
        let Some(control) = self.arm.limit_to_predict() else {
            return;
        };
        let answer = study.send(HeldLimit(control)).into_actor(self);
        ctx.spawn(answer.map(move |answer, node, _| {
            node.arm.keep_limit(control, answer.ok().flatten());
        }));
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for ArmSim<N> {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Context<Self>) {
        self.arm.world.epoch = Instant::now();
        self.arm.restart_pacer();
        self.schedule_tick(ctx);
    }
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<Interest> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, interest: Interest, ctx: &mut Context<Self>) {
        self.count_message(ctx);
        self.arm.set_wanted(interest.topic, interest.wanted);
        self.end_rest(ctx);
        self.ask_limit(ctx);
    }
}

impl<const N: usize> Handler<ArmSettings<N>> for ArmSim<N> {
    type Result = MessageResult<ArmSettings<N>>;

    fn handle(&mut self, _: ArmSettings<N>, ctx: &mut Context<Self>) -> Self::Result {
        self.count_message(ctx);
        MessageResult(self.arm.present())
    }
}

impl<const N: usize> Handler<AttachNodes<N>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, nodes: AttachNodes<N>, _: &mut Context<Self>) {
        self.study = nodes.study.or(self.study.take());
        self.goal_reporters.extend(nodes.goal_reporters);
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

/// Sends a barrier to each of these actors, and waits until all have answered.
fn pass_barriers(reporters: &[Recipient<Barrier>]) -> impl Future<Output = ()> + use<> {
    let asked: Vec<_> = reporters.iter().map(|one| one.send(Barrier)).collect();
    async move {
        for one in asked {
            // A node that has ended reports nothing.
            let _ = one.await;
        }
    }
}

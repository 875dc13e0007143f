//! The actor: asks the clock, advances the simulation, wakes for the next tick.
//!
//! The arm wakes 60 times a second, and before it handles any message it advances to now, so that nobody sees a state
//! from before the present step. Work per wake-up is bounded by [`WAKE_UP_BUDGET`]; what that leaves owed is taken up
//! after [`BREATHER`]. However many messages wait, the wake-up comes: it is looked for at the end of every
//! [turn](super::state::turn).
//!
//! **Invariant:** nothing here decides physics; the live arm does what `Simulation` does offline, bit for bit.

use std::collections::VecDeque;
use std::sync::{Arc, Weak};
use std::time::Duration;

use actix::prelude::*;
use tokio::time::Instant;

use super::messages::{SimulationTime, Snapshot, TakeSnapshot};
use super::state::goals::Goals;
use super::state::journal::Journal;
use super::state::limit::LimitWatch;
use super::state::steps::Steps;
use super::state::telemetry::Telemetry;
use super::state::turn::Turn;
use crate::actors::node::{Interest, Publish};
use crate::actors::resources::awake::stay_awake;
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::work_clock;
use crate::math::arm::Arm;
use crate::math::pacer::Pacer;
use crate::math::pid::Gains;
use crate::math::simulation::{ControlPeriod, Simulation};

/// Publishing ticks a second, and so the rate of `/joint_states` and `/clock` \[Hz\].
pub const PUBLISH_RATE: u32 = 60;
/// Time that one wake-up may spend on steps: what a message to the arm may have to wait for.
pub const WAKE_UP_BUDGET: Duration = Duration::from_millis(5);
/// Between two wake-ups while steps are owed. So the arm takes what it needs of its core, not a share that is fixed by
/// the rate of publishing; and a timestep that no machine can follow leaves the others some of it.
pub const BREATHER: Duration = Duration::from_millis(1);
/// Steps between two looks at the clock: some 10 microseconds of work.
const STEPS_BETWEEN_LOOKS: u64 = 64;

/// Names of the joints, base first.
const JOINT_NAMES: [&str; 3] = ["joint1", "joint2", "joint3"];

/// The names of an arm's joints, base first.
#[must_use]
pub fn joint_names<const N: usize>() -> [&'static str; N] {
    std::array::from_fn(|i| JOINT_NAMES.get(i).copied().unwrap_or_default())
}

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `arm_sim` for an arm of `N` links.
pub struct ArmSim<const N: usize> {
    pub(super) simulation: Simulation<N>,
    pub(super) pacer: Pacer,
    pub(super) paused: bool,
    /// Simulation time at the latest pause, or at the reset since \[s\].
    pub(super) paused_at: f64,
    /// A wake-up after a [`BREATHER`] is on its way.
    pub(super) catching_up: bool,
    /// The moment from which the pacer and the ticks count.
    pub(super) epoch: Instant,
    pub(super) publish: Recipient<Publish>,
    pub(super) telemetry: Telemetry,
    pub(super) joint_names: [&'static str; N],
    pub(super) goals: Goals<N>,
    pub(super) limit: LimitWatch<N>,
    pub(super) turn: Turn,
    /// Steps that were asked for and are yet to be taken, one request per client at most. While there are any, the next
    /// turn is on its way.
    pub(super) steps: VecDeque<Steps<N>>,
    /// They are being taken.
    pub(super) is_stepping: bool,
    /// Ends with the client whose effort is commanded.
    pub(super) commander: Option<Weak<()>>,
    /// The listener to everything that the steps depend on, if there is one.
    pub(super) journal: Option<Journal<N>>,
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
        let simulation = Simulation::new(arm, gains);
        Self {
            pacer: Pacer::new(Duration::ZERO, simulation.timestep()),
            telemetry: Telemetry::new(gauges, &simulation),
            simulation,
            paused: false,
            paused_at: 0.0,
            catching_up: false,
            epoch: Instant::now(),
            publish,
            joint_names: joint_names(),
            goals: Goals::default(),
            limit: LimitWatch::default(),
            turn: Turn::new(),
            steps: VecDeque::new(),
            is_stepping: false,
            commander: None,
            journal: None,
        }
    }

    /// The same with another time between two runs of the control law \[s\], not negative.
    #[must_use]
    pub fn with_period(mut self, period: f64) -> Self {
        let delay = false;
        self.simulation
            .set_control_period(ControlPeriod { period, delay });
        self
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for ArmSim<N> {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Context<Self>) {
        self.epoch = Instant::now();
        self.pacer
            .restart(Duration::ZERO, self.simulation.timestep());
        self.schedule_tick(ctx);
    }
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<Interest> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, interest: Interest, ctx: &mut Context<Self>) {
        self.count_message(ctx);
        self.telemetry.set_wanted(interest.topic, interest.wanted);
        self.publish_lasting(interest.topic);
        self.ask_limit(ctx);
    }
}

impl<const N: usize> Handler<SimulationTime> for ArmSim<N> {
    type Result = f64;

    fn handle(&mut self, _: SimulationTime, ctx: &mut Context<Self>) -> f64 {
        self.attend(ctx);
        self.simulation.time()
    }
}

impl<const N: usize> Handler<TakeSnapshot<N>> for ArmSim<N> {
    type Result = Snapshot<N>;

    fn handle(&mut self, _: TakeSnapshot<N>, ctx: &mut Context<Self>) -> Snapshot<N> {
        self.attend(ctx);
        Snapshot(Box::new(self.simulation.clone()))
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<const N: usize> ArmSim<N> {
    /// Wakes at the next multiple of the tick's length: missed ticks are skipped, not made up.
    fn schedule_tick(&self, ctx: &mut Context<Self>) {
        let tick = Duration::from_secs(1) / PUBLISH_RATE;
        let since_tick = self.epoch.elapsed().as_nanos() % tick.as_nanos();
        let wait = tick - Duration::from_nanos(u64::try_from(since_tick).unwrap_or(0));
        ctx.run_later(wait, |arm, ctx| {
            arm.advance_to_now(ctx);
            arm.watch_warnings(ctx);
            arm.publish_state();
            arm.tell_state();
            arm.schedule_tick(ctx);
        });
    }

    /// To be called at every message: ends the turn with it if enough has been done in a row.
    pub(super) fn count_message(&mut self, ctx: &mut Context<Self>) {
        if self.turn.count() {
            let others = tokio::task::yield_now().into_actor(self);
            ctx.wait(others.map(|(), arm, _| arm.turn = Turn::new()));
        }
    }

    /// To be called at every message that depends on the present state or changes it.
    pub(super) fn attend(&mut self, ctx: &mut Context<Self>) {
        self.count_message(ctx);
        self.advance_to_now(ctx);
    }

    /// To be called at every call: who calls once is likely to call again at once.
    pub(super) fn attend_call(&mut self, ctx: &mut Context<Self>) {
        self.attend(ctx);
        stay_awake();
    }

    /// Takes the steps that are due, as far as one wake-up's budget goes; the rest stays owed until soon after.
    fn advance_to_now(&mut self, ctx: &mut Context<Self>) {
        self.end_orphaned_command();
        if self.paused || self.simulation.divergence().is_some() {
            return;
        }
        // One budget for all that comes before the breather is over: were each message to cost one, a client that sends
        // many would keep the arm from everybody else.
        if self.catching_up {
            return;
        }
        let due = self.pacer.due(self.epoch.elapsed());
        if due == 0 {
            return;
        }
        let taken = self.take_steps(due);
        self.pacer.took(taken);
        if self.simulation.divergence().is_some() {
            self.note_divergence();
            return;
        }
        self.telemetry.owes(due - taken, self.simulation.timestep());
        if taken < due {
            self.catching_up = true;
            ctx.run_later(BREATHER, |arm, ctx| {
                arm.catching_up = false;
                arm.advance_to_now(ctx);
            });
        }
    }

    /// Takes up to `due` steps, and no longer than the budget; answers how many.
    fn take_steps(&mut self, due: u64) -> u64 {
        // The budget is about the processor's time, which tests in virtual time have too.
        let started = work_clock::now();
        let spent = || work_clock::now().saturating_duration_since(started);
        let mut taken = 0;
        while taken < due && spent() < WAKE_UP_BUDGET {
            taken += self.advance(STEPS_BETWEEN_LOOKS.min(due - taken), false);
            if self.simulation.divergence().is_some() {
                break;
            }
        }
        self.telemetry
            .stepped(taken, spent(), self.simulation.timestep());
        taken
    }

    /// Tells of a divergence that has just happened.
    pub(super) fn note_divergence(&mut self) {
        self.tell_divergence();
        self.telemetry.owes(0, 0.0);
        if let Some(divergence) = self.simulation.divergence() {
            tracing::warn!(
                step = divergence.step,
                time = divergence.time,
                "the simulation has diverged"
            );
        }
        self.publish_diagnostics();
    }

    /// Time counts from here: what was owed of an unfinished step is gone.
    pub(super) fn restart_pacer(&mut self) {
        self.telemetry.owes(0, 0.0);
        self.pacer
            .restart(self.epoch.elapsed(), self.simulation.timestep());
    }
}

//! The live arm without an actor: steps that are due, requests, goals, limits, topics. The node `arm_sim` runs it on a
//! thread of its own, and the page in one file in its worker.
//!
//! The arm gets the time from its environment ([`World`]), and passes its messages there. `math::pacer` computes
//! the number of due steps, and `math::simulation` each step.
//!
//! **Invariant:** there is no physics here. The live arm and an offline `Simulation` are bit-identical. Only
//! `change` changes the simulation from outside.

mod counts;
mod goals;
mod ik_action;
mod ik_trial;
mod journal;
mod limit;
mod limit_watch;
mod loads;
mod parameters;
mod path;
mod requests;
mod scene;
mod steps;
mod telemetry;
mod tracking;

use std::time::Duration;

use bytes::Bytes;

use self::counts::Counts;
use self::goals::Goals;
use self::limit_watch::LimitWatch;
use self::loads::Loads;
use crate::math::arm::Arm;
use crate::math::pacer::Pacer;
use crate::math::pid::Gains;
use crate::math::simulation::{ArmInput, ControlPeriod, Divergence, Simulation};
use crate::protocol::catalog::Topic;
use crate::services::study::Present;
use crate::study::control_loop::ControlLoop;

pub use self::goals::{GoalOrder, GoalProgress, Obstacle, Pose, Tracking};
pub use self::ik_action::{GoalReport, IkGoals, cancelled};
pub use self::ik_trial::{GoalAnswer, IkTrials};
pub use self::journal::{ArmEvent, ArmListener, Journal, StepEvent};
pub use self::limit::LEAST_PAUSE;
pub use self::path::{FollowedPath, MoveSetpoint, PATH_PERIOD, PathEnd, PathMove};
pub use self::requests::{ArmRequest, ControllerOn};
pub use self::steps::StepsAsked;

/// Publishing ticks per second: the rate of `/joint_states` and `/clock` \[Hz\].
pub const PUBLISH_RATE: u32 = 60;
/// Ticks between two wake-ups of an arm that nothing observes.
pub const REST_TICKS: u64 = 6;
/// Most time of one wake-up for steps. A message to the arm may have to wait so long.
pub const WAKE_UP_BUDGET: Duration = Duration::from_millis(5);
/// Pause between two wake-ups while steps are due. So the arm can use most of its core, independent of the
/// publishing rate. With a timestep that is too short for the machine, other threads still get part of the core.
pub const STEP_PAUSE: Duration = Duration::from_millis(1);
/// Steps between two checks of the clock: about 10 microseconds of work.
const STEPS_BETWEEN_LOOKS: u64 = 64;

/// The environment of the arm: clocks and receivers of its messages.
pub trait World<const N: usize> {
    /// The time since a fixed moment, the clock of the simulation time.
    fn now(&self) -> Duration;

    /// A clock for the cost of work. Only differences count.
    fn work_time(&self) -> Duration;

    /// Publishes the frame that `write` writes, on a topic with subscribers.
    fn publish(&self, topic: Topic, write: impl FnOnce() -> Bytes + Send + 'static);

    /// Sends feedback or the end of the goal to its owner.
    fn tell(&self, progress: GoalProgress<N>);

    /// The number of clients and of dropped messages.
    fn clients(&self) -> (u64, u64);

    /// The simulation has diverged.
    fn note_divergence(&self, _: Divergence) {}

    /// Counts an estimate of the local error.
    fn count_estimate(&self) {}
}

/// An arm of `N` links that moves in real time.
pub struct LiveArm<const N: usize, W> {
    pub(crate) world: W,
    pub(crate) simulation: Simulation<N>,
    pacer: Pacer,
    pub(crate) paused: bool,
    /// Simulation time at the latest pause or reset \[s\].
    pub(crate) paused_at: f64,
    /// Whether steps are due that a wake-up after a [`STEP_PAUSE`] will take.
    catching_up: bool,
    pub(crate) counts: Counts,
    pub(crate) goals: Goals<N>,
    pub(crate) loads: Loads<N>,
    limit: LimitWatch<N>,
    /// The journal of the steps' inputs, if there is one.
    pub(crate) journal: Option<Journal<N>>,
}

impl<const N: usize, W: World<N>> LiveArm<N, W> {
    /// An arm in the starting pose, running, with its controller off.
    #[must_use]
    pub fn new(arm: Arm<N>, gains: Gains<N>, world: W) -> Self {
        let simulation = Simulation::new(arm, gains);
        Self {
            pacer: Pacer::new(world.now(), simulation.timestep()),
            counts: Counts::new(world.now(), &simulation),
            world,
            simulation,
            paused: false,
            paused_at: 0.0,
            catching_up: false,
            goals: Goals::default(),
            loads: Loads::default(),
            limit: LimitWatch::default(),
            journal: None,
        }
    }

    /// Changes the control period \[s\], not negative, before any other call.
    pub fn set_period(&mut self, period: f64) {
        let delay = 0;
        self.simulation
            .set_control_period(ControlPeriod { period, delay });
    }

    /// The present simulation.
    #[must_use]
    pub fn simulation(&self) -> &Simulation<N> {
        &self.simulation
    }

    /// The environment.
    #[must_use]
    pub fn world(&self) -> &W {
        &self.world
    }

    /// The present settings.
    #[must_use]
    pub fn present(&self) -> Present<N> {
        Present {
            control: ControlLoop::of(&self.simulation),
            state: *self.simulation.state(),
        }
    }

    /// Sets whether a topic of the arm has subscribers.
    pub fn set_wanted(&mut self, topic: Topic, wanted: bool) {
        self.counts.set_wanted(topic, wanted);
        self.publish_lasting(topic);
    }

    /// Whether anything observes the arm: a subscriber of a topic, a trial, a goal or a record. A path asks for the pose
    /// more often than the arm ticks.
    #[must_use]
    pub fn is_observed(&self) -> bool {
        self.counts.wants_any() || self.goals.is_tracked() || self.journal.is_some()
    }

    /// Takes due steps within one wake-up's budget. Returns `true` if steps remain: the caller then calls
    /// [`LiveArm::catch_up`] after a [`STEP_PAUSE`].
    pub fn advance_to_now(&mut self) -> bool {
        if self.stands() {
            return false;
        }
        // There is one budget until the pause is over. With one per message, a client with many messages could block
        // the arm for all others.
        if self.catching_up {
            return false;
        }
        let now = self.world.now();
        let due = self.pacer.due(now);
        if due == 0 {
            return false;
        }
        let taken = self.take_steps(due);
        self.pacer.took(taken);
        if self.simulation.divergence().is_some() {
            self.note_divergence();
            return false;
        }
        self.catching_up = taken < due;
        let behind = self.catching_up.then(|| self.pacer.behind(now));
        self.counts.behind = behind.unwrap_or_default();
        self.catching_up
    }

    /// Whether no step is due: the arm is paused or has diverged.
    pub(crate) fn stands(&self) -> bool {
        self.paused || self.simulation.divergence().is_some()
    }

    /// Takes the remaining steps after the pause. Returns the same as [`LiveArm::advance_to_now`].
    pub fn catch_up(&mut self) -> bool {
        self.catching_up = false;
        self.advance_to_now()
    }

    /// Takes up to `due` steps within the budget. Returns their number.
    fn take_steps(&mut self, due: u64) -> u64 {
        // The budget is processor time, which exists in virtual time too.
        let started = self.world.work_time();
        let mut taken = 0;
        while taken < due && self.spent_since(started) < WAKE_UP_BUDGET {
            taken += self.advance(STEPS_BETWEEN_LOOKS.min(due - taken), false).0;
            if self.simulation.divergence().is_some() {
                break;
            }
        }
        let spent = self.spent_since(started);
        self.counts
            .stepped(taken, spent, self.simulation.timestep());
        taken
    }

    fn spent_since(&self, started: Duration) -> Duration {
        self.world.work_time().saturating_sub(started)
    }

    /// Reports a divergence that has just happened.
    pub(crate) fn note_divergence(&mut self) {
        if let Some(journal) = &mut self.journal {
            journal.diverge(&self.simulation);
        }
        self.counts.behind = 0.0;
        if let Some(divergence) = self.simulation.divergence() {
            self.world.note_divergence(divergence);
        }
        self.publish_diagnostics();
    }

    /// Time counts from here. The fraction of an unfinished step is dropped.
    pub(crate) fn restart_pacer(&mut self) {
        self.counts.behind = 0.0;
        self.pacer
            .restart(self.world.now(), self.simulation.timestep());
    }

    /// Applies `input` from the next step on.
    pub(crate) fn change(&mut self, input: ArmInput<N>) {
        let steps = self.simulation.steps();
        self.simulation.apply(input);
        if let Some(journal) = &mut self.journal {
            journal.change(steps, input);
        }
    }

    /// Records the state, if there is a journal and the state is new.
    pub(crate) fn tell_state(&mut self) {
        if let Some(journal) = &mut self.journal {
            journal.stand(&self.simulation);
        }
    }
}

//! The live arm without an actor: steps that are due, requests, goals, limits, topics. The node `arm_sim` runs it on a
//! thread of its own, and the page without a server in its worker.
//!
//! The arm asks its surroundings ([`World`]) for the time, and gives them its messages. The steps that are due are
//! computed by `math::pacer`, and each step by `math::simulation`.
//!
//! **Invariant:** nothing here decides physics; the live arm does what `Simulation` does offline, bit for bit. The
//! simulation is changed from outside by `change` alone.

mod counts;
mod goals;
mod journal;
mod limit;
mod limit_watch;
mod requests;
mod scene;
mod steps;
mod telemetry;
mod tracking;

use std::time::Duration;

use bytes::Bytes;

use self::counts::Telemetry;
use self::goals::Goals;
use self::limit_watch::LimitWatch;
use crate::math::arm::Arm;
use crate::math::pacer::Pacer;
use crate::math::pid::Gains;
use crate::math::simulation::{ArmInput, ControlPeriod, Divergence, Simulation};
use crate::protocol::catalog::Topic;
use crate::services::study::Present;
use crate::study::control_loop::ControlLoop;

pub use self::goals::{GoalJudged, GoalOrder, Obstacle, Pose, Tracking};
pub use self::journal::{ArmEvent, ArmListener, ArmNews, Journal};
pub use self::limit::LEAST_PAUSE;
pub use self::requests::{ArmRequest, ControllerOn};
pub use self::steps::StepsAsked;

/// Publishing ticks a second, and so the rate of `/joint_states` and `/clock` \[Hz\].
pub const PUBLISH_RATE: u32 = 60;
/// Time that one wake-up may spend on steps: a message to the arm may have to wait for that.
pub const WAKE_UP_BUDGET: Duration = Duration::from_millis(5);
/// Between two wake-ups while steps are owed. So the arm takes as much of its core as it needs, not a share that is
/// fixed by the rate of publishing. A timestep that no machine can follow leaves the others some of it.
pub const BREATHER: Duration = Duration::from_millis(1);
/// Steps between two looks at the clock: some 10 microseconds of work.
const STEPS_BETWEEN_LOOKS: u64 = 64;

/// The surroundings of the arm: clocks, and those who hear of it.
pub trait World<const N: usize> {
    /// The time since a fixed moment, by which simulation time goes.
    fn now(&self) -> Duration;

    /// A clock for the cost of work. Only differences mean something.
    fn work_time(&self) -> Duration;

    /// Publishes the frame that `write` writes, on a topic that somebody wants.
    fn publish(&self, topic: Topic, write: impl FnOnce() -> Bytes + Send + 'static);

    /// Tells the owner of the goal how it goes or how it ended.
    fn tell(&self, judged: GoalJudged<N>);

    /// The number of clients, and of the messages that were dropped.
    fn clients(&self) -> (u64, u64);

    /// The simulation has diverged.
    fn note_divergence(&self, _: Divergence) {}

    /// An estimate of the local error has been made.
    fn count_estimate(&self) {}
}

/// An arm of `N` links that moves as time goes on.
pub struct LiveArm<const N: usize, W> {
    pub(crate) world: W,
    pub(crate) simulation: Simulation<N>,
    pacer: Pacer,
    pub(crate) paused: bool,
    /// Simulation time at the latest pause, or at the reset since \[s\].
    pub(crate) paused_at: f64,
    /// Steps are owed, and a wake-up after a [`BREATHER`] will take them up.
    catching_up: bool,
    pub(crate) telemetry: Telemetry,
    pub(crate) goals: Goals<N>,
    limit: LimitWatch<N>,
    /// The listener to everything that the steps depend on, if there is one.
    pub(crate) journal: Option<Journal<N>>,
}

impl<const N: usize, W: World<N>> LiveArm<N, W> {
    /// An arm in the starting pose, running, with its controller off.
    #[must_use]
    pub fn new(arm: Arm<N>, gains: Gains<N>, world: W) -> Self {
        let simulation = Simulation::new(arm, gains);
        Self {
            pacer: Pacer::new(world.now(), simulation.timestep()),
            telemetry: Telemetry::new(world.now(), &simulation),
            world,
            simulation,
            paused: false,
            paused_at: 0.0,
            catching_up: false,
            goals: Goals::default(),
            limit: LimitWatch::default(),
            journal: None,
        }
    }

    /// Changes the time between two runs of the control law \[s\], not negative, before anything else is done.
    pub fn set_period(&mut self, period: f64) {
        let delay = false;
        self.simulation
            .set_control_period(ControlPeriod { period, delay });
    }

    /// The simulation as it is now.
    #[must_use]
    pub fn simulation(&self) -> &Simulation<N> {
        &self.simulation
    }

    /// The surroundings.
    #[must_use]
    pub fn world(&self) -> &W {
        &self.world
    }

    /// The settings as they are now.
    #[must_use]
    pub fn present(&self) -> Present<N> {
        Present {
            control: ControlLoop::of(&self.simulation),
            state: *self.simulation.state(),
        }
    }

    /// Somebody subscribes to a topic of the arm from now on, or nobody does.
    pub fn set_wanted(&mut self, topic: Topic, wanted: bool) {
        self.telemetry.set_wanted(topic, wanted);
        self.publish_lasting(topic);
    }

    /// Takes the steps that are due, as far as one wake-up's budget goes. True if others stay owed: the caller calls
    /// [`LiveArm::catch_up`] after a [`BREATHER`].
    pub fn advance_to_now(&mut self) -> bool {
        if self.paused || self.simulation.divergence().is_some() {
            return false;
        }
        // One budget for all that comes before the breather is over: were each message to cost one, a client that sends
        // many would keep the arm from everybody else.
        if self.catching_up {
            return false;
        }
        let due = self.pacer.due(self.world.now());
        if due == 0 {
            return false;
        }
        let taken = self.take_steps(due);
        self.pacer.took(taken);
        if self.simulation.divergence().is_some() {
            self.note_divergence();
            return false;
        }
        self.telemetry
            .note_backlog(due - taken, self.simulation.timestep());
        self.catching_up = taken < due;
        self.catching_up
    }

    /// Takes up what was owed before the breather; the answer is that of [`LiveArm::advance_to_now`].
    pub fn catch_up(&mut self) -> bool {
        self.catching_up = false;
        self.advance_to_now()
    }

    /// Takes up to `due` steps, and no longer than the budget; answers how many.
    fn take_steps(&mut self, due: u64) -> u64 {
        // The budget is about the processor's time, which tests in virtual time have too.
        let started = self.world.work_time();
        let mut taken = 0;
        while taken < due && self.spent_since(started) < WAKE_UP_BUDGET {
            taken += self.advance(STEPS_BETWEEN_LOOKS.min(due - taken), false).0;
            if self.simulation.divergence().is_some() {
                break;
            }
        }
        let spent = self.spent_since(started);
        self.telemetry
            .stepped(taken, spent, self.simulation.timestep());
        taken
    }

    fn spent_since(&self, started: Duration) -> Duration {
        self.world.work_time().saturating_sub(started)
    }

    /// Tells of a divergence that has just happened.
    pub(crate) fn note_divergence(&mut self) {
        if let Some(journal) = &mut self.journal {
            journal.diverge(&self.simulation);
        }
        self.telemetry.note_backlog(0, 0.0);
        if let Some(divergence) = self.simulation.divergence() {
            self.world.note_divergence(divergence);
        }
        self.publish_diagnostics();
    }

    /// Time counts from here: the part of an unfinished step is dropped.
    pub(crate) fn restart_pacer(&mut self) {
        self.telemetry.note_backlog(0, 0.0);
        self.pacer
            .restart(self.world.now(), self.simulation.timestep());
    }

    /// Has `input` take effect, from the next step on.
    pub(crate) fn change(&mut self, input: ArmInput<N>) {
        let steps = self.simulation.steps();
        self.simulation.apply(input);
        if let Some(journal) = &mut self.journal {
            journal.change(steps, input);
        }
    }

    /// Tells the state, if anybody listens and it has not been told.
    pub(crate) fn tell_state(&mut self) {
        if let Some(journal) = &mut self.journal {
            journal.stand(&self.simulation);
        }
    }
}

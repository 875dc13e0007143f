//! The live arm without an actor: steps that are due, requests, goals, limits, topics. The node `arm_sim` runs it on a
//! thread of its own, and the page in one file in its worker.
//!
//! The arm gets the time from its environment ([`World`]), and passes its messages there. `math::pacer` computes
//! the number of due steps, and `math::simulation` each step. `requests.rs` has the effects of requests. The other files
//! have the values and the messages of one subject each.
//!
//! **Invariant:** there is no physics here. The live arm and an offline `Simulation` are bit-identical. Only
//! `change` changes the simulation from outside.

mod counts;
mod goals;
mod ik_action;
mod ik_trial;
mod journal;
mod limit;
mod loads;
mod parameters;
mod path;
mod requests;
mod scene;
mod steps;
mod telemetry;

use std::ops::ControlFlow;
use std::time::Duration;

use bytes::Bytes;
use serde::Serialize;

use self::counts::{Counts, WakeUp, energy};
use self::goals::Goals;
use self::limit::LimitWatch;
use self::loads::Loads;
use self::telemetry::Health;
use crate::math::arm::{Arm, State};
use crate::math::kinematics::{Target, Unreachable, solve};
use crate::math::pacer::Pacer;
use crate::math::pid::{Gains, Setpoint};
use crate::math::simulation::{ArmInput, ControlPeriod, Divergence, Simulation};
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::scene::moving_frames;
use crate::protocol::messages::{self, Clock, Stamp};
use crate::protocol::op::fields::Rejections;
use crate::services::arm::{STEPS_IN_A_ROW, Step, Stepped, StepsEnd};
use crate::services::study::Present;
use crate::study::clocks::ClockLimits;
use crate::study::control_loop::ControlLoop;

pub use self::goals::{GoalOrder, GoalProgress, Obstacle, Pose, Tracking};
pub use self::ik_action::{GoalReport, IkGoals, cancelled};
pub use self::ik_trial::{GoalAnswer, IkTrials};
pub use self::journal::{ArmEvent, ArmListener, Journal, StepEvent};
pub use self::limit::LEAST_PAUSE;
pub use self::path::{FollowedPath, MoveSetpoint, PATH_PERIOD, PathEnd, PathMove};
pub use self::requests::ArmRequest;
pub use self::steps::StepsAsked;

/// Publishing ticks per second: the rate of `/joint_states` and `/clock` \[Hz\].
pub const PUBLISH_RATE: u32 = 60;
/// Ticks between two wake-ups of an arm that nothing observes.
pub const REST_TICKS: u64 = 6;
/// Ticks between two messages of `/arm_sim/error_estimate`. Its rate is 10 Hz, because people read it.
const ESTIMATE_TICKS: u64 = 6;
/// Most time of one wake-up for steps. A message to the arm may have to wait so long.
pub const WAKE_UP_BUDGET: Duration = Duration::from_millis(5);
/// Pause between two wake-ups while steps are due. So the arm can use most of its core, independent of the
/// publishing rate. With a timestep that is too short for the machine, other threads still get part of the core.
pub const STEP_PAUSE: Duration = Duration::from_millis(1);
/// Steps between two checks of the clock: about 10 microseconds of work.
const STEPS_BETWEEN_LOOKS: u64 = 64;

/// Why an effort is not applied.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the controller is on; {} with data false switches it off", Service::Enable.name())]
pub struct ControllerOn;

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

    // ---- time ------------------------------------------------------------------------------------------------------

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

    /// Takes up to `steps` steps, and returns their number. There are fewer if a goal is reached or the simulation
    /// diverges. For a caller that `waits` they also end at feedback, which is returned. While paused, a single step
    /// may be longer than a sixtieth of a second, so each step may have feedback.
    fn advance(&mut self, steps: u64, waits: bool) -> (u64, Option<GoalProgress<N>>) {
        let past = self.goals.past;
        let mut loads = Loads::are_watched(&self.simulation).then_some(&mut self.loads);
        if let Some(loads) = &mut loads {
            loads.begin(&self.simulation);
        }
        let Some(tracked) = self.goals.commanded() else {
            let Some(loads) = loads else {
                return (self.simulation.advance(steps), None);
            };
            let count = |simulation: &Simulation<N>| {
                loads.count(simulation);
                ControlFlow::Continue(())
            };
            return (self.simulation.advance_with(steps, count), None);
        };
        let (mut progress, mut reached) = (None, None);
        let world = &self.world;
        let taken = self.simulation.advance_with(steps, |simulation| {
            if let Some(loads) = &mut loads {
                loads.count(simulation);
            }
            (progress, reached) = tracked.judge(simulation, past);
            let news = if !waits || reached.is_some() {
                progress.take()
            } else {
                None
            };
            if let Some(news) = news {
                world.tell(news);
            }
            if progress.is_some() || reached.is_some() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        if let Some(reached) = reached {
            self.world.tell(reached);
            self.goals.end_reached(reached);
        }
        (taken, progress)
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

    // ---- inputs ----------------------------------------------------------------------------------------------------

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

    /// A client's setpoint is held from the next step on.
    pub fn hold(&mut self, setpoint: Setpoint<N>) {
        self.change(ArmInput::Setpoint(setpoint));
        self.goals.setpoint_waits = !self.simulation.pid().is_enabled();
    }

    /// A client's effort \[N m\] is applied from the next step on.
    ///
    /// # Errors
    /// While the controller is on.
    pub fn command(&mut self, effort: [f64; N]) -> Result<(), ControllerOn> {
        if self.simulation.pid().is_enabled() {
            return Err(ControllerOn);
        }
        self.change(ArmInput::Command(effort));
        Ok(())
    }

    // ---- single steps of a paused arm, in rows: a row ends with each message about a goal ---------------------------

    /// Checks whether the steps can be taken.
    ///
    /// # Errors
    /// All rejected fields of the request.
    pub fn begin_steps(&self, ask: Step<N>) -> Result<StepsAsked<N>, Rejections> {
        let has_diverged = self.simulation.divergence().is_some();
        StepsAsked::begin(ask, self.paused, has_diverged)
    }

    /// Takes the next row of steps. Returns the answer after the last one, and the message about the goal to be
    /// sent before the next row.
    pub fn take_row(
        &mut self,
        steps: &mut StepsAsked<N>,
    ) -> (Option<Stepped<N>>, Option<GoalProgress<N>>) {
        if !self.paused {
            return (
                Some(steps.answer(&self.simulation, StepsEnd::Resumed)),
                None,
            );
        }
        let has_diverged = self.simulation.divergence().is_some();
        if steps.effort.is_some() {
            self.change(ArmInput::Drive(steps.effort));
        }
        let row_end = steps.asked.min(steps.taken + STEPS_IN_A_ROW);
        let mut progress = None;
        // A reached goal ends an advance, but not the request. News of a goal end the row.
        while steps.taken < row_end && progress.is_none() && self.simulation.divergence().is_none()
        {
            let taken;
            (taken, progress) = self.advance(row_end - steps.taken, true);
            steps.taken += taken;
        }
        if steps.effort.is_some() {
            self.change(ArmInput::Drive(None));
        }
        let end = if self.simulation.divergence().is_some() {
            if !has_diverged {
                self.note_divergence();
            }
            Some(StepsEnd::Diverged)
        } else {
            (steps.taken == steps.asked).then_some(StepsEnd::AllTaken)
        };
        (end.map(|end| steps.answer(&self.simulation, end)), progress)
    }

    // ---- goals ------------------------------------------------------------------------------------------------------

    /// The present state of the arm.
    #[must_use]
    pub fn pose(&self) -> Pose<N> {
        Pose {
            stands_still: self.paused && self.simulation.time() <= self.paused_at,
            ..Pose::of(&self.simulation, self.goals.past)
        }
    }

    /// Whether each step is checked.
    #[must_use]
    pub fn judges_steps(&self) -> bool {
        self.goals.judge_steps()
    }

    /// Joint positions that put the end effector on the target, with the elbow on the side of the present pose \[rad\].
    ///
    /// # Errors
    /// If the target is out of reach.
    pub fn solve(&self, target: &Target) -> Result<[f64; N], Unreachable> {
        let (arm, state) = (self.simulation.arm(), self.simulation.state());
        solve(arm.lengths(), &state.position, target)
    }

    /// Begins a goal and ends the previous one, at the same time. Its steps are checked once it is
    /// [commanded](Self::command_goal).
    ///
    /// # Errors
    /// If the target is out of reach. Nothing changes then.
    pub fn track_goal(&mut self, order: &GoalOrder) -> Result<Tracking<N>, Unreachable> {
        let solution = self.solve(&order.target)?;
        Ok(self.goals.track(order, &solution, &self.simulation))
    }

    /// Holds the goal's setpoint \[rad\] from the next step on, and checks the goal, unless it has ended.
    pub fn command_goal(&mut self, number: u64, positions: [f64; N]) {
        if self.goals.command(number, self.simulation.time()) {
            self.change(ArmInput::Setpoint(Setpoint::at(positions)));
        }
    }

    /// Preempts the goal, unless it has ended already. Returns how the latest goal ended.
    pub fn end_goal(&mut self, number: u64) -> Option<GoalProgress<N>> {
        self.goals.end(number, &self.simulation)
    }

    /// Call this before the simulation is reset. It preempts the goal and informs its owner.
    fn end_goal_for_reset(&mut self) {
        if let Some(progress) = self.goals.end_for_reset(&self.simulation) {
            self.world.tell(progress);
        }
    }

    // ---- topics: nothing is computed for one without subscribers ----------------------------------------------------

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

    /// Publishes the messages that are due at a tick, after the steps until then: states and `/clock` at every tick,
    /// `/arm_sim/error_estimate` at every sixth, `/diagnostics` once a second and at every change.
    pub fn tick(&mut self) {
        if self.wants_limit() {
            let is_held_up = self.goals.are_held_up(&self.simulation);
            if self.limit.note_warnings(&self.simulation, is_held_up) {
                self.publish_diagnostics();
            }
        }
        self.counts.ticks += 1;
        let ticks = self.counts.ticks;
        self.publish_state();
        if self.counts.wants(Topic::ErrorEstimate) && ticks.is_multiple_of(ESTIMATE_TICKS) {
            let estimate = self.limit.error_estimate(&self.simulation);
            self.world.count_estimate();
            self.publish(Topic::ErrorEstimate, move || estimate);
        }
        if ticks.is_multiple_of(u64::from(PUBLISH_RATE)) {
            self.publish_diagnostics();
            self.counts.end_window(self.world.now(), self.stands());
            self.loads.end_window();
        }
        self.tell_state();
    }

    /// Counts ticks at which there was nothing to publish.
    pub const fn skip_ticks(&mut self, count: u64) {
        self.counts.ticks += count;
    }

    /// The number of ticks until the next one at which the arm must wake.
    #[must_use]
    pub fn ticks_to_wake(&self) -> u64 {
        match self.is_observed() {
            true => 1,
            false => REST_TICKS - self.counts.ticks % REST_TICKS,
        }
    }

    /// Publishes the topics of a moving arm.
    fn publish_state(&self) {
        let (simulation, wants) = (&self.simulation, |topic| self.counts.wants(topic));
        let stamp = Stamp::from_seconds(simulation.time());
        if wants(Topic::JointStates) {
            self.publish_joint_state(Topic::JointStates, stamp, *simulation.state());
        }
        if wants(Topic::MeasuredStates) {
            self.publish_joint_state(Topic::MeasuredStates, stamp, simulation.measured());
        }
        if wants(Topic::Clock) {
            self.publish(Topic::Clock, move || Clock { clock: stamp });
        }
        let (lengths, positions) = (*simulation.arm().lengths(), simulation.state().position);
        if wants(Topic::Tf) {
            let frames = move || moving_frames(stamp, &lengths, &positions);
            self.publish(Topic::Tf, frames);
        }
        if wants(Topic::TfWeb) && self.counts.ticks.is_multiple_of(2) {
            let frames = move || scene::seen_from_world(stamp, &lengths, &positions);
            self.publish(Topic::TfWeb, frames);
        }
    }

    fn publish_joint_state(&self, topic: Topic, stamp: Stamp, state: State<N>) {
        let effort = *self.simulation.effort();
        let write = move || telemetry::joint_state(topic, stamp, &state, &effort);
        self.world.publish(topic, write);
    }

    /// Publishes that the arm may move again. Rates count from here.
    fn publish_new_state(&mut self) {
        self.counts.restart_window(self.world.now());
        self.publish_diagnostics();
    }

    /// Publishes `/diagnostics`, if it has subscribers.
    fn publish_diagnostics(&mut self) {
        if self.counts.wants(Topic::Diagnostics) {
            let health = Health {
                simulation: &self.simulation,
                is_paused: self.paused,
                counts: &self.counts,
                goals: &self.goals,
                loads: &self.loads,
                limit: &self.limit,
                now: self.world.now(),
                clients: self.world.clients(),
            };
            let diagnostics = health.diagnostics();
            self.publish(Topic::Diagnostics, move || diagnostics);
            self.counts.window.longest = WakeUp::default();
        }
    }

    /// Measures the drift from the present energy.
    fn restart_energy_drift(&mut self) {
        self.counts.energy_reference = energy(&self.simulation);
        self.loads.friction = 0.0;
    }

    /// Publishes the topics that show lengths or masses, if these differ from those of the arm `before`.
    fn publish_description(&self, before: &Arm<N>) {
        let arm = self.simulation.arm();
        let is_as_long = arm.lengths().iter().eq(before.lengths());
        if !is_as_long {
            self.publish_lasting(Topic::TfStatic);
        }
        if !is_as_long || arm.masses().iter().ne(before.masses()) {
            self.publish_lasting(Topic::RobotDescription);
        }
    }

    /// Publishes a message that stays valid until the next one, if the topic has subscribers.
    fn publish_lasting(&self, topic: Topic) {
        if self.counts.wants(topic)
            && let Some(write) = scene::lasting(topic, &self.simulation)
        {
            self.world.publish(topic, write);
        }
    }

    /// Publishes the message of `make`, which is called when the frame is written.
    pub fn publish<M: Serialize>(&self, topic: Topic, make: impl FnOnce() -> M + Send + 'static) {
        self.world
            .publish(topic, move || messages::publish(topic.name(), &make()));
    }

    // ---- limits -----------------------------------------------------------------------------------------------------

    fn wants_limit(&self) -> bool {
        self.counts.wants(Topic::Diagnostics) || self.counts.wants(Topic::ErrorEstimate)
    }

    /// The active loop, if its limit must be predicted. `None` if the limit is known, requested already, or not
    /// shown. The caller passes the prediction to [`LiveArm::keep_limit`].
    pub fn limit_to_predict(&mut self) -> Option<ControlLoop<N>> {
        if !self.wants_limit() {
            return None;
        }
        let now = self.world.now();
        self.limit.next_prediction(&self.simulation, now)
    }

    /// The prediction for a loop, if there is one.
    pub fn keep_limit(&mut self, of: ControlLoop<N>, limits: Option<ClockLimits>) {
        self.limit.keep(of, limits);
    }
}

//! The live loop without time: arm, state, control law, method and step counter, advanced in whole steps.
//!
//! One step, from the state `(q, q̇)` at its start:
//!
//! 1. with the controller on, the control law runs ([`Pid::control`]) if a control period begins ([`ControlPeriod`]),
//!    else its effort is held; off, the effort is what was commanded; a disturbance that has not ended
//!    ([`Disturbance`]) is added to it;
//! 2. that effort is held while the method's stages evaluate the dynamics ([`step_under`]);
//! 3. the increments are added with their rounding errors carried, `(q, q̇)` and integral are replaced together.
//!
//! The arm's actor, the study, the benchmarks and the tests all step through here, so that the arm that is studied is
//! the live one, bit for bit. This may use the rest of `math`, and knows no time but that of its steps.
//!
//! **Invariant:** state and time are finite. A step after which they would not be is not taken, in whole or in part,
//! and nothing steps after it until [`Simulation::reset`].

#![allow(
    clippy::indexing_slicing,
    reason = "every index comes from `array::from_fn` over arrays of the same constant length"
)]

#[cfg(feature = "batch")]
pub mod batch;
mod checkpoint;
mod clock;
mod hold;
mod increments;
mod input;

use std::ops::ControlFlow;

pub use self::checkpoint::Checkpoint;
pub use self::hold::{ControlPeriod, Held, Hold};
pub(crate) use self::increments::add_carried;
use self::increments::{leaves_out_first_angle, stepped};
pub use self::increments::{state_after, step_under};
pub use self::input::ArmInput;
use super::arm::{Arm, State};
use super::dynamics::{forward_dynamics, weightless_dynamics};
use super::integrator::Method;
use super::pid::{Control, Gains, Pid, Setpoint};

/// Timestep until another is set \[s\]. A third of what the default gains are stable to.
pub const DEFAULT_TIMESTEP: f64 = 0.001;

/// The step that a simulation did not take, since state or time would not have been finite after it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Divergence {
    /// Number of the step, since the reset, that was not taken; the first step is 1.
    pub step: u64,
    /// Simulation time at which that step began, and at which the clock stands \[s\].
    pub time: f64,
}

/// An effort from outside, added to that of every step that begins before it ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disturbance<const N: usize> {
    /// Effort per joint \[N m\].
    pub effort: [f64; N],
    /// Simulation time at which it ends \[s\].
    ends: f64,
}

impl<const N: usize> Disturbance<N> {
    /// `effort` \[N m\] over `duration` \[s\], greater than 0, from simulation time `start` \[s\] on: `duration /
    /// timestep` steps, rounded up, so that at least one takes it.
    ///
    /// The end is brought forward by more than the roundings of the sum and of the times that it is compared with, and
    /// by far less than a timestep. So 1.1 s in steps of 0.1 s are eleven steps, not twelve.
    fn new(effort: [f64; N], start: f64, duration: f64) -> Self {
        let ends = (start + duration) * (1.0 - 4.0 * f64::EPSILON);
        Self {
            effort,
            ends: ends.max(start.next_up()),
        }
    }
}

/// An arm under control, advanced in whole steps.
///
/// ```
/// use pendularm::math::{arm::Arm, pid::{Gains, Setpoint}, simulation::Simulation};
///
/// let mut simulation = Simulation::<2>::new(Arm::default(), Gains::default());
/// simulation.enable(true);
/// simulation.set_setpoint(Setpoint { position: [0.3, -0.5], velocity: [0.0; 2] });
/// simulation.advance(4000);
/// assert_eq!(simulation.time(), 4.0);
/// assert!((simulation.state().position[0] - 0.3).abs() < 0.02);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation<const N: usize> {
    arm: Arm<N>,
    pid: Pid<N>,
    hold: Hold<N>,
    method: Method,
    /// Length of a step \[s\].
    timestep: f64,
    state: State<N>,
    /// The rounding error of `state` so far: position \[rad\], velocity \[rad/s\].
    carry: State<N>,
    /// Effort of the latest step \[N m\].
    effort: [f64; N],
    /// The disturbance that is added to the effort of the next step.
    disturbance: Option<Disturbance<N>>,
    /// Simulation time when this timestep came into force \[s\].
    base: f64,
    /// Steps taken since then.
    steps_since_base: u64,
    /// Steps taken since the reset.
    steps: u64,
    divergence: Option<Divergence>,
}

impl<const N: usize> Simulation<N> {
    /// An arm in the starting pose, q = 0 at rest, with Runge-Kutta 4 at [`DEFAULT_TIMESTEP`] and the controller off.
    #[must_use]
    pub fn new(arm: Arm<N>, gains: Gains<N>) -> Self {
        Self {
            arm,
            pid: Pid::new(gains),
            hold: Hold::new(Held::default(), DEFAULT_TIMESTEP),
            method: Method::Rk4,
            timestep: DEFAULT_TIMESTEP,
            state: State::rest(),
            carry: State::rest(),
            effort: [0.0; N],
            disturbance: None,
            base: 0.0,
            steps_since_base: 0,
            steps: 0,
            divergence: None,
        }
    }

    /// Takes one step; `false` if the simulation diverges or has diverged.
    pub fn step(&mut self) -> bool {
        self.advance(1) == 1
    }

    /// Takes up to `steps` steps and answers how many: all of them unless the simulation has diverged.
    pub fn advance(&mut self, steps: u64) -> u64 {
        self.advance_with(steps, |_| ControlFlow::Continue(()))
    }

    /// Does what [`Simulation::advance`] does, and shows `observe` the state after every step. `observe` may end the
    /// advance there. A judge of every physics step hooks in here.
    pub fn advance_with(
        &mut self,
        steps: u64,
        observe: impl FnMut(&Self) -> ControlFlow<()>,
    ) -> u64 {
        if self.divergence.is_some() {
            return 0;
        }
        let with_time = self.steps_with_time(steps);
        // Asked once for all steps.
        let taken = if leaves_out_first_angle(&self.arm) {
            self.take_steps::<false>(with_time, observe)
        } else {
            self.take_steps::<true>(with_time, observe)
        };
        match taken {
            ControlFlow::Break(taken) => taken,
            ControlFlow::Continue(()) => {
                if with_time < steps {
                    self.diverge();
                }
                with_time
            }
        }
    }

    /// Takes `steps` steps. Breaks with the number of steps taken where the run ends early.
    fn take_steps<const HAS_GRAVITY: bool>(
        &mut self,
        steps: u64,
        mut observe: impl FnMut(&Self) -> ControlFlow<()>,
    ) -> ControlFlow<u64> {
        // The choice of method and of control stays inside: hoisted, the loop was measured to be no faster.
        for taken in 0..steps {
            if !self.take_step::<HAS_GRAVITY>() {
                self.diverge();
                return ControlFlow::Break(taken);
            }
            if observe(self).is_break() {
                return ControlFlow::Break(taken + 1);
            }
        }
        ControlFlow::Continue(())
    }

    /// Notes that the next step is not taken, nor any after it.
    fn diverge(&mut self) {
        self.divergence = Some(Divergence {
            step: self.steps + 1,
            time: self.time(),
        });
    }

    /// Takes one step. If its result is not finite, changes nothing and returns `false`.
    #[inline]
    fn take_step<const HAS_GRAVITY: bool>(&mut self) -> bool {
        let mut held = None;
        let mut control = if !self.hold.every_step {
            self.begin_held_step(&mut held)
        } else if self.pid.is_enabled() {
            self.pid.control(&self.state, self.timestep)
        } else {
            Control {
                effort: [0.0; N],
                integral: *self.pid.integral(),
            }
        };
        if self.disturbance.is_some() {
            self.add_disturbance(&mut control.effort);
        }
        let (arm, effort) = (&self.arm, &control.effort);
        let (next, carry) = stepped(
            |_, q: &[f64; N], v: &[f64; N]| {
                if HAS_GRAVITY {
                    forward_dynamics(arm, q, v, effort)
                } else {
                    weightless_dynamics(arm, q, v, effort)
                }
            },
            self.method,
            &self.state,
            &self.carry,
            self.timestep,
        );
        if !next.is_finite() {
            return false;
        }
        if let Some(held) = held {
            self.hold.commit(held);
        }
        self.state = next;
        self.carry = carry;
        self.effort = control.effort;
        self.pid.commit(control.integral);
        self.steps_since_base += 1;
        self.steps += 1;
        true
    }

    /// The effort that the next step would be taken with \[N m\]: the controller's and the disturbance's together.
    #[must_use]
    pub fn effort_of_next_step(&self) -> [f64; N] {
        let controlled = self.hold.begin_step(&self.pid, &self.state).0.effort;
        match self.disturbance {
            Some(push) if self.time() < push.ends => {
                std::array::from_fn(|i| controlled[i] + push.effort[i])
            }
            _ => controlled,
        }
    }

    /// The control of a step in whose period there are others.
    #[inline(never)]
    fn begin_held_step(&self, after: &mut Option<Held<N>>) -> Control<N> {
        let (control, held) = self.hold.begin_step(&self.pid, &self.state);
        *after = Some(held);
        control
    }

    /// Adds the disturbance to the effort of the step that begins now, or ends it if its time is over.
    #[cold]
    fn add_disturbance(&mut self, effort: &mut [f64; N]) {
        match self.disturbance {
            Some(disturbance) if self.time() < disturbance.ends => {
                *effort = std::array::from_fn(|i| effort[i] + disturbance.effort[i]);
            }
            _ => self.disturbance = None,
        }
    }

    /// Adds `effort` \[N m\] to that of every step that begins within `duration` \[s\], greater than 0, of simulation
    /// time from now. A disturbance that still acts ends here. With the controller off, this is all the effort there
    /// is.
    pub fn disturb(&mut self, effort: [f64; N], duration: f64) {
        self.disturbance = Some(Disturbance::new(effort, self.time(), duration));
    }

    /// Goes back to the starting pose at rest, at time 0. Setpoint and integral follow, all efforts are zero,
    /// disturbance and divergence end, and a control period begins. Gains, arm, method, timestep, control period, and
    /// whether the controller is on, stay.
    pub fn reset(&mut self) {
        self.set_state(State::rest());
        self.pid.reset();
        self.hold.forget(self.timestep);
        self.effort = [0.0; N];
        self.disturbance = None;
        self.base = 0.0;
        self.steps_since_base = 0;
        self.steps = 0;
    }

    /// Joint positions and velocities.
    #[must_use]
    pub fn state(&self) -> &State<N> {
        &self.state
    }

    /// Puts the arm into another state, which must be finite, and ends a divergence; clock and controller stay.
    pub fn set_state(&mut self, state: State<N>) {
        self.state = state;
        self.carry = State::rest();
        self.divergence = None;
    }

    /// Effort of the latest step \[N m\], the controller's and the disturbance's together; zeros at once when the
    /// controller is turned off, and after a reset.
    #[must_use]
    pub fn effort(&self) -> &[f64; N] {
        &self.effort
    }

    /// Steps taken since the reset.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// The method that takes the steps.
    #[must_use]
    pub fn method(&self) -> Method {
        self.method
    }

    /// Changes the method from the next step on.
    pub fn set_method(&mut self, method: Method) {
        self.method = method;
    }

    /// Length of a step \[s\].
    #[must_use]
    pub fn timestep(&self) -> f64 {
        self.timestep
    }

    /// The arm's parameters.
    #[must_use]
    pub fn arm(&self) -> &Arm<N> {
        &self.arm
    }

    /// Changes the arm's parameters; positions and velocities of the joints stay.
    pub fn set_arm(&mut self, arm: Arm<N>) {
        self.arm = arm;
    }

    /// The controller, to be read.
    #[must_use]
    pub fn pid(&self) -> &Pid<N> {
        &self.pid
    }

    /// Turns the controller on or off ([`Pid::enable`]). Off, the effort is zero at once. A change begins a control
    /// period; commands end in either case, unless what is on is turned on.
    pub fn enable(&mut self, on: bool) {
        if on && self.pid.is_enabled() {
            return;
        }
        self.pid.enable(on);
        self.hold.forget(self.timestep);
        if !on {
            self.effort = [0.0; N];
        }
    }

    /// The time between two runs of the control law.
    #[must_use]
    pub fn control_period(&self) -> ControlPeriod {
        self.hold.held.period
    }

    /// Changes the time between two runs of the control law, which must be finite and not negative; a period begins
    /// with the next step. A value that is in force already changes nothing.
    pub fn set_control_period(&mut self, period: ControlPeriod) {
        if period != self.hold.held.period {
            let change = |held: &mut Held<N>| held.period = period;
            self.hold.begin_period(self.timestep, change);
        }
    }

    /// The effort that was commanded last \[N m\]; zeros while the controller is on.
    #[must_use]
    pub fn command(&self) -> &[f64; N] {
        &self.hold.held.command
    }

    /// Applies `effort` \[N m\] from the next step on, while the controller is off, until it is switched or the
    /// simulation reset.
    pub fn set_command(&mut self, effort: [f64; N]) {
        self.hold.set_command(effort, self.timestep);
    }

    /// Applies `effort` \[N m\] instead of the controller's and of commands from the next step on, or no longer. The
    /// controller is paused meanwhile; a control period begins afterwards.
    pub fn drive(&mut self, effort: Option<[f64; N]>) {
        let change = |held: &mut Held<N>| held.driven = effort;
        self.hold.begin_period(self.timestep, change);
    }

    /// Changes the gains and keeps the integral.
    pub fn set_gains(&mut self, gains: Gains<N>) {
        self.pid.set_gains(gains);
    }

    /// Changes the setpoint, whether the controller is on or off.
    pub fn set_setpoint(&mut self, setpoint: Setpoint<N>) {
        self.pid.set_setpoint(setpoint);
    }

    /// The first step since the reset that was not taken, since state or time would not have been finite after it.
    #[must_use]
    pub fn divergence(&self) -> Option<Divergence> {
        self.divergence
    }
}

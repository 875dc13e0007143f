//! The live loop without time: arm, state, control law, method and step counter, advanced in whole steps.
//!
//! One step, from the state `(q, q̇)` at its start:
//!
//! 1. with the controller on, the control law runs ([`Pid::control`]) if a control period begins ([`ControlPeriod`]),
//!    else its effort is held. With the controller off, the effort is the commanded one. An active disturbance
//!    ([`Disturbance`]) is added to it.
//! 2. That effort is held while the method's stages evaluate the dynamics (`stepped` in `increments.rs`).
//! 3. The increments are added with their rounding errors carried. `(q, q̇)` and the integral are replaced
//!    together.
//!
//! The arm's actor, the study, the benchmarks and the tests all use these steps, so the studied arm is the live one,
//! bit for bit. The only time here is that of the steps.
//!
//! **Invariant:** state and time are finite. A step with another result is not taken, not even in part, and no step
//! follows it until [`Simulation::reset`].

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
pub use self::hold::{After, ControlPeriod, Held, Hold, Memory};
pub(crate) use self::increments::add_carried;
use self::increments::{leaves_out_first_angle, stepped};
pub use self::increments::{state_after, step_under};
pub use self::input::{ArmInput, StepNote};
use super::arm::{Arm, State};
use super::dynamics::{forward_dynamics, less_friction, weightless_dynamics};
use super::integrator::Method;
use super::limits::Limits;
use super::pid::{Control, Gains, Pid, Setpoint};
use super::sensors::Sensors;

/// Default timestep \[s\]: at most a third of the stability limit of the default gains.
pub const DEFAULT_TIMESTEP: f64 = 0.001;

/// The step that a simulation did not take, because state or time would not be finite after it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Divergence {
    /// Number of the step that was not taken, counted from 1 since the reset.
    pub step: u64,
    /// Simulation time at the start of that step, where the clock stopped \[s\].
    pub time: f64,
}

/// An external effort, added to that of every step that begins before its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disturbance<const N: usize> {
    /// Effort per joint \[N m\].
    pub effort: [f64; N],
    /// Simulation time at which it ends \[s\].
    ends: f64,
}

impl<const N: usize> Disturbance<N> {
    /// `effort` \[N m\] for `duration` \[s\], greater than 0, from simulation time `start` \[s\] on: `duration /
    /// timestep` steps, rounded up, and so at least one.
    ///
    /// The end is earlier by more than the rounding errors of the sum and of the compared times, and by far less than
    /// a timestep. So 1.1 s in steps of 0.1 s are eleven steps, not twelve.
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
    /// Simulation time at which this timestep was set \[s\].
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
            hold: Hold::new(
                Held::default(),
                Limits::default(),
                Default::default(),
                DEFAULT_TIMESTEP,
            ),
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

    /// Takes up to `steps` steps and returns their number: all of them, unless the simulation diverges or has diverged.
    pub fn advance(&mut self, steps: u64) -> u64 {
        self.advance_with(steps, |_| ControlFlow::Continue(()))
    }

    /// Does the same as [`Simulation::advance`], and calls `observe` with the state after every step. `observe` may
    /// stop the advance there. Goals use it to check every physics step.
    pub fn advance_with(
        &mut self,
        steps: u64,
        observe: impl FnMut(&Self) -> ControlFlow<()>,
    ) -> u64 {
        if self.divergence.is_some() {
            return 0;
        }
        // A function of its own, so the compiler makes the same code as without friction of the steps below.
        if self.arm.has_friction() {
            return self.advance_damped(steps, observe);
        }
        let with_time = self.steps_with_time(steps);
        // Evaluated once for all steps.
        let taken = if leaves_out_first_angle(&self.arm) {
            self.take_steps::<false, false>(with_time, observe)
        } else {
            self.take_steps::<true, false>(with_time, observe)
        };
        self.ended(taken, with_time, steps)
    }

    /// [`Simulation::advance_with`] of an arm with friction.
    #[inline(never)]
    fn advance_damped(&mut self, steps: u64, observe: impl FnMut(&Self) -> ControlFlow<()>) -> u64 {
        let with_time = self.steps_with_time(steps);
        let taken = self.take_steps::<true, true>(with_time, observe);
        self.ended(taken, with_time, steps)
    }

    /// The number of taken steps, of `steps` of which `with_time` lead to a finite time.
    #[inline]
    fn ended(&mut self, taken: ControlFlow<u64>, with_time: u64, steps: u64) -> u64 {
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

    /// Takes `steps` steps. Breaks with the number of taken steps if the run ends early.
    fn take_steps<const USES_FIRST_ANGLE: bool, const HAS_FRICTION: bool>(
        &mut self,
        steps: u64,
        mut observe: impl FnMut(&Self) -> ControlFlow<()>,
    ) -> ControlFlow<u64> {
        // The match on method and control stays inside the loop: hoisting it gave no measured speedup.
        for taken in 0..steps {
            if !self.take_step::<USES_FIRST_ANGLE, HAS_FRICTION>() {
                self.diverge();
                return ControlFlow::Break(taken);
            }
            if observe(self).is_break() {
                return ControlFlow::Break(taken + 1);
            }
        }
        ControlFlow::Continue(())
    }

    /// Records the divergence: neither the next step nor any after it is taken.
    fn diverge(&mut self) {
        self.divergence = Some(Divergence {
            step: self.steps + 1,
            time: self.time(),
        });
    }

    /// Takes one step. If its result is not finite, changes nothing and returns `false`.
    #[inline]
    fn take_step<const USES_FIRST_ANGLE: bool, const HAS_FRICTION: bool>(&mut self) -> bool {
        let mut held = None;
        let mut control = if self.pid.is_enabled() {
            self.pid.control(&self.state, self.timestep)
        } else {
            Control {
                effort: [0.0; N],
                integral: *self.pid.integral(),
            }
        };
        if !self.hold.every_step {
            self.begin_held_step(&mut held, &mut control);
        }
        if self.disturbance.is_some() {
            self.add_disturbance(&mut control.effort);
        }
        let (arm, effort) = (&self.arm, &control.effort);
        let (next, carry) = stepped(
            |_, q: &[f64; N], v: &[f64; N]| {
                if HAS_FRICTION {
                    forward_dynamics(arm, q, v, &less_friction(arm.viscous(), v, effort))
                } else if USES_FIRST_ANGLE {
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

    /// The effort of the next step \[N m\]: the controller's plus the disturbance's.
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

    /// The control of a step whose effort is not simply that of the law on the present state.
    #[cold]
    #[inline(never)]
    fn begin_held_step(&self, after: &mut Option<After<N>>, control: &mut Control<N>) {
        let (begun, held) = self.hold.begin_step(&self.pid, &self.state);
        *after = Some(held);
        *control = begun;
    }

    /// Adds the disturbance to the effort of the step that begins now, or ends the disturbance if its time is over.
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
    /// time from now. A disturbance that still acts ends here. With the controller off, it is the only effort besides
    /// commands.
    pub fn disturb(&mut self, effort: [f64; N], duration: f64) {
        self.disturbance = Some(Disturbance::new(effort, self.time(), duration));
    }

    /// Returns to the starting pose at rest, at time 0. Setpoint and integral are reset, all efforts are zero,
    /// disturbance and divergence end, and a control period begins. Gains, arm, method, timestep, control period,
    /// limits, sensors and the controller's on/off state do not change.
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

    /// Puts the arm into another state, which must be finite, and ends a divergence. Clock and controller do
    /// not change. The next measured difference of positions is zero.
    pub fn set_state(&mut self, state: State<N>) {
        self.state = state;
        self.carry = State::rest();
        self.divergence = None;
        self.hold.forget_measurement();
    }

    /// Effort of the latest step \[N m\], that of the motors plus the disturbance's. It is zero as soon as the
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

    /// Changes the arm's parameters. Positions and velocities of the joints do not change.
    pub fn set_arm(&mut self, arm: Arm<N>) {
        self.arm = arm;
    }

    /// The controller, read only.
    #[must_use]
    pub fn pid(&self) -> &Pid<N> {
        &self.pid
    }

    /// Turns the controller on or off ([`Pid::enable`]). Off, the effort is zero at once. A change begins a control
    /// period. Commands end, unless the controller is already on and is turned on.
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

    /// Changes the time between two runs of the control law, which must be finite and not negative. A period begins
    /// with the next step. The present value changes nothing.
    pub fn set_control_period(&mut self, period: ControlPeriod) {
        if period != self.hold.held.period {
            let change = |held: &mut Held<N>| held.period = period;
            self.hold.begin_period(self.timestep, change);
        }
    }

    /// The last commanded effort \[N m\]; zeros while the controller is on.
    #[must_use]
    pub fn command(&self) -> &[f64; N] {
        &self.hold.held.command
    }

    /// Applies `effort` \[N m\] from the next step on, while the controller is off, until the controller is
    /// switched or the simulation is reset.
    pub fn set_command(&mut self, effort: [f64; N]) {
        self.hold.set_command(effort, self.timestep);
    }

    /// Applies `effort` \[N m\] from the next step on, in place of the controller's and of commands; `None` ends
    /// this. The controller does not run meanwhile. A control period begins afterwards.
    pub fn drive(&mut self, effort: Option<[f64; N]>) {
        self.hold.drive(effort);
    }

    /// The limits of the motors.
    #[must_use]
    pub fn limits(&self) -> &Limits<N> {
        &self.hold.limits
    }

    /// Changes the limits of the motors from the next step on. The integral and the control period go on. Each limit
    /// must not be negative or NaN, and the tracking time must be greater than 0.
    pub fn set_limits(&mut self, limits: Limits<N>) {
        self.hold.set_limits(limits, self.timestep);
    }

    /// The sensors of the controller.
    #[must_use]
    pub fn sensors(&self) -> &Sensors<N> {
        &self.hold.sensors
    }

    /// Changes the sensors from the next run of the control law on. The integral and the control period go on, and the
    /// first difference of positions is zero. Each step of an encoder must be finite and not negative.
    pub fn set_sensors(&mut self, sensors: Sensors<N>) {
        self.hold.set_sensors(sensors, self.timestep);
    }

    /// What the control law has measured in its latest run \[rad, rad/s\]. If there is none since the controller was
    /// switched on, the arm was put into another state or a control period began at once, it is what the first run would
    /// measure now.
    #[must_use]
    pub fn measured(&self) -> State<N> {
        self.hold.measured(&self.state)
    }

    /// The joints whose motor was at its limit in the latest step. A joint without a motor is not among them.
    #[must_use]
    pub fn at_limit(&self) -> [bool; N] {
        self.hold.at_limit(self.pid.is_enabled())
    }

    /// Changes the gains and keeps the integral.
    pub fn set_gains(&mut self, gains: Gains<N>) {
        self.pid.set_gains(gains);
    }

    /// Changes the setpoint, whether the controller is on or off.
    pub fn set_setpoint(&mut self, setpoint: Setpoint<N>) {
        self.pid.set_setpoint(setpoint);
    }

    /// The first step since the reset that was not taken, because state or time would not be finite after it.
    #[must_use]
    pub fn divergence(&self) -> Option<Divergence> {
        self.divergence
    }
}

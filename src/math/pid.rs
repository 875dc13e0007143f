//! The control law: per joint, proportional, integral and derivative on a held setpoint.
//!
//! ```text
//! e = q* - q        I = clamp(I + e dt, -I_max, +I_max)        τ = kp e + ki I + kd (q̇* - q̇)
//! ```
//!
//! | symbol | name | unit | where |
//! | --- | --- | --- | --- |
//! | q*, q̇* | setpoint | rad, rad/s | [`Setpoint`] |
//! | kp, ki, kd | gains | N m/rad, N m/(rad s), N m s/rad | [`Gains`] |
//! | I | integral of the position error | rad s | [`Pid::integral`] |
//! | `I_max` | anti-windup limit | rad s | [`INTEGRAL_LIMIT`] |
//! | τ | effort | N m | [`Control`] |
//!
//! The derivative term uses the measured velocity and no difference of errors. There is no gravity compensation:
//! with ki = 0 the arm sags until kp e carries its load.
//!
//! **Invariant:** the law is a pure function of the state at the start of a step. The computed integral counts
//! only after the caller commits it, so a step that is not taken has no effect.

#![allow(
    clippy::indexing_slicing,
    reason = "every index runs over arrays of the same constant length"
)]

use super::arm::State;
use super::number::{Number, entries};

/// Bound of each joint's integral \[rad s\]. With the default gains its effort is over a thousand times the gravity
/// load, so it does not limit normal motion. Without it a setpoint that cannot be reached would cause unbounded windup.
pub const INTEGRAL_LIMIT: f64 = 50.0;

/// Gains of every joint, for one arm or for several side by side. Each is finite and not negative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gains<const N: usize, T = f64> {
    /// Proportional gains \[N m/rad\].
    pub kp: [T; N],
    /// Integral gains \[N m/(rad s)\].
    pub ki: [T; N],
    /// Derivative gains \[N m s/rad\].
    pub kd: [T; N],
}

/// Gains for the default arm of 2 or 3 links. They reach any setpoint within ±2π, from rest or from a free swing, to
/// 0.02 rad and 0.02 m: within 2 s with 2 links, within 3.6 s with 3. They are stable in every pose up to a timestep of
/// 4.3 ms with 2 links, and of 3.0 ms with 3.
///
/// A search for the least oscillation found those of 3 links (`benches/src/bin/default_gains.rs`). Its criterion: once
/// all joints are slower than 0.01 rad/s, the effort is within 2 % of the gravity load. This holds on 94 of 100 moves,
/// and on 78 of 100 with links of 2 kg. In the other moves a joint is slow because it turns back, or the load is small
/// compared with that of the stretched arm. Moves within ±2π do not diverge at 3 ms; some of 4π at every joint do. The
/// last joint has little damping, because `kd dt` of that joint limits the timestep.
///
/// Other numbers of links have no default: gains must fit the inertia that each joint moves.
impl<const N: usize> Default for Gains<N> {
    fn default() -> Self {
        const { assert!(N == 2 || N == 3, "default gains are those of 2 and 3 links") };
        let of = |two: [f64; 2], three: [f64; 3]| {
            std::array::from_fn(|i| if N == 2 { two[i] } else { three[i] })
        };
        Self {
            kp: of([1000.0, 250.0], [2200.0, 180.0, 80.0]),
            ki: of([3000.0, 750.0], [3500.0, 300.0, 185.0]),
            kd: of([110.0, 22.0], [160.0, 38.0, 4.8]),
        }
    }
}

/// Positions and velocities at which the arm is to be held.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setpoint<const N: usize, T = f64> {
    /// Joint positions q* \[rad\], not wrapped: a setpoint of 2π asks for a whole turn.
    pub position: [T; N],
    /// Joint velocities q̇* \[rad/s\]. They do not move the setpoint's positions.
    pub velocity: [T; N],
}

/// The starting pose, q = 0, at rest.
impl<const N: usize> Default for Setpoint<N> {
    fn default() -> Self {
        Self {
            position: [0.0; N],
            velocity: [0.0; N],
        }
    }
}

impl<const N: usize> Setpoint<N> {
    /// A pose \[rad\] to be held at rest.
    #[must_use]
    pub const fn at(position: [f64; N]) -> Self {
        Self {
            position,
            velocity: [0.0; N],
        }
    }
}

/// The result of the control law for one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Control<const N: usize, T = f64> {
    /// Effort τ to hold for the step \[N m\].
    pub effort: [T; N],
    /// The integral in this effort \[rad s\], to be committed if the step is taken.
    pub integral: [T; N],
}

/// The law for one step of `dt` \[s\] that starts at `state`, with the `integral` of the previous step \[rad s\].
#[inline(always)]
pub(super) fn law<T: Number, const N: usize>(
    gains: &Gains<N, T>,
    setpoint: &Setpoint<N, T>,
    integral: &[T; N],
    state: &State<N, T>,
    dt: T,
) -> Control<N, T> {
    let Gains { kp, ki, kd } = gains;
    let position_error = entries!(dt, i => setpoint.position[i] - state.position[i]);
    let integral =
        entries!(dt, i => (integral[i] + position_error[i] * dt).clamped(INTEGRAL_LIMIT));
    let effort = entries!(dt, i => {
        let velocity_error = setpoint.velocity[i] - state.velocity[i];
        kp[i] * position_error[i] + ki[i] * integral[i] + kd[i] * velocity_error
    });
    Control { effort, integral }
}

/// The controller: gains, setpoint, integral, and whether it is on. It starts off.
#[derive(Debug, Clone, PartialEq)]
pub struct Pid<const N: usize> {
    gains: Gains<N>,
    setpoint: Setpoint<N>,
    /// Integral of the position error, as of the last step taken \[rad s\].
    integral: [f64; N],
    enabled: bool,
}

impl<const N: usize> Pid<N> {
    /// A controller that is off, with its setpoint at the starting pose.
    #[must_use]
    pub fn new(gains: Gains<N>) -> Self {
        Self {
            gains,
            setpoint: Setpoint::default(),
            integral: [0.0; N],
            enabled: false,
        }
    }

    /// The law for one step of `dt` \[s\] that starts at `state`. It is the same whether the controller is on or off.
    #[inline]
    #[must_use]
    pub fn control(&self, state: &State<N>, dt: f64) -> Control<N> {
        law(&self.gains, &self.setpoint, &self.integral, state, dt)
    }

    /// Keeps the integral \[rad s\] of a step that was taken.
    #[inline]
    pub fn commit(&mut self, integral: [f64; N]) {
        self.integral = integral;
    }

    /// Turns the controller on or off. From off to on the integral starts at zero. A controller that is already on
    /// does not change.
    pub fn enable(&mut self, on: bool) {
        if on && !self.enabled {
            self.integral = [0.0; N];
        }
        self.enabled = on;
    }

    /// Sets the setpoint to the starting pose at rest and the integral to zero. Gains and the on/off state do not
    /// change.
    pub fn reset(&mut self) {
        self.setpoint = Setpoint::default();
        self.integral = [0.0; N];
    }

    /// Changes the gains and keeps the integral.
    pub fn set_gains(&mut self, gains: Gains<N>) {
        self.gains = gains;
    }

    /// Changes the setpoint and keeps the integral.
    pub fn set_setpoint(&mut self, setpoint: Setpoint<N>) {
        self.setpoint = setpoint;
    }

    /// Whether the controller is on.
    #[must_use]
    pub fn is_enabled(&self) -> bool {
        self.enabled
    }

    /// The present gains.
    #[must_use]
    pub fn gains(&self) -> &Gains<N> {
        &self.gains
    }

    /// The present setpoint.
    #[must_use]
    pub fn setpoint(&self) -> &Setpoint<N> {
        &self.setpoint
    }

    /// Integral of the position error \[rad s\], each within [`INTEGRAL_LIMIT`], except with another anti-windup
    /// than [`super::limits::AntiWindup::Clamp`].
    #[must_use]
    pub fn integral(&self) -> &[f64; N] {
        &self.integral
    }
}

//! The two clocks of a sampled loop: the largest stable control period, and the largest stable timestep.
//!
//! The limit of the period belongs to controller and arm, that of the timestep to the simulation (`docs/study.md`).
//!
//! **Invariant:** if the law runs in every step, the timestep limit is that of [`limit_held`].

use super::control_loop::ControlLoop;
use super::limits::limit_held;
use super::linear::Linear;
use super::stability::Stepping;
use crate::math::integrator::Method;

/// Most steps per period that are tried. With more, a method is either practically exact or makes the arm's own swing
/// grow. With as many, the limit of Runge-Kutta 4 is that of exact motion to 1e-6, in soft loops too.
const MOST_STEPS: u32 = 64;

/// The largest stable control period and timestep \[s\]. Zero: no stable one was found. `None`: no limit was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockLimits {
    /// The control period, for exact motion between two runs of the law.
    pub period: Option<f64>,
    /// The timestep, at the loop's own control period.
    pub timestep: Option<f64>,
}

/// Both limits at the equilibrium that belongs to the setpoint. Takes 1 to 2 ms of one core (optimised build).
pub fn clock_limits<const N: usize>(control: &ControlLoop<N>) -> ClockLimits {
    let linear = Linear::at_setpoint(control);
    let period = Stepping::held(&linear, Method::Rk4, MOST_STEPS, control.period.delay).limit();
    let timestep = timestep_limit(control, &linear, period);
    ClockLimits { period, timestep }
}

/// The largest stable timestep. A period has a whole number of steps, so the smallest stable number of steps gives it.
fn timestep_limit<const N: usize>(
    control: &ControlLoop<N>,
    linear: &Linear,
    period_limit: Option<f64>,
) -> Option<f64> {
    let (method, delay) = (control.method, control.period.delay);
    let every_step = limit_held(control);
    let period = control.given_period();
    // Up to this limit the law may run in every step. A longer timestep then makes the control period longer.
    if every_step.is_none_or(|limit| period <= limit) {
        return every_step;
    }
    if period_limit.is_some_and(|limit| period > limit) {
        return Some(0.0);
    }
    let stable = (2..=MOST_STEPS)
        .find(|steps| Stepping::held(linear, method, *steps, delay).is_stable(period));
    Some(stable.map_or(0.0, |steps| period / f64::from(steps)))
}

//! The two clocks of a sampled loop: how seldom the law may run, and how long a step may be.
//!
//! The largest stable *control period* is a property of controller and arm. Between two runs of the law the arm moves
//! as it would move exactly, and a real robot would show the same limit. The largest stable *timestep* at a control
//! period is a property of the simulation: of its method, and of how many steps it takes in a period.
//!
//! **Invariant:** of a loop whose law runs in every step the timestep's limit is that of [`limit_held`].

use super::control_loop::ControlLoop;
use super::limits::limit_held;
use super::linear::Linear;
use super::stability::Stepping;
use crate::math::integrator::Method;

/// Steps of Runge-Kutta 4 in a control period for which the arm moves as it would move exactly. A period near its limit
/// is so short beside the arm's own swing that the limit is within 1e-6 of that with 100 steps.
const EXACT: u32 = 8;

/// Most steps in a period that are tried: by then a method is as good as exact, or the arm's own swing grows under it.
const MOST_STEPS: u32 = 64;

/// The largest stable control period and timestep \[s\]. Zero: none is stable. `None`: nothing limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockLimits {
    /// The control period, of an arm that moves exactly in between.
    pub period: Option<f64>,
    /// The timestep, at the loop's own control period.
    pub timestep: Option<f64>,
}

/// Both limits at the equilibrium that belongs to the setpoint. A millisecond or two of one core (optimised build).
#[must_use]
pub fn clock_limits<const N: usize>(control: &ControlLoop<N>) -> ClockLimits {
    let linear = Linear::at_setpoint(control);
    let period = Stepping::held(&linear, Method::Rk4, EXACT, control.period.delay).limit();
    ClockLimits {
        period,
        timestep: timestep_limit(control, &linear, period),
    }
}

/// A period has a whole number of steps: the longest steps are those of the smallest number at which it is stable.
fn timestep_limit<const N: usize>(
    control: &ControlLoop<N>,
    linear: &Linear,
    period_limit: Option<f64>,
) -> Option<f64> {
    let (method, delayed) = (control.method, control.period.delay);
    let every_step = if delayed {
        Stepping::held(linear, method, 1, true).limit()
    } else {
        limit_held(control)
    };
    let period = control.period.period;
    // Up to there the law may run in every step, and longer steps make longer periods.
    if control.is_free() || every_step.is_none_or(|limit| period <= limit) {
        return every_step;
    }
    if period_limit.is_some_and(|limit| period > limit) {
        return Some(0.0);
    }
    let stable = (2..=MOST_STEPS)
        .find(|steps| Stepping::held(linear, method, *steps, delayed).is_stable(period));
    Some(stable.map_or(0.0, |steps| period / f64::from(steps)))
}

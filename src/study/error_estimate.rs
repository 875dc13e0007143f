//! The local error of a step of `h`, against two steps of `h/2` of Runge-Kutta 4 from the same state.
//!
//! For a method of lower order the two half steps serve as the reference. Two half steps of the method itself would not
//! do. When an arm starts at rest, the leading error term vanishes, and the rest does not scale with the power that
//! step doubling assumes. The error of Runge-Kutta 4 is `C h⁵`, and that of its two half steps `2 C (h/2)⁵`. Their
//! difference is 15/16 of the error. Both use the effort that the control law holds for the step. The result is
//! therefore the method's own error, without that of the sampled law.
//!
//! Source: Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I* (1993), ch. II.4.
//!
//! **Invariant:** the simulation is not changed. An estimate costs one step of the method and two of Runge-Kutta 4.

use super::matrix::largest;
use crate::math::arm::State;
use crate::math::integrator::{Increment, Method};
use crate::math::simulation::{Simulation, step_under};

/// The error of one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorEstimate {
    /// Largest error of a joint position after the step \[rad\].
    pub local_error: f64,
    /// Largest error of a joint velocity after the step \[rad/s\].
    pub velocity_error: f64,
    /// `local_error` per timestep \[rad/s\]: the growth rate of the error if the motion neither reduces nor amplifies
    /// it.
    pub error_per_second: f64,
}

/// The error of the next step of a simulation; `None` if that step is not finite, or if the simulation has diverged.
pub fn estimate<const N: usize>(simulation: &Simulation<N>) -> Option<ErrorEstimate> {
    if simulation.divergence().is_some() {
        return None;
    }
    let (arm, state) = (simulation.arm(), simulation.state());
    let (method, h) = (simulation.method(), simulation.timestep());
    let effort = simulation.effort_of_next_step();
    let step = |method: Method, state: &State<N>, h: f64| -> Increment<N> {
        step_under(arm, method, state, &effort, h)
    };
    let (whole_q, whole_v) = step(method, state, h);
    let first = step(Method::Rk4, state, 0.5 * h);
    let middle = state.plus(&first);
    let (first_q, first_v) = first;
    let (second_q, second_v) = step(Method::Rk4, &middle, 0.5 * h);
    let whole_of = if method == Method::Rk4 {
        16.0 / 15.0
    } else {
        1.0
    };
    // Increments are compared, not states: at a large angle the difference of two states would be lost in rounding.
    let off = |whole: &[f64; N], first: &[f64; N], second: &[f64; N]| {
        largest((0..N).map(|i| (whole[i] - (first[i] + second[i])).abs() * whole_of))
    };
    let local_error = off(&whole_q, &first_q, &second_q);
    let velocity_error = off(&whole_v, &first_v, &second_v);
    let error_per_second = local_error / h;
    let finite = local_error.is_finite() && velocity_error.is_finite();
    (finite && error_per_second.is_finite()).then_some(ErrorEstimate {
        local_error,
        velocity_error,
        error_per_second,
    })
}

//! The increments of one step, and their addition to a state.
//!
//! **Invariant:** an arm without gravity moves bit-identically with both variants of the dynamics.

#![allow(
    clippy::indexing_slicing,
    reason = "every index runs over arrays of the same constant length"
)]

use crate::math::arm::{Arm, State};
use crate::math::dynamics::{forward_dynamics, less_friction, weightless_dynamics};
use crate::math::integrator::{Increment, Method, increment, two_sum};
use crate::math::number::Number;

/// The increments of positions and velocities in a step of `h` \[s\] under the constant `effort` \[N m\].
#[inline(always)]
#[must_use]
pub fn step_under<const N: usize>(
    arm: &Arm<N>,
    method: Method,
    state: &State<N>,
    effort: &[f64; N],
    h: f64,
) -> Increment<N> {
    let State { position, velocity } = state;
    if method == Method::Euler {
        // Euler's step is inlined into the caller's loop, where numbers stay in registers from step to step. Inlining
        // the other methods too would make four times as many copies of the dynamics.
        increment(
            Method::Euler,
            #[inline(always)]
            |_, q: &[f64; N], v: &[f64; N]| acceleration(arm, q, v, effort),
            0.0,
            position,
            velocity,
            h,
        )
    } else {
        let acceleration = |_, q: &[f64; N], v: &[f64; N]| acceleration(arm, q, v, effort);
        increment(method, acceleration, 0.0, position, velocity, h)
    }
}

/// The state after such a step, without the rounding error.
#[inline(always)]
#[must_use]
pub fn state_after<const N: usize>(
    arm: &Arm<N>,
    method: Method,
    state: &State<N>,
    effort: &[f64; N],
    h: f64,
) -> State<N> {
    state.plus(&step_under(arm, method, state, effort, h))
}

#[inline(always)]
fn acceleration<const N: usize>(
    arm: &Arm<N>,
    q: &[f64; N],
    v: &[f64; N],
    effort: &[f64; N],
) -> [f64; N] {
    if arm.has_friction() {
        forward_dynamics(arm, q, v, &less_friction(arm.viscous(), v, effort))
    } else if leaves_out_first_angle(arm) {
        weightless_dynamics(arm, q, v, effort)
    } else {
        forward_dynamics(arm, q, v, effort)
    }
}

/// Whether omitting the first angle makes the dynamics faster. Sines and cosines are computed two at a time, so for
/// an odd number of links one pass less is needed. With 2 links almost nothing is saved.
#[inline(always)]
pub(super) fn leaves_out_first_angle<const N: usize>(arm: &Arm<N>) -> bool {
    N % 2 == 1 && arm.gravity() == 0.0
}

/// The state after a step of `h` \[s\] from `state` under an `acceleration` that does not depend on time. `carry` is
/// the rounding error, for the next step.
#[inline(always)]
pub(super) fn stepped<T: Number, const N: usize>(
    acceleration: impl FnMut(T, &[T; N], &[T; N]) -> [T; N],
    method: Method,
    state: &State<N, T>,
    carry: &State<N, T>,
    h: T,
) -> (State<N, T>, State<N, T>) {
    let State { position, velocity } = state;
    // The motion does not depend on time, so the stages have no time.
    let (dq, dv) = increment(method, acceleration, h.like(0.0), position, velocity, h);
    add_carried(state, carry, &dq, &dv)
}

/// `state + carry + (dq, dv)`, and its rounding error, the carry of the next step.
#[inline(always)]
pub(crate) fn add_carried<T: Number, const N: usize>(
    state: &State<N, T>,
    carry: &State<N, T>,
    dq: &[T; N],
    dv: &[T; N],
) -> (State<N, T>, State<N, T>) {
    let (mut sums, mut carries) = (*state, *carry);
    for i in 0..N {
        (sums.position[i], carries.position[i]) =
            two_sum(state.position[i], dq[i] + carry.position[i]);
        (sums.velocity[i], carries.velocity[i]) =
            two_sum(state.velocity[i], dv[i] + carry.velocity[i]);
    }
    (sums, carries)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::pid::Gains;
    use crate::math::simulation::Simulation;

    #[test]
    fn only_an_odd_arm_without_gravity_leaves_out_its_first_angle() {
        let weightless = Arm::new([1.0; 3], [1.0; 3], 0.0).expect("valid");
        let even = Arm::new([1.0; 2], [1.0; 2], 0.0).expect("valid");
        assert!(leaves_out_first_angle(&weightless));
        assert!(!leaves_out_first_angle(&Arm::<3>::default()));
        assert!(!leaves_out_first_angle(&even));
    }

    #[test]
    fn a_step_alone_is_the_first_step_of_a_simulation() {
        for method in Method::ALL {
            let mut simulation = Simulation::<3>::new(Arm::default(), Gains::default());
            simulation.set_method(method);
            let (start, h) = (*simulation.state(), simulation.timestep());
            let alone = state_after(simulation.arm(), method, &start, &[0.0; 3], h);
            simulation.step();
            assert_eq!(&alone, simulation.state(), "{method}");
            assert_ne!(alone, start, "{method}");
        }
    }
}

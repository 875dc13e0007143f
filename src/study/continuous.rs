//! A control loop with a continuous-time law: the ideal that a held effort approximates.
//!
//! **Invariant:** a step whose result is not finite changes nothing.

use super::control_loop::ControlLoop;
use crate::math::arm::State;
use crate::math::dynamics::forward_dynamics;
use crate::math::integrator::increment;
use crate::math::pid::{Gains, INTEGRAL_LIMIT, Setpoint};
use crate::math::simulation::add_carried;

/// An arm whose control law, with its integral, is evaluated in every stage. The method steps `(q, s)`: the integral
/// `s` of the position error has the velocity `q* - q` and the acceleration `-q̇`.
#[derive(Debug, Clone, PartialEq)]
pub struct ContinuousLoop<const N: usize> {
    /// Arm, gains, setpoint, method and timestep.
    pub control: ControlLoop<N>,
    /// Joint positions and velocities.
    pub state: State<N>,
    /// Integral of the position error \[rad s\].
    pub integral: [f64; N],
    /// The rounding error of the state. It is carried into the next step, as in the live arm.
    carry: State<N>,
    steps: u64,
}

impl<const N: usize> ContinuousLoop<N> {
    /// The loop in `state`, with an `integral` \[rad s\].
    pub fn new(control: ControlLoop<N>, state: State<N>, integral: [f64; N]) -> Self {
        Self {
            control,
            state,
            integral,
            carry: State::rest(),
            steps: 0,
        }
    }

    /// Steps taken.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Takes a step. Returns `false`, and changes nothing, if the result would not be finite, or if the arm has more
    /// than three joints.
    pub fn step(&mut self) -> bool {
        match N {
            1 => self.step_all::<2>(),
            2 => self.step_all::<4>(),
            3 => self.step_all::<6>(),
            _ => false,
        }
    }

    fn acceleration(&self, q: &[f64; N], v: &[f64; N], integral: &[f64; N]) -> [f64; N] {
        let Gains { kp, ki, kd } = &self.control.gains;
        let Setpoint { position, velocity } = &self.control.setpoint;
        let effort = std::array::from_fn(|i| {
            kp[i] * (position[i] - q[i])
                + ki[i] * integral[i].clamp(-INTEGRAL_LIMIT, INTEGRAL_LIMIT)
                + kd[i] * (velocity[i] - v[i])
        });
        forward_dynamics(&self.control.arm, q, v, &effort)
    }

    /// `M` is twice `N`; stable Rust cannot express this bound.
    fn step_all<const M: usize>(&mut self) -> bool {
        debug_assert_eq!(M, 2 * N, "a position and an integral for every joint");
        let State { position, velocity } = self.state;
        let joint = |i: usize| i % N;
        let whole: [f64; M] = std::array::from_fn(|i| {
            if i < N {
                position[i]
            } else {
                self.integral[joint(i)]
            }
        });
        let rates: [f64; M] = std::array::from_fn(|i| {
            if i < N {
                velocity[i]
            } else {
                self.control.setpoint.position[joint(i)] - position[joint(i)]
            }
        });
        let (moved, changed) = increment(
            self.control.method,
            |_, x, rate| {
                let q = std::array::from_fn(|i| x[i]);
                let v: [f64; N] = std::array::from_fn(|i| rate[i]);
                let a = self.acceleration(&q, &v, &std::array::from_fn(|i| x[N + i]));
                std::array::from_fn(|i| if i < N { a[i] } else { -v[joint(i)] })
            },
            0.0,
            &whole,
            &rates,
            self.control.timestep,
        );
        let [dq, dv] = [moved, changed].map(|change| std::array::from_fn(|i| change[i]));
        let (state, carry) = (&self.state, &self.carry);
        let (position, position_carry) = add_carried(&state.position, &carry.position, &dq);
        let (velocity, velocity_carry) = add_carried(&state.velocity, &carry.velocity, &dv);
        let next = State { position, velocity };
        let finite = next.is_finite();
        if finite {
            self.state = next;
            self.steps += 1;
            self.carry = State {
                position: position_carry,
                velocity: velocity_carry,
            };
            self.integral = std::array::from_fn(|i| {
                (self.integral[i] + moved[N + i]).clamp(-INTEGRAL_LIMIT, INTEGRAL_LIMIT)
            });
        }
        finite
    }
}

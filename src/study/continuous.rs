//! A control loop with a continuous-time law: the ideal that a held effort approximates.
//!
//! **Invariant:** a step whose result is not finite changes nothing.

use super::control_loop::ControlLoop;
use crate::math::arm::State;
use crate::math::dynamics::{forward_dynamics, less_friction};
use crate::math::integrator::increment;
use crate::math::pid::{Gains, INTEGRAL_LIMIT, Setpoint};
use crate::math::simulation::add_carried;

/// Most joints of an arm.
const MAX_JOINTS: usize = 3;

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
    /// Steps taken.
    pub(super) steps: u64,
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

    /// Whether the law demands an effort that reaches a limit of the motors. The loop itself has no limits.
    pub fn is_at_limit(&self) -> bool {
        let State { position, velocity } = &self.state;
        let effort = self.effort(position, velocity, &self.integral);
        self.control.limits.reached(&effort).contains(&true)
    }

    fn effort(&self, q: &[f64; N], v: &[f64; N], integral: &[f64; N]) -> [f64; N] {
        let Gains { kp, ki, kd } = &self.control.gains;
        let Setpoint { position, velocity } = &self.control.setpoint;
        std::array::from_fn(|i| {
            kp[i] * (position[i] - q[i])
                + ki[i] * integral[i].clamp(-INTEGRAL_LIMIT, INTEGRAL_LIMIT)
                + kd[i] * (velocity[i] - v[i])
        })
    }

    fn acceleration(&self, q: &[f64; N], v: &[f64; N], integral: &[f64; N]) -> [f64; N] {
        let effort = self.effort(q, v, integral);
        let arm = &self.control.arm;
        let effort = if arm.has_friction() {
            less_friction(arm.viscous(), v, &effort)
        } else {
            effort
        };
        forward_dynamics(arm, q, v, &effort)
    }

    /// Takes a step. Returns `false`, and changes nothing, if the result would not be finite.
    pub fn step(&mut self) -> bool {
        let State { position, velocity } = self.state;
        let off = |i: usize| self.control.setpoint.position[i] - position[i];
        let (moved, changed) = increment(
            self.control.method,
            |_, x, rate| {
                let q = std::array::from_fn(|i| x[i]);
                let v: [f64; N] = std::array::from_fn(|i| rate[i]);
                let a = self.acceleration(&q, &v, &std::array::from_fn(|i| x[N + i]));
                both(&a, &v.map(|v| -v))
            },
            0.0,
            &both(&position, &self.integral),
            &both(&velocity, &std::array::from_fn(off)),
            self.control.timestep,
        );
        let [dq, dv] = [moved, changed].map(|change| std::array::from_fn(|i| change[i]));
        let (next, carry) = add_carried(&self.state, &self.carry, &dq, &dv);
        let finite = next.is_finite();
        if finite {
            (self.state, self.carry) = (next, carry);
            self.steps += 1;
            self.integral = std::array::from_fn(|i| {
                (self.integral[i] + moved[N + i]).clamp(-INTEGRAL_LIMIT, INTEGRAL_LIMIT)
            });
        }
        finite
    }
}

/// Values of all positions and of all integrals, padded with zeros.
fn both<const N: usize>(positions: &[f64; N], integrals: &[f64; N]) -> [f64; 2 * MAX_JOINTS] {
    const { assert!(N <= MAX_JOINTS) };
    std::array::from_fn(|i| {
        let value = positions.iter().chain(integrals).nth(i);
        value.copied().unwrap_or(0.0)
    })
}

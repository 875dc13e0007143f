//! A controller designed for its period, beside the sampled PID, on 2 links that return to a setpoint.
//!
//! Near the setpoint and under efforts held for a period T the arm is `x' = A x + B u`, exactly: the zero-order hold of
//! its linearisation. Linear-quadratic regulation (LQR) finds the gains K of `u = -K x` with the least `Σ T (xᵀ Q x + uᵀ u)`.
//! The weights Q are the squares of the default gains, so the gains K are of their size where T is short. With T near zero
//! the design is that of continuous time.
//!
//! Source: Åström and Wittenmark, *Computer-Controlled Systems* (1997), ch. 2.3 and 11.
//!
//! **Invariant:** every controller starts with the effort that carries the load at the setpoint.

use super::measure::live_at;
use crate::math::arm::{Arm, State};
use crate::math::count::{in_f64, whole};
use crate::math::dynamics::gravity_load;
use crate::math::pid::{Gains, Setpoint};
use crate::math::simulation::ControlPeriod;
use crate::study::control_loop::ControlLoop;
use crate::study::linear::{Linear, equilibrium};
use crate::study::matrix::{Matrix, largest};
use crate::study::stability::{Stepping, bisect, repeated, runge_kutta};

/// The setpoint \[rad\].
const SETPOINT: [f64; 2] = [0.4, 0.8];

/// The deviation at the start \[rad\].
const OFF: [f64; 2] = [0.2, -0.2];

/// Simulated time \[s\].
pub const DURATION: f64 = 2.0;

/// A period that stands for continuous time \[s\].
pub const SHORT: f64 = 1e-4;

/// Efforts per deviation: of two positions and two velocities, padded with rows of zeros.
pub type Feedback = Matrix;

/// The step of the linearised arm over a period \[s\], in positions, velocities and efforts.
fn held(period: f64) -> Matrix {
    /// Steps of order 4, with an error below 10⁻⁹ for periods up to 0.2 s.
    const SUBSTEPS: u32 = 256;
    let free = ControlLoop::free(Arm::<2>::default());
    let plant = Linear::at(&free, &SETPOINT, &[false; 2]).plant();
    let h = period / f64::from(SUBSTEPS);
    let rate = repeated(&runge_kutta(&plant, 4, h), h, SUBSTEPS);
    rate.scaled(period).plus_diagonal(1.0)
}

/// `A` and `B`, which is padded with columns of zeros.
fn parts(period: f64) -> [Matrix; 2] {
    let held = held(period);
    [0, 4].map(|first| {
        let entry = |row, column| (row, first + column);
        Matrix::from_fn(4, |row, column| {
            if first + column < 6 {
                held[entry(row, column)]
            } else {
                0.0
            }
        })
    })
}

/// The gains of least cost for a period \[s\]; `None` if the iteration does not end.
pub fn designed(period: f64) -> Option<Feedback> {
    /// Most iterations. Each goes back a period from the end of an endless motion.
    const MOST: u32 = 100_000;
    let Gains { kp, kd, .. } = Gains::<2>::default();
    let weights = [kp, kd].concat();
    let transposed = |of: &Matrix| Matrix::from_fn(4, |row, column| of[(column, row)]);
    let [a, b] = parts(period);
    let q = Matrix::from_fn(4, |row, column| {
        if row == column {
            period * weights[row] * weights[row]
        } else {
            0.0
        }
    });
    let mut cost = q.clone();
    for _ in 0..MOST {
        let back = transposed(&b).product(&cost);
        let gains = back.product(&b).plus_diagonal(period).inverse()?;
        let gains = gains.product(&back.product(&a));
        let closed = a.clone().plus(-1.0, &b.product(&gains));
        let next = q
            .clone()
            .plus(1.0, &transposed(&a).product(&cost).product(&closed));
        let change = next.clone().plus(-1.0, &cost);
        let size = |of: &Matrix| largest((0..4).map(|i| of[(i, i)].abs()));
        if size(&change) <= 1e-13 * size(&next) {
            return Some(gains);
        }
        cost = next;
    }
    None
}

/// The longest period \[s\] up to a second at which the linearised arm is stable under these gains.
pub fn limit(gains: &Feedback) -> f64 {
    let is_stable = |period| {
        let [a, b] = parts(period);
        a.plus(-1.0, &b.product(gains)).spectral_radius() < 1.0
    };
    bisect((SHORT, 1.0), 60, is_stable)
}

/// The longest control period \[s\] of the sampled PID.
pub fn limit_of_pid() -> Option<f64> {
    let linear = Linear::at_setpoint(&pid(SHORT));
    Stepping::held(&linear, pid(SHORT).method, 64, 0).limit()
}

fn pid(period: f64) -> ControlLoop<2> {
    let control = ControlLoop::new(Arm::default(), Gains::default(), Setpoint::at(SETPOINT));
    control.with_period(ControlPeriod { period, delay: 0 })
}

/// The return to the setpoint under gains, or under the sampled PID: times \[s\] with the deviation of the first joint
/// \[rad\], and the root of the mean square of both joints' deviations \[rad\].
pub fn returned(period: f64, gains: Option<&Feedback>) -> (Vec<(f64, f64)>, f64) {
    /// Longest timestep of RK4 \[s\].
    const LONGEST: f64 = 5e-4;
    let substeps = whole((period / LONGEST).ceil()).max(1);
    let control = pid(period).with_timestep(period / in_f64(substeps));
    let start = State::at_rest(std::array::from_fn(|i| SETPOINT[i] + OFF[i]));
    let mut arm = live_at(&control, &equilibrium(&control), start);
    let load = gravity_load(&control.arm, &SETPOINT);
    let (mut samples, mut squares) = (vec![(0.0, OFF[0])], 0.0);
    for _ in 0..whole((DURATION / period).ceil()) {
        if let Some(gains) = gains {
            let State { position, velocity } = arm.state();
            let x: [f64; 4] = std::array::from_fn(|i| match i {
                0 | 1 => position[i] - SETPOINT[i],
                _ => velocity[i - 2],
            });
            let effort = |row: usize| (0..4).map(|i| gains[(row, i)] * x[i]).sum::<f64>();
            arm.drive(Some(std::array::from_fn(|row| load[row] - effort(row))));
        }
        for _ in 0..substeps {
            if !arm.step() {
                return (samples, f64::INFINITY);
            }
            let position = arm.state().position;
            let off: [f64; 2] = std::array::from_fn(|i| position[i] - SETPOINT[i]);
            squares += control.timestep * (off[0] * off[0] + off[1] * off[1]);
            samples.push((arm.time(), off[0]));
        }
    }
    let mean = squares / (2.0 * arm.time());
    (samples, mean.sqrt())
}

//! The four methods stepped in double-double arithmetic: truncation without rounding.
//!
//! The maps are those of `math::integrator`, written again for another number type. The effort comes from the law, held
//! over the step or asked for in every stage; it has no integral here.
//!
//! **Invariant:** a step here and a step of the live arm differ by rounding alone.

#![allow(
    clippy::indexing_slicing,
    reason = "every index comes from `array::from_fn` over arrays of the same constant length"
)]

use super::double_double::DoubleDouble as Real;
use super::lagrangian::Lagrangian;
use super::{Law, held};
use crate::math::arm::{Arm, State};
use crate::math::integrator::Method;
use crate::report::experiments::reference::taylor::Exact;

type Pair<const N: usize> = ([Real; N], [Real; N]);

/// Joint angles \[rad\] and rates \[rad/s\] after every `every` steps of `h` \[s\] with `method`, `count` samples in
/// all.
///
/// Under [`Law::Held`] the period is taken to be `h`; under [`Law::Continuous`] the integral gains must be 0.
#[must_use]
pub fn exact_steps<const N: usize>(
    arm: &Arm<N>,
    start: &State<N>,
    law: &Law<N>,
    method: Method,
    h: f64,
    every: u64,
    count: usize,
) -> Vec<Pair<N>> {
    let lagrangian = Lagrangian::new(arm);
    let mut state = Exact {
        position: start.position.map(Real::from),
        velocity: start.velocity.map(Real::from),
        integral: [Real::ZERO; N],
    };
    (0..count)
        .map(|_| {
            for _ in 0..every {
                let effort = match law {
                    Law::Held {
                        gains, setpoint, ..
                    } => held(gains, setpoint, &mut state, h),
                    Law::Constant(effort) => effort.map(Real::from),
                    Law::Continuous(..) => [Real::ZERO; N],
                };
                let acceleration = |q: &[Real; N], v: &[Real; N]| {
                    if let Law::Continuous(gains, setpoint) = law {
                        let mut at = Exact {
                            position: *q,
                            velocity: *v,
                            integral: [Real::ZERO; N],
                        };
                        return lagrangian.acceleration(q, v, &held(gains, setpoint, &mut at, 0.0));
                    }
                    lagrangian.acceleration(q, v, &effort)
                };
                step(method, acceleration, &mut state, Real::from(h));
            }
            (state.position, state.velocity)
        })
        .collect()
}

fn step<const N: usize>(
    method: Method,
    acceleration: impl Fn(&[Real; N], &[Real; N]) -> [Real; N],
    state: &mut Exact<N>,
    h: Real,
) {
    let (q, v) = (state.position, state.velocity);
    let half = h * Real::from(0.5);
    let a1 = acceleration(&q, &v);
    let (dq, dv) = match method {
        Method::Euler => (times(h, &v), times(h, &a1)),
        Method::Midpoint => {
            let middle_v = moved(&v, half, &a1);
            let middle = acceleration(&moved(&q, half, &v), &middle_v);
            (times(h, &middle_v), times(h, &middle))
        }
        Method::Verlet => {
            let dq = times(h, &moved(&v, half, &a1));
            let ahead = plus(&q, &dq);
            let a2 = acceleration(&ahead, &moved(&v, h, &a1));
            (dq, times(half, &plus(&a1, &a2)))
        }
        Method::Rk4 => {
            let v2 = moved(&v, half, &a1);
            let a2 = acceleration(&moved(&q, half, &v), &v2);
            let v3 = moved(&v, half, &a2);
            let a3 = acceleration(&moved(&q, half, &v2), &v3);
            let v4 = moved(&v, h, &a3);
            let a4 = acceleration(&moved(&q, h, &v3), &v4);
            let sixth = h / Real::from(6.0);
            (
                times(sixth, &weighted(&v, &v2, &v3, &v4)),
                times(sixth, &weighted(&a1, &a2, &a3, &a4)),
            )
        }
    };
    state.position = plus(&q, &dq);
    state.velocity = plus(&v, &dv);
}

fn weighted<const N: usize>(
    first: &[Real; N],
    second: &[Real; N],
    third: &[Real; N],
    fourth: &[Real; N],
) -> [Real; N] {
    std::array::from_fn(|i| first[i] + Real::from(2.0) * (second[i] + third[i]) + fourth[i])
}

fn times<const N: usize>(factor: Real, x: &[Real; N]) -> [Real; N] {
    x.map(|x| factor * x)
}

fn plus<const N: usize>(x: &[Real; N], y: &[Real; N]) -> [Real; N] {
    std::array::from_fn(|i| x[i] + y[i])
}

fn moved<const N: usize>(x: &[Real; N], h: Real, rate: &[Real; N]) -> [Real; N] {
    plus(x, &times(h, rate))
}

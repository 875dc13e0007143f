//! The methods stepped in double-double arithmetic: truncation without rounding.
//!
//! The maps are those of `math::integrator`, over numbers of twice the digits. The effort comes from the law, held
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
use crate::math::integrator::{Method, increment};
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
                let (q, v) = (state.position, state.velocity);
                let (dq, dv) = increment(
                    method,
                    |_, q: &[Real; N], v: &[Real; N]| acceleration(q, v),
                    Real::ZERO,
                    &q,
                    &v,
                    Real::from(h),
                );
                state.position = plus(&q, &dq);
                state.velocity = plus(&v, &dv);
            }
            (state.position, state.velocity)
        })
        .collect()
}

fn plus<const N: usize>(x: &[Real; N], y: &[Real; N]) -> [Real; N] {
    std::array::from_fn(|i| x[i] + y[i])
}

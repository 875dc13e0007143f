//! The effect of rounding on energy over very many steps, with the rounding of sums carried along and without.
//!
//! A regular swing keeps its energy, so all that changes it is the method's truncation and rounding. With small steps
//! truncation is out of sight, and rounding alone is left: errors that have no sign on average add up like a random
//! walk, with the root of the number of steps; a rounding that leans to one side adds up in proportion to it.
//!
//! **Invariant:** both ways take the same increments; only how they are added differs.

use std::f64::consts::FRAC_PI_2;

use super::error::energy_scale;
use crate::math::arm::{Arm, State};
use crate::math::count::{in_f64, length_in_f64};
use crate::math::dynamics::energy;
use crate::math::integrator::Method;
use crate::math::simulation::state_after;
use crate::study::control_loop::ControlLoop;

/// Steps between two looks at the energy.
const LOOK: u64 = 64;

/// How much later the next point is.
const FACTOR: f64 = 1.25;

/// The swing: 2 links, let go 0.3 rad off the hanging pose.
const START: State<2> = State {
    position: [-FRAC_PI_2 + 0.3, 0.0],
    velocity: [0.0; 2],
};

/// How a step's increments are added to the state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Adding {
    /// Sums as the live arm does: what rounding takes is carried into the next step.
    Compensated,
    /// Plainly.
    Plain,
}

/// Energy error per energy scale, the largest so far, at numbers of steps that grow by a constant factor.
#[must_use]
pub fn energy_error(method: Method, h: f64, steps: u64, adding: Adding) -> Vec<(f64, f64)> {
    let arm = Arm::<2>::default();
    let (scale, first) = (energy_scale(&arm, &START), energy(&arm, &START));
    let control = ControlLoop::free(arm).with_method(method).with_timestep(h);
    let mut live = control.simulation(START);
    let mut plain = START;
    let mut points = Vec::new();
    let (mut largest, mut due) = (0.0_f64, in_f64(LOOK));
    let mut taken = 0;
    while taken < steps {
        let state = match adding {
            Adding::Compensated => {
                if live.advance(LOOK) < LOOK {
                    break;
                }
                live.state()
            }
            Adding::Plain => {
                for _ in 0..LOOK {
                    plain = state_after(&arm, method, &plain, &[0.0; 2], h);
                }
                if !plain.is_finite() {
                    break;
                }
                &plain
            }
        };
        taken += LOOK;
        largest = largest.max((energy(&arm, state) - first).abs() / scale);
        if in_f64(taken) >= due {
            points.push((in_f64(taken), largest));
            due = in_f64(taken) * FACTOR;
        }
    }
    points
}

/// The exponents of growth over each of the last three decades of steps, the least and the largest: 1/2 of a random
/// walk, 1 of what leans to one side. One walk has no sharper law. `None` where there is too little to fit.
#[must_use]
pub fn law(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let end = points.last()?.0;
    let mut range: Option<(f64, f64)> = None;
    for decade in 0..3 {
        let from = end * 0.1_f64.powi(decade + 1);
        let of_decade = points
            .iter()
            .filter(|point| point.0 >= from && point.0 <= 10.000_001 * from && point.1 > 0.0);
        let exponent = exponent(&of_decade.copied().collect::<Vec<_>>())?;
        range = Some(range.map_or((exponent, exponent), |(least, most)| {
            (least.min(exponent), most.max(exponent))
        }));
    }
    range
}

fn exponent(points: &[(f64, f64)]) -> Option<f64> {
    let points: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let count = length_in_f64(points.len());
    if points.len() < 8 {
        return None;
    }
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|point| point.0), mean(|point| point.1));
    let (mut along, mut across) = (0.0, 0.0);
    for point in &points {
        along += (point.0 - x) * (point.0 - x);
        across += (point.0 - x) * (point.1 - y);
    }
    Some(across / along)
}

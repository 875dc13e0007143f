//! Stability beyond small deviations: moves of any amplitude, swings of any speed, and deviations from a periodic
//! swing.
//!
//! A move or a swing is run and judged by its end. The derivative of the steps of one period says how a deviation from
//! a periodic swing changes in it. Its eigenvalues are the method's Floquet multipliers. Two of the true ones are 1
//! (along the swing, and to the swing of a little more energy). The other pair says whether a deviation from the swing
//! stays small. Source: Guckenheimer and Holmes, *Nonlinear Oscillations* (1983), ch. 1.5.
//!
//! **Invariant:** no prediction enters a measurement.

use std::f64::consts::FRAC_PI_2;

use crate::math::arm::{Arm, State};
use crate::math::count::{in_f64, whole};
use crate::math::dynamics::energy;
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};
use crate::math::simulation::state_after;
use crate::study::control_loop::ControlLoop;
use crate::study::matrix::{Complex, Matrix};
use crate::study::motion::lowest;

/// Time of a move \[s\].
const MOVE: f64 = 6.0;

/// How near a joint must be at the end of a move \[rad\].
const ARRIVED: f64 = 0.02;

/// Time of a swing \[s\].
pub const SWING: f64 = 4.0;

/// The part of its energy that a swing keeps in that time, and how many times as much it may have.
pub const ENERGY_FACTOR: f64 = 2.0;

/// The move of a 2-link arm from the starting pose, whose first joint turns by `amplitude` \[rad\], under the default
/// gains.
pub fn move_of(amplitude: f64, method: Method, timestep: f64) -> ControlLoop<2> {
    let setpoint = Setpoint::at([amplitude, -0.75 * amplitude]);
    ControlLoop::new(Arm::default(), Gains::default(), setpoint)
        .with_method(method)
        .with_timestep(timestep)
}

/// Whether a move arrives and is there at its end.
pub fn arrives(control: &ControlLoop<2>) -> bool {
    let mut live = control.simulation(State::rest());
    while live.time() < MOVE && live.step() {}
    let (position, setpoint) = (live.state().position, control.setpoint.position);
    live.divergence().is_none() && (0..2).all(|i| (position[i] - setpoint[i]).abs() <= ARRIVED)
}

/// A free swing of a 2-link arm from the horizontal, turning at `spin` \[rad/s\].
pub fn spun(spin: f64) -> State<2> {
    State {
        position: [0.0, 0.5],
        velocity: [spin, 0.0],
    }
}

/// Whether a free swing keeps its energy above that of the hanging arm to a factor of [`ENERGY_FACTOR`] for [`SWING`].
pub fn is_carried(control: &ControlLoop<2>, start: State<2>) -> bool {
    let arm = &control.arm;
    let lowest = lowest(arm);
    let first = energy(arm, &start) - lowest;
    let kept = first / ENERGY_FACTOR..=first * ENERGY_FACTOR;
    let mut live = control.simulation(start);
    let mut is_kept = true;
    while live.time() < SWING && is_kept {
        is_kept = live.step() && kept.contains(&(energy(arm, live.state()) - lowest));
    }
    is_kept
}

/// A swing of the free default arm that comes back to its start. It goes from rest, both links to one side, through
/// the hanging pose to rest on the other side, and back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PeriodicSwing {
    /// Its state at rest.
    pub start: State<2>,
    /// Its period \[s\].
    pub period: f64,
}

/// Stride in amplitude from one swing to the next \[rad\], and how far the next may be from where it is predicted.
const STRIDE: f64 = 0.02;
const NEAR: f64 = 0.05;

/// Steps to the hanging pose while a swing is looked for.
const FINE: f64 = 1e-3;

impl PeriodicSwing {
    /// The swing whose first joint is `amplitude` \[rad\] off the hanging pose at rest, continued from the one of small
    /// amplitude; none where it can't be continued so far.
    pub fn of(amplitude: f64) -> Option<Self> {
        let strides = (amplitude / STRIDE).ceil().clamp(1.0, 1000.0);
        // The slow mode of two equal rods: q₂ per q₁.
        let (mut before, mut ratio) = (0.44, 0.44);
        let mut swing = None;
        for stride in 1..=whole(strides) {
            let reached = amplitude * in_f64(stride) / strides;
            let found = Self::near(reached, reached * (2.0 * ratio - before))?;
            (before, ratio) = (ratio, found.start.position[1] / reached);
            swing = Some(found);
        }
        swing
    }

    /// The swing of this amplitude whose second joint is about `predicted` \[rad\] at rest. Another periodic orbit
    /// further away is none.
    fn near(amplitude: f64, predicted: f64) -> Option<Self> {
        let (mut one, mut other) = (predicted - 1e-4, predicted);
        let mut off_one = through_hanging(amplitude, one)?.0;
        for _ in 0..60 {
            let (off, time) = through_hanging(amplitude, other)?;
            if off.abs() < 1e-13 {
                let position = [amplitude - FRAC_PI_2, other];
                return Some(Self {
                    start: State::at_rest(position),
                    period: 4.0 * time,
                });
            }
            let next = other - off * (other - one) / (off - off_one);
            (one, off_one) = (other, off);
            other = next;
            // NaN is nowhere near.
            let is_near = (other - predicted).abs() <= NEAR;
            if !is_near {
                return None;
            }
            if (other - one).abs() < 1e-15 {
                other += 1e-14;
            }
        }
        None
    }

    /// Of the Floquet multipliers of a method that takes `steps` steps to a period, the larger modulus of the pair that is
    /// not 1 of the true swing: the two farthest from 1. They are the eigenvalues of the derivative of these steps.
    pub fn transverse(&self, method: Method, steps: u32) -> f64 {
        const NUDGE: f64 = 1e-5;
        let h = self.period / f64::from(steps);
        let step = |state, _| state_after(&Arm::<2>::default(), method, &state, &[0.0; 2], h);
        let period = |start: &State<2>| (0..steps).fold(*start, step);
        let mut multipliers = derivative(&self.start, [NUDGE; 2], period).eigenvalues();
        let from_one = |mu: &Complex| (mu.re - 1.0).hypot(mu.im);
        multipliers.sort_by(|a, b| from_one(b).total_cmp(&from_one(a)));
        let pair = multipliers.iter().take(2);
        pair.map(|mu| mu.modulus()).fold(0.0, f64::max)
    }
}

/// How far the second joint is off when the first comes through the hanging pose \[rad\], and when that is \[s\].
fn through_hanging(amplitude: f64, second: f64) -> Option<(f64, f64)> {
    let arm = Arm::<2>::default();
    let mut state = State::at_rest([amplitude - FRAC_PI_2, second]);
    let mut time = 0.0;
    let advance = |state: &State<2>, h: f64| state_after(&arm, Method::Rk4, state, &[0.0; 2], h);
    while state.position[0] > -FRAC_PI_2 {
        state = advance(&state, FINE);
        time += FINE;
        if time > 10.0 {
            return None;
        }
    }
    // Back to the instant itself, by Newton's method. Each round squares the error.
    for _ in 0..6 {
        let back = -(state.position[0] + FRAC_PI_2) / state.velocity[0];
        state = advance(&state, back);
        time += back;
    }
    Some((state.position[1], time))
}

/// How a map of states changes a deviation from `here`, by central differences of these sizes of positions \[rad\] and
/// velocities \[rad/s\].
pub(super) fn derivative<const N: usize>(
    here: &State<N>,
    sizes: [f64; 2],
    map: impl Fn(&State<N>) -> State<N>,
) -> Matrix {
    let moved = |column: usize, by: f64| -> Vec<f64> {
        let mut near = *here;
        let values = [&mut near.position, &mut near.velocity];
        values[column / N][column % N] += by;
        let State { position, velocity } = map(&near);
        [position, velocity].concat()
    };
    let columns = (0..2 * N).map(|column| {
        let size = sizes[column / N];
        let both = moved(column, size).into_iter().zip(moved(column, -size));
        both.map(|(above, below)| (above - below) / (2.0 * size))
            .collect()
    });
    let columns: Vec<Vec<f64>> = columns.collect();
    Matrix::from_fn(2 * N, |row, column| columns[column][row])
}

//! Long free swings, and their energy.
//!
//! **Invariant:** every run starts at a stated state, and those of the four methods are the live arm's.

use super::solvers::{Solver, ready_as_live};
use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::dynamics::{energy, kinetic_energy};
use crate::study::control_loop::ControlLoop;
use crate::study::motion::lowest;

/// Energy drift over the energy scale, largest so far, at times that grow by a factor, and at the end: `(time, drift)`.
pub fn energy_drift<const N: usize>(
    arm: &Arm<N>,
    start: &State<N>,
    solver: impl Into<Solver>,
    h: f64,
    duration: f64,
) -> Vec<(f64, f64)> {
    /// Ratio of the times of two successive points.
    const FACTOR: f64 = 1.12;
    /// Steps between two samples of the energy.
    const LOOK: u64 = 8;
    let mut run = ready_as_live(&ControlLoop::free(*arm), *start, h, solver.into(), 1);
    let (scale, first) = (energy_scale(arm, start), energy(arm, start));
    let mut points = Vec::new();
    let (mut largest, mut due, mut steps) = (0.0_f64, h, 0);
    while in_f64(steps) * h < duration && run.advance(LOOK) {
        steps += LOOK;
        let mut state = *start;
        state.position.copy_from_slice(run.place());
        state.velocity.copy_from_slice(run.rates());
        largest = largest.max((energy(arm, &state) - first).abs() / scale);
        let time = in_f64(steps) * h;
        if time >= due || time >= duration {
            points.push((time, largest));
            due = time * FACTOR;
        }
    }
    points
}

/// The scale of energies \[J\]: twice the largest possible potential energy plus the initial kinetic energy. Never the
/// energy itself, which is 0 for an arm let go from the horizontal.
fn energy_scale<const N: usize>(arm: &Arm<N>, start: &State<N>) -> f64 {
    kinetic_energy(arm, &start.position, &start.velocity) - 2.0 * lowest(arm)
}

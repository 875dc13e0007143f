//! Long free swings: their distance from the reference, and their energy.
//!
//! **Invariant:** every run starts at a stated state and uses the live arm's stepper.

use super::error::energy_scale;
use super::reference::ReferenceMotion;
use crate::math::arm::{Arm, State};
use crate::math::dynamics::energy;
use crate::math::integrator::Method;
use crate::math::simulation::Simulation;
use crate::study::control_loop::ControlLoop;

/// The swing of an arm let go at `start`, with the live arm's stepper.
fn swing<const N: usize>(arm: &Arm<N>, start: &State<N>, method: Method, h: f64) -> Simulation<N> {
    let control = ControlLoop::free(*arm).with_method(method);
    control.with_timestep(h).simulation(*start)
}

/// Largest angle error \[rad\] at every sample of `reference`, which are `every` steps of `h` \[s\] apart. Ends early
/// where the run leaves the finite numbers.
#[must_use]
pub fn separation<const N: usize>(
    arm: &Arm<N>,
    start: &State<N>,
    method: Method,
    h: f64,
    every: u64,
    reference: &ReferenceMotion<N>,
) -> Vec<f64> {
    let mut simulation = swing(arm, start, method, h);
    (0..reference.len())
        .map_while(|index| {
            let whole = simulation.advance(every) == every;
            let error = reference.angle_error(index, &simulation.state().position);
            whole.then_some(error).flatten()
        })
        .collect()
}

/// Energy drift over the energy scale, largest so far, at step counts that grow by a constant factor: `(time, drift)`.
#[must_use]
pub fn energy_drift<const N: usize>(
    arm: &Arm<N>,
    start: &State<N>,
    method: Method,
    h: f64,
    duration: f64,
) -> Vec<(f64, f64)> {
    /// How much later the next point is.
    const FACTOR: f64 = 1.12;
    /// Steps between two looks at the energy.
    const LOOK: u64 = 8;
    let scale = energy_scale(arm, start);
    let mut simulation = swing(arm, start, method, h);
    let mut points = Vec::new();
    let (mut largest, mut due) = (0.0_f64, h);
    while simulation.time() < duration {
        if simulation.advance(LOOK) < LOOK {
            break;
        }
        let drift = (energy(arm, simulation.state()) - energy(arm, start)).abs() / scale;
        largest = largest.max(drift);
        if simulation.time() >= due {
            points.push((simulation.time(), largest));
            due = simulation.time() * FACTOR;
        }
    }
    points
}

//! How long a chaotic swing can be followed: separation from the reference, horizon, Lyapunov rate, energy drift.
//!
//! A free swing of two or more links multiplies every error by `e` about once per Lyapunov time, whatever the method. A
//! smaller error at the start of that growth buys time only in proportion to its logarithm, so every method has a
//! horizon past which its swing and the true one have nothing in common but their energy.
//!
//! **Invariant:** every number here is about one stated start; a Lyapunov rate is a property of where the swing goes.

use super::error::energy_scale;
use super::reference::ReferenceMotion;
use crate::math::arm::{Arm, State};
use crate::math::count::length_in_f64;
use crate::math::dynamics::energy;
use crate::math::integrator::Method;
use crate::math::simulation::Simulation;
use crate::study::control_loop::ControlLoop;

/// Error at which a swing counts as lost \[rad\]: half a degree and a bit, still visible as the same motion.
pub const HORIZON_ERROR: f64 = 1e-2;

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

/// The first time \[s\] at which an error exceeds [`HORIZON_ERROR`], with samples `spacing` \[s\] apart.
#[must_use]
pub fn horizon(errors: &[f64], spacing: f64) -> Option<f64> {
    let index = errors
        .iter()
        .position(|error| error.is_nan() || *error > HORIZON_ERROR)?;
    Some(length_in_f64(index + 1) * spacing)
}

/// Lyapunov rates \[1/s\] of an ensemble: of `swings` swings over `duration` \[s\] each, let go within a hundredth of a
/// radian of `start`. One swing has no rate of its own in so short a time; the ensemble shows how sharp the number is.
#[must_use]
pub fn lyapunov_rates<const N: usize>(
    arm: &Arm<N>,
    start: &State<N>,
    swings: u32,
    duration: f64,
) -> Vec<f64> {
    let member = |index: u32| {
        let mut start = *start;
        if let Some(first) = start.position.first_mut() {
            *first += 0.01 * f64::from(index) / f64::from(swings.max(1));
        }
        lyapunov_rate(arm, &start, duration)
    };
    (0..swings).map(member).collect()
}

/// Lyapunov rate \[1/s\] of the swing from `start` over `duration` \[s\].
///
/// Two swings a nudge apart; the nudge is measured in angles and rates (in units of 1 rad and 1 rad/s) every quarter
/// second and put back to its size. Source: Benettin, Galgani, Giorgilli and Strelcyn, *Meccanica* 15 (1980).
#[must_use]
pub fn lyapunov_rate<const N: usize>(arm: &Arm<N>, start: &State<N>, duration: f64) -> f64 {
    const H: f64 = 1.0 / 1024.0;
    const STEPS: u64 = 256;
    const NUDGE: f64 = 1e-7;
    let interval = 0.25;
    let mut here = swing(arm, start, Method::Rk4, H);
    let mut near = swing(arm, &nudged(start, start, NUDGE), Method::Rk4, H);
    let mut sum = 0.0;
    let mut time = 0.0;
    while time < duration {
        here.advance(STEPS);
        near.advance(STEPS);
        let size = distance(here.state(), near.state());
        sum += (size / NUDGE).ln();
        near.set_state(nudged(here.state(), near.state(), NUDGE));
        time += interval;
    }
    sum / time
}

fn distance<const N: usize>(a: &State<N>, b: &State<N>) -> f64 {
    let squares = |x: &[f64; N], y: &[f64; N]| -> f64 {
        x.iter().zip(y).map(|(x, y)| (x - y) * (x - y)).sum()
    };
    (squares(&a.position, &b.position) + squares(&a.velocity, &b.velocity)).sqrt()
}

/// A state at `size` from `from`, towards `towards`, or along the first angle where these are the same.
fn nudged<const N: usize>(from: &State<N>, towards: &State<N>, size: f64) -> State<N> {
    let length = distance(from, towards);
    let mut state = *from;
    if length > 0.0 {
        let factor = size / length;
        let pull = |x: &mut [f64; N], y: &[f64; N]| {
            for (x, y) in x.iter_mut().zip(y) {
                *x += factor * (y - *x);
            }
        };
        pull(&mut state.position, &towards.position);
        pull(&mut state.velocity, &towards.velocity);
    } else if let Some(first) = state.position.first_mut() {
        *first += size;
    }
    state
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

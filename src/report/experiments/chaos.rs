//! Long free swings: their distance from the reference, and their energy.
//!
//! **Invariant:** every run starts at a stated state and uses the live arm's stepper.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N of arrays that have N elements, as they do in the formulas"
)]

use super::error::energy_scale;
use super::reference::ReferenceMotion;
use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::dynamics::{coupling, energy, solve, weight_moment};
use crate::math::integrator::Method;
use crate::math::simulation::Simulation;
use crate::math::trig;
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
    let mut simulation = swing(arm, start, method, h);
    drift(arm, start, h, duration, |steps| {
        (simulation.advance(steps) == steps).then(|| *simulation.state())
    })
}

/// The same for implicit midpoint, a baseline of this report: it is symplectic, since it steps angles and momenta.
#[must_use]
pub fn symplectic_drift<const N: usize>(
    arm: &Arm<N>,
    start: &State<N>,
    h: f64,
    duration: f64,
) -> Vec<(f64, f64)> {
    let mut swing = Hamiltonian::new(arm, start);
    drift(arm, start, h, duration, |steps| {
        (0..steps).for_each(|_| swing.step(h));
        Some(swing.state())
    })
}

fn drift<const N: usize>(
    arm: &Arm<N>,
    start: &State<N>,
    h: f64,
    duration: f64,
    mut advance: impl FnMut(u64) -> Option<State<N>>,
) -> Vec<(f64, f64)> {
    /// How much later the next point is.
    const FACTOR: f64 = 1.12;
    /// Steps between two looks at the energy.
    const LOOK: u64 = 8;
    let (scale, first) = (energy_scale(arm, start), energy(arm, start));
    let mut points = Vec::new();
    let (mut largest, mut due, mut steps) = (0.0_f64, h, 0);
    while in_f64(steps) * h < duration {
        let Some(state) = advance(LOOK) else { break };
        steps += LOOK;
        largest = largest.max((energy(arm, &state) - first).abs() / scale);
        let time = in_f64(steps) * h;
        if time >= due {
            points.push((time, largest));
            due = time * FACTOR;
        }
    }
    points
}

/// A free swing in the angles of its links and their momenta, `p_i = Σ_j K_ij cos(φ_i - φ_j) φ̇_j`.
struct Hamiltonian<'a, const N: usize> {
    arm: &'a Arm<N>,
    angle: [f64; N],
    momentum: [f64; N],
    /// The last slope, from which the next one is looked for.
    slope: ([f64; N], [f64; N]),
}

impl<'a, const N: usize> Hamiltonian<'a, N> {
    fn new(arm: &'a Arm<N>, start: &State<N>) -> Self {
        let (angle, rate) = (running_sum(&start.position), running_sum(&start.velocity));
        let matrix = matrix(arm, &trig::sin_cos(&angle));
        let momentum = matrix.map(|row| row.iter().zip(&rate).map(|(k, rate)| k * rate).sum());
        let slope = slope(arm, &angle, &momentum);
        Self {
            arm,
            angle,
            momentum,
            slope,
        }
    }

    /// `y' = y + h f((y + y') / 2)`, solved by iteration: two digits or more a round at the steps used here.
    fn step(&mut self, h: f64) {
        const ROUNDS: usize = 12;
        let ahead =
            |x: &[f64; N], slope: &[f64; N], h: f64| std::array::from_fn(|i| x[i] + h * slope[i]);
        for _ in 0..ROUNDS {
            let angle = ahead(&self.angle, &self.slope.0, 0.5 * h);
            let momentum = ahead(&self.momentum, &self.slope.1, 0.5 * h);
            let next = slope(self.arm, &angle, &momentum);
            let same = |one: &[f64; N], other: &[f64; N]| {
                let mut both = one.iter().zip(other);
                both.all(|(one, other)| (one - other).abs() <= 1e-13 * (1.0 + one.abs()))
            };
            let done = same(&next.0, &self.slope.0) && same(&next.1, &self.slope.1);
            self.slope = next;
            if done {
                break;
            }
        }
        self.angle = ahead(&self.angle, &self.slope.0, h);
        self.momentum = ahead(&self.momentum, &self.slope.1, h);
    }

    fn state(&self) -> State<N> {
        let joints = |links: &[f64; N]| {
            std::array::from_fn(|i| {
                if i == 0 {
                    links[0]
                } else {
                    links[i] - links[i - 1]
                }
            })
        };
        State {
            position: joints(&self.angle),
            velocity: joints(&slope(self.arm, &self.angle, &self.momentum).0),
        }
    }
}

/// The rates `∂H/∂p` and the forces `-∂H/∂φ`.
fn slope<const N: usize>(
    arm: &Arm<N>,
    angle: &[f64; N],
    momentum: &[f64; N],
) -> ([f64; N], [f64; N]) {
    let (sin, cos) = trig::sin_cos(angle);
    let rate = solve(&matrix(arm, &(sin, cos)), *momentum);
    let force = |i: usize| {
        let pull = |j: usize| {
            coupling(arm, i, j) * (sin[i] * cos[j] - cos[i] * sin[j]) * rate[i] * rate[j]
        };
        -(0..N).map(pull).sum::<f64>() - weight_moment(arm, i) * cos[i]
    };
    (rate, std::array::from_fn(force))
}

fn matrix<const N: usize>(arm: &Arm<N>, (sin, cos): &([f64; N], [f64; N])) -> [[f64; N]; N] {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| coupling(arm, i, j) * (cos[i] * cos[j] + sin[i] * sin[j]))
    })
}

fn running_sum<const N: usize>(joints: &[f64; N]) -> [f64; N] {
    let mut sum = 0.0;
    joints.map(|joint| {
        sum += joint;
        sum
    })
}

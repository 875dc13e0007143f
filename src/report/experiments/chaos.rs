//! Long free swings, and their energy.
//!
//! **Invariant:** every run starts at a stated state and uses the live arm's stepper.

use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::dynamics::{coupling, energy, kinetic_energy, running_sum, solve, weight_moment};
use crate::math::integrator::Method;
use crate::math::trig;
use crate::study::control_loop::ControlLoop;
use crate::study::motion::lowest;
use crate::study::taylor::series::differences;

/// Energy drift over the energy scale, largest so far, at times that grow by a factor, and at the end: `(time, drift)`.
pub fn energy_drift<const N: usize>(
    arm: &Arm<N>,
    start: &State<N>,
    method: Method,
    h: f64,
    duration: f64,
) -> Vec<(f64, f64)> {
    let control = ControlLoop::free(*arm).with_method(method);
    let mut simulation = control.with_timestep(h).simulation(*start);
    drift(arm, start, h, duration, |steps| {
        (simulation.advance(steps) == steps).then(|| *simulation.state())
    })
}

/// The same for implicit midpoint, a baseline of this report: it is symplectic, since it steps angles and momenta.
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

/// The scale of energies \[J\]: twice the largest possible potential energy plus the initial kinetic energy. Never the
/// energy itself, which is 0 for an arm let go from the horizontal.
fn energy_scale<const N: usize>(arm: &Arm<N>, start: &State<N>) -> f64 {
    kinetic_energy(arm, &start.position, &start.velocity) - 2.0 * lowest(arm)
}

fn drift<const N: usize>(
    arm: &Arm<N>,
    start: &State<N>,
    h: f64,
    duration: f64,
    mut advance: impl FnMut(u64) -> Option<State<N>>,
) -> Vec<(f64, f64)> {
    /// Ratio of the times of two successive points.
    const FACTOR: f64 = 1.12;
    /// Steps between two samples of the energy.
    const LOOK: u64 = 8;
    let (scale, first) = (energy_scale(arm, start), energy(arm, start));
    let mut points = Vec::new();
    let (mut largest, mut due, mut steps) = (0.0_f64, h, 0);
    while in_f64(steps) * h < duration {
        let Some(state) = advance(LOOK) else { break };
        steps += LOOK;
        largest = largest.max((energy(arm, &state) - first).abs() / scale);
        let time = in_f64(steps) * h;
        if time >= due || time >= duration {
            points.push((time, largest));
            due = time * FACTOR;
        }
    }
    points
}

/// A free swing in the angles of its links and their momenta, `p_i = Σ_j K_ij cos(φ_i - φ_j) φ̇_j`.
struct Hamiltonian<'a, const N: usize> {
    arm: &'a Arm<N>,
    /// Angles and momenta.
    y: [[f64; N]; 2],
    /// The last slope, the initial guess for the next one.
    slope: [[f64; N]; 2],
}

impl<'a, const N: usize> Hamiltonian<'a, N> {
    fn new(arm: &'a Arm<N>, start: &State<N>) -> Self {
        let (angle, rate) = (running_sum(&start.position), running_sum(&start.velocity));
        let matrix = matrix(arm, &trig::sin_cos(&angle));
        let momentum = matrix.map(|row| row.iter().zip(&rate).map(|(k, rate)| k * rate).sum());
        let y = [angle, momentum];
        let slope = slope(arm, &y);
        Self { arm, y, slope }
    }

    /// `y' = y + h f((y + y') / 2)`, solved by fixed-point iteration, with two or more digits per round at the
    /// timesteps used here.
    fn step(&mut self, h: f64) {
        const ROUNDS: usize = 12;
        for _ in 0..ROUNDS {
            let next = slope(self.arm, &self.ahead(0.5 * h));
            let mut both = next.iter().flatten().zip(self.slope.iter().flatten());
            let done = both.all(|(one, other)| (one - other).abs() <= 1e-13 * (1.0 + one.abs()));
            self.slope = next;
            if done {
                break;
            }
        }
        self.y = self.ahead(h);
    }

    fn ahead(&self, h: f64) -> [[f64; N]; 2] {
        std::array::from_fn(|k| std::array::from_fn(|i| self.y[k][i] + h * self.slope[k][i]))
    }

    fn state(&self) -> State<N> {
        State {
            position: differences(&self.y[0]),
            velocity: differences(&slope(self.arm, &self.y)[0]),
        }
    }
}

/// The rates `∂H/∂p` and the forces `-∂H/∂φ`.
fn slope<const N: usize>(arm: &Arm<N>, [angle, momentum]: &[[f64; N]; 2]) -> [[f64; N]; 2] {
    let (sin, cos) = trig::sin_cos(angle);
    let rate = solve(&matrix(arm, &(sin, cos)), *momentum);
    let force = |i: usize| {
        let pull = |j: usize| {
            coupling(arm, i, j) * (sin[i] * cos[j] - cos[i] * sin[j]) * rate[i] * rate[j]
        };
        -(0..N).map(pull).sum::<f64>() - weight_moment(arm, i) * cos[i]
    };
    [rate, std::array::from_fn(force)]
}

fn matrix<const N: usize>(arm: &Arm<N>, (sin, cos): &([f64; N], [f64; N])) -> [[f64; N]; N] {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| coupling(arm, i, j) * (cos[i] * cos[j] + sin[i] * sin[j]))
    })
}

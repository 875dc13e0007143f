//! A named scene, its observation, and the settings, states and comparisons that scenes share.
//!
//! **Invariant:** random values come from a seed in the source, so a scene does the same every time.

use crate::math::arm::{Arm, State};
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};
use crate::math::simulation::Simulation;
use crate::study::control_loop::ControlLoop;
use crate::study::matrix::{largest, largest_difference};

/// A named scene.
#[derive(Debug, Clone, Copy)]
pub struct Scenario {
    /// `S01` to `S43`.
    pub id: &'static str,
    /// The arm, its motion and its control.
    pub parameters: &'static str,
    /// The behaviour of a correct arm.
    pub expected: &'static str,
    /// Whether it takes seconds.
    pub slow: bool,
    pub(super) check: Check,
}

/// Runs a scene.
pub(super) type Check = fn() -> Observation;

impl Scenario {
    /// Runs the scene.
    pub fn run(&self) -> Observation {
        (self.check)()
    }
}

/// Whether a scene, or a case of it, is as expected, and the observation with its figures.
pub type Observation = (bool, String);

/// The observation of several cases, which must all hold.
pub(super) fn each(cases: impl IntoIterator<Item = Observation>) -> Observation {
    let (holds, words): (Vec<bool>, Vec<String>) = cases.into_iter().unzip();
    (holds.into_iter().all(|holds| holds), words.join(", "))
}

/// Whether `value` is there, and within `part` of `expected`.
pub(super) fn is_near(value: Option<f64>, expected: f64, part: f64) -> bool {
    value.is_some_and(|value| (value / expected - 1.0).abs() < part)
}

/// Gains of two joints, with the same springs and integrals.
pub(super) fn gains(kp: f64, ki: f64, kd: [f64; 2]) -> Gains<2> {
    let (kp, ki) = ([kp; 2], [ki; 2]);
    Gains { kp, ki, kd }
}

/// Links of 1 m and 1 kg, held with these gains in this pose, by Runge-Kutta 4 at a millisecond.
pub(super) fn held<const N: usize>(gains: Gains<N>, pose: [f64; N]) -> ControlLoop<N> {
    ControlLoop::new(Arm::default(), gains, Setpoint::at(pose))
}

/// An arm of links of 1 m.
pub(super) fn arm<const N: usize>(masses: [f64; N], gravity: f64) -> Arm<N> {
    Arm::new([1.0; N], masses, gravity).unwrap_or_default()
}

/// An arm left to itself, through the live loop.
pub(super) fn free<const N: usize>(
    arm: Arm<N>,
    start: State<N>,
    method: Method,
    timestep: f64,
) -> Simulation<N> {
    let control = ControlLoop::free(arm).with_method(method);
    control.with_timestep(timestep).simulation(start)
}

/// Largest difference of positions \[rad\] and velocities \[rad/s\].
pub(super) fn apart<const N: usize>(a: &State<N>, b: &State<N>) -> f64 {
    let [one, other] = [a, b].map(|it| [it.position, it.velocity]);
    largest_difference(one.as_flattened(), other.as_flattened())
}

/// Speed of the fastest joint \[rad/s\].
pub(super) fn fastest<const N: usize>(simulation: &Simulation<N>) -> f64 {
    largest(simulation.state().velocity.iter().map(|v| v.abs()))
}

/// Repeatable numbers from -1 to 1.
pub(super) struct Noise(fastrand::Rng);

impl Noise {
    pub(super) fn new() -> Self {
        Self(fastrand::Rng::with_seed(7))
    }

    pub(super) fn next(&mut self) -> f64 {
        2.0 * self.0.f64() - 1.0
    }

    pub(super) fn array<const N: usize>(&mut self, scale: f64) -> [f64; N] {
        std::array::from_fn(|_| scale * self.next())
    }
}

/// Two hundred random states around a pose, angles within `spread` \[rad\], rates within 2 rad/s. The first joint turns
/// everywhere.
pub(super) fn states<const N: usize>(pose: [f64; N], spread: f64) -> Vec<State<N>> {
    let mut noise = Noise::new();
    let state = |_| State {
        position: std::array::from_fn(|i| {
            let spread = if i == 0 { 3.0 } else { spread };
            pose[i] + spread * noise.next()
        }),
        velocity: noise.array(2.0),
    };
    (0..200).map(state).collect()
}

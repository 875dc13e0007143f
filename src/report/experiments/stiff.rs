//! The limits of explicit methods: the cost of an error as an arm gets stiffer, for an explicit and two implicit methods.
//!
//! A 2-link arm swings from a bent pose under an effort `u = k (q* - q₂) - d q̇₂` at its elbow, at every instant. Each
//! scene has an elbow whose own motion gets faster than the swing, and hardly changes it:
//!
//! | scene | what grows | the elbow's rate |
//! | --- | --- | --- |
//! | brake | d, with k = 0 | `d (M⁻¹)₂₂`, decays |
//! | spring | k, with d = 0 | `√(k (M⁻¹)₂₂)`, oscillates |
//! | light last link | 1 / its mass, with fixed k and d | `d (M⁻¹)₂₂`, decays |
//! | controller | k and d | `√(k (M⁻¹)₂₂)`, decays without oscillating |
//!
//! The spring and the controller begin where their effort balances the swing, at a small velocity. So the fast motion has
//! an energy of its own, which the spring keeps.
//!
//! **Invariant:** the ratio of a scene is the elbow's rate per that of the swing, at the arm hanging with the elbow at its
//! target.

use std::f64::consts::FRAC_PI_2;

use super::solvers::{self, Solver};
use super::task::Task;
use crate::math::arm::{Arm, State};
use crate::math::count::{in_f64, whole};
use crate::math::dynamics::{forward_dynamics, mass_matrix};
use crate::math::pid::{Gains, Setpoint};
use crate::study::control_loop::{ControlLoop, no_control};
use crate::study::linear::{Linear, gravity_gradient};
use crate::study::matrix::{largest, largest_difference};
use crate::study::stability::{Sampling, largest_timestep};

/// Simulated time of a run \[s\].
pub const DURATION: f64 = 2.0;

/// Instants at which a run is compared.
const OUTPUTS: u64 = 8;

/// Steps of the reference.
const REFERENCE_STEPS: u64 = 1 << 15;

/// What makes the elbow fast.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stiffness {
    /// Damping.
    Brake,
    /// A spring without damping.
    Spring,
    /// A light last link under fixed gains.
    LightLink,
    /// Gains of critical damping.
    Controller,
}

impl Stiffness {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Brake, Self::Spring, Self::LightLink, Self::Controller];
}

/// An arm with a fast elbow.
pub struct StiffScene {
    control: ControlLoop<2>,
    start: State<2>,
    /// The elbow's rate per that of the swing.
    pub ratio: f64,
    /// The motion, whose reference is known at eight instants.
    pub task: Task,
}

/// The pose at the start \[rad\].
const BENT: [f64; 2] = [0.4, -0.3];

/// Velocity of the sprung or controlled elbow at the start \[rad/s\].
const FLICK: f64 = 1e-3;

/// The spring of the light link \[N m/rad\].
const SOFT: f64 = 5.0;

/// The elbow at `angle` \[rad\] of an arm that hangs.
const fn hanging(angle: f64) -> [f64; 2] {
    [-FRAC_PI_2, angle]
}

/// The rate of the swing \[1/s\], and `(M⁻¹)₂₂` \[1/(kg m²)\].
fn rates(arm: Arm<2>) -> (f64, f64) {
    let pose = hanging(BENT[1]);
    let swing = gravity_gradient(&arm, &pose)[0] / mass_matrix(&arm, &pose)[0][0];
    let linear = Linear::at(&ControlLoop::free(arm), &pose, &[false; 2]);
    (swing.sqrt(), linear.inverse_mass[(1, 1)])
}

impl StiffScene {
    /// The scene of this ratio.
    pub fn new(stiffness: Stiffness, ratio: f64) -> Self {
        let (swing, inverse) = rates(Arm::default());
        let (rate, damping) = (ratio * swing, swing / inverse);
        let mut arm = Arm::default();
        let (kp, kd) = match stiffness {
            Stiffness::Brake => (0.0, ratio * damping),
            Stiffness::Spring => (rate * rate / inverse, 0.0),
            Stiffness::Controller => (rate * rate / inverse, 2.0 * rate / inverse),
            Stiffness::LightLink => {
                arm = Arm::new([1.0; 2], [1.0, 1.0 / ratio], arm.gravity()).unwrap_or(arm);
                (SOFT, damping)
            }
        };
        let mut start = State::at_rest(BENT);
        let mut target = BENT[1];
        if matches!(stiffness, Stiffness::Spring | Stiffness::Controller) {
            target += balance(&arm, &start) / kp;
            start.velocity[1] = FLICK;
        }
        let of_elbow = |value| [0.0, value];
        let gains = Gains {
            kp: of_elbow(kp),
            kd: of_elbow(kd),
            ..no_control()
        };
        let control = ControlLoop::new(arm, gains, Setpoint::at(of_elbow(target)));
        let outputs = |solver| -> Vec<Vec<f64>> {
            let mut run = solvers::ready(&control, start, DURATION, solver, REFERENCE_STEPS);
            let output = |_| {
                run.advance(REFERENCE_STEPS / OUTPUTS);
                run.place().to_vec()
            };
            (0..OUTPUTS).map(output).collect()
        };
        let [fine, other] = [Solver::Rodas3, Solver::ImplicitMidpoint].map(outputs);
        let pairs = fine.iter().zip(&other);
        let differences = pairs.map(|(one, other)| largest_difference(one, other));
        let of_link = rates(arm);
        Self {
            control,
            start,
            ratio: match stiffness {
                Stiffness::LightLink => damping * of_link.1 / of_link.0,
                _ => ratio,
            },
            task: Task {
                duration: DURATION,
                uncertainty: largest(differences),
                looks: OUTPUTS,
                unit: OUTPUTS,
                ready: Box::new(move |solver, steps| {
                    solvers::ready(&control, start, DURATION, solver, steps)
                }),
                distance: Box::new(move |time, place| {
                    let output = (time.to_f64() / DURATION * in_f64(OUTPUTS)).round();
                    let output = usize::try_from(whole(output).saturating_sub(1)).unwrap_or(0);
                    fine.get(output)
                        .map_or(f64::NAN, |fine| largest_difference(fine, place))
                }),
            },
        }
    }

    /// The fewest steps that the linearised loop allows an explicit method where it hangs; none for a baseline.
    pub fn fewest_stable_steps(&self, solver: &Solver) -> Option<f64> {
        let Solver::Fixed(method) = solver else {
            return None;
        };
        let pose = hanging(BENT[1]);
        let linear = Linear::at(&self.control, &pose, &[false; 2]);
        let limit = largest_timestep(&linear, *method, Sampling::Continuous)?;
        Some(DURATION / limit)
    }

    /// The energy of the elbow's own motion after a run, per that at the start; infinite after a divergence.
    pub fn fast_energy(&self, solver: Solver, steps: u64) -> f64 {
        let mut run = (self.task.ready)(solver, steps);
        if !run.advance(steps) {
            return f64::INFINITY;
        }
        let mut end = self.start;
        end.position.copy_from_slice(run.place());
        end.velocity.copy_from_slice(run.rates());
        self.energy(&end) / self.energy(&self.start)
    }

    /// The energy of the elbow about the place in which the spring carries the load of the swing \[J\]. That place moves.
    fn energy(&self, state: &State<2>) -> f64 {
        /// A time in which the load changes in proportion \[s\].
        const INSTANT: f64 = 1e-6;
        let arm = &self.control.arm;
        let ([q, elbow], [v, speed]) = (state.position, state.velocity);
        let load = balance(arm, state);
        let [a, _] = forward_dynamics(arm, &state.position, &[v, 0.0], &[0.0, load]);
        let later = State {
            position: [q + INSTANT * v, elbow],
            velocity: [v + INSTANT * a, 0.0],
        };
        let (kp, target) = (self.control.gains.kp[1], self.control.setpoint.position[1]);
        let off = elbow + load / kp - target;
        let speed = speed + (balance(arm, &later) - load) / INSTANT / kp;
        0.5 * (speed * speed / rates(*arm).1 + kp * off * off)
    }
}

/// The effort that keeps the elbow from accelerating \[N m\].
fn balance(arm: &Arm<2>, state: &State<2>) -> f64 {
    let velocity = [state.velocity[0], 0.0];
    let at = |effort| forward_dynamics(arm, &state.position, &velocity, &[0.0, effort])[1];
    at(0.0) / (at(0.0) - at(1.0))
}

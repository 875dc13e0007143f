//! The limits of explicit methods: the cost of an error as the arm gets stiffer, beside two implicit methods.
//!
//! The arm is let go from a bent pose, with a brake at its elbow: an effort `-d q̇₂` at every instant. The stronger
//! the brake, or the lighter the link that it brakes, the faster the elbow's own rate `d (M⁻¹)₂₂` beside that of the
//! swing; the motion hardly changes. An explicit method has to follow that rate, an implicit one has not.
//!
//! | baseline | order | stable | evaluations of a step, with `2 N` for a Jacobian by differences |
//! | --- | --- | --- | --- |
//! | implicit midpoint | 2 | for every rate that decays | 1 for the start, one for each iteration |
//! | Rodas3 | 3 | for every rate that decays; what is infinitely fast is gone after a step | 3 |
//!
//! The baselines are here for the report alone: none can be selected on the live arm. Source: Hairer and Wanner,
//! *Solving Ordinary Differential Equations II* (1996), ch. IV.3 and IV.7; for Rodas3, Sandu et al., *Atmospheric
//! Environment* 31 (1997).
//!
//! **Invariant:** every evaluation is counted, those for Jacobians too.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over the four states and the four stages of arrays of these lengths"
)]

use std::f64::consts::FRAC_PI_2;

use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::dynamics::{forward_dynamics, mass_matrix};
use crate::math::integrator::{Method, increment};
use crate::math::pid::{Gains, Setpoint};
use crate::study::control_loop::ControlLoop;
use crate::study::linear::{Linear, gravity_gradient};
use crate::study::matrix::Matrix;
use crate::study::stability::{Sampling, largest_timestep};

/// Simulated time of a run \[s\].
pub const DURATION: f64 = 2.0;

/// Instants at which a run is compared.
pub const OUTPUTS: u64 = 8;

/// Steps of the reference.
const REFERENCE_STEPS: u64 = 1 << 15;

/// Most iterations of Newton's method in a step of the implicit midpoint rule.
const MAX_ITERATIONS: usize = 12;

/// An explicit method of the live arm, or a baseline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Solver {
    /// One of the four.
    Explicit(Method),
    /// `y + h f((y + y') / 2)`, solved by Newton's method.
    ImplicitMidpoint,
    /// A Rosenbrock method of four stages.
    Rodas3,
}

impl Solver {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Explicit(Method::Euler),
        Self::Explicit(Method::Midpoint),
        Self::Explicit(Method::Verlet),
        Self::Explicit(Method::Rk4),
        Self::ImplicitMidpoint,
        Self::Rodas3,
    ];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Explicit(method) => method.name(),
            Self::ImplicitMidpoint => "implicit midpoint",
            Self::Rodas3 => "rodas3",
        }
    }

    /// Whether it is a baseline of the report.
    #[must_use]
    pub const fn is_baseline(self) -> bool {
        !matches!(self, Self::Explicit(_))
    }
}

/// How a scene is made stiff.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum By {
    /// A stronger brake.
    Gains,
    /// A lighter link behind the same brake.
    Masses,
}

/// Positions and velocities of both joints.
type Whole = [f64; 4];

/// A braked arm.
#[derive(Debug, Clone)]
pub struct StiffScene {
    control: ControlLoop<2>,
    /// The elbow's rate per that of the swing.
    pub ratio: f64,
    /// Positions at the outputs.
    reference: Vec<[f64; 2]>,
    /// How far two references of different methods are apart \[rad\].
    pub uncertainty: f64,
}

/// A run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StiffRun {
    /// Steps taken.
    pub steps: u64,
    /// Evaluations of the dynamics.
    pub evaluations: u64,
    /// Largest error of a joint at the outputs \[rad\]; infinite where the run left the finite numbers.
    pub error: f64,
}

const START: State<2> = State {
    position: [0.4, -0.3],
    velocity: [0.0; 2],
};

impl StiffScene {
    /// The scene whose elbow is about so many times as fast as its swing.
    #[must_use]
    pub fn new(by: By, stiffness: f64) -> Self {
        let hanging = [-FRAC_PI_2, 0.0];
        let even = Arm::<2>::default();
        let rates = |arm: &Arm<2>| {
            let swing =
                (gravity_gradient(arm, &hanging)[0] / mass_matrix(arm, &hanging)[0][0]).sqrt();
            let unit = forward_dynamics(arm, &hanging, &[0.0; 2], &[0.0, 1.0])[1];
            let still = forward_dynamics(arm, &hanging, &[0.0; 2], &[0.0; 2])[1];
            (swing, unit - still)
        };
        let (swing, mobility) = rates(&even);
        let (arm, brake) = match by {
            By::Gains => (even, stiffness * swing / mobility),
            By::Masses => {
                let light = Arm::new([1.0; 2], [1.0, 1.0 / stiffness], 9.81).unwrap_or(even);
                (light, swing / mobility)
            }
        };
        let gains = Gains {
            kp: [0.0; 2],
            ki: [0.0; 2],
            kd: [0.0, brake],
        };
        let (swing, mobility) = rates(&arm);
        let mut scene = Self {
            control: ControlLoop::new(arm, gains, Setpoint::default()),
            ratio: brake * mobility / swing,
            reference: vec![],
            uncertainty: 0.0,
        };
        let fine = scene.march(Solver::Rodas3, REFERENCE_STEPS).0;
        let other = scene.march(Solver::ImplicitMidpoint, REFERENCE_STEPS).0;
        scene.uncertainty = apart(&fine, &other);
        scene.reference = fine;
        scene
    }

    /// A run of `steps` steps, a multiple of [`OUTPUTS`].
    #[must_use]
    pub fn run(&self, solver: Solver, steps: u64) -> StiffRun {
        let (positions, evaluations) = self.march(solver, steps);
        StiffRun {
            steps,
            evaluations,
            error: apart(&self.reference, &positions),
        }
    }

    /// The fewest steps that the linearised loop allows an explicit method where it hangs; none for a baseline.
    #[must_use]
    pub fn fewest_stable_steps(&self, solver: Solver) -> Option<f64> {
        let Solver::Explicit(method) = solver else {
            return None;
        };
        let linear = Linear::at(&self.control, &[-FRAC_PI_2, 0.0], &[false; 2]);
        let limit = largest_timestep(&linear, method, Sampling::Continuous)?;
        Some(DURATION / limit)
    }

    /// Positions at the outputs, as far as numbers go, and evaluations.
    fn march(&self, solver: Solver, steps: u64) -> (Vec<[f64; 2]>, u64) {
        let h = DURATION / in_f64(steps);
        let every = (steps / OUTPUTS).max(1);
        let (mut positions, mut evaluations) = (Vec::new(), 0);
        let [a, b] = START.position;
        let mut y = [a, b, 0.0, 0.0];
        for step in 1..=steps {
            let finite = match solver {
                Solver::Explicit(method) => self.explicit(method, &mut y, h, &mut evaluations),
                Solver::Rodas3 => self.rodas3(&mut y, h, &mut evaluations),
                Solver::ImplicitMidpoint => self.implicit_midpoint(&mut y, h, &mut evaluations),
            };
            if finite.is_none() {
                break;
            }
            if step.is_multiple_of(every) {
                positions.push([y[0], y[1]]);
            }
        }
        (positions, evaluations)
    }

    /// A step of the law in every stage.
    fn explicit(&self, method: Method, y: &mut Whole, h: f64, evaluations: &mut u64) -> Option<()> {
        let acceleration = |_: f64, q: &[f64; 2], v: &[f64; 2]| {
            let [.., a, b] = self.slope(&[q[0], q[1], v[0], v[1]], evaluations);
            [a, b]
        };
        let (q, v) = ([y[0], y[1]], [y[2], y[3]]);
        let (dq, dv) = increment(method, acceleration, 0.0, &q, &v, h);
        add(y, &[dq[0], dq[1], dv[0], dv[1]])
    }

    fn slope(&self, y: &Whole, evaluations: &mut u64) -> Whole {
        *evaluations += 1;
        let (q, v) = ([y[0], y[1]], [y[2], y[3]]);
        let kd = &self.control.gains.kd;
        let a = forward_dynamics(&self.control.arm, &q, &v, &[-kd[0] * v[0], -kd[1] * v[1]]);
        [v[0], v[1], a[0], a[1]]
    }

    /// `∂f/∂y` by differences, `f` at `y` being known.
    fn jacobian(&self, y: &Whole, f: &Whole, evaluations: &mut u64) -> Matrix {
        let mut jacobian = Matrix::zeros(4);
        for column in 0..4 {
            let nudge = 1e-7 * (1.0 + y[column].abs());
            let mut near = *y;
            near[column] += nudge;
            let moved = self.slope(&near, evaluations);
            for row in 0..4 {
                jacobian[(row, column)] = (moved[row] - f[row]) / (near[column] - y[column]);
            }
        }
        jacobian
    }

    fn implicit_midpoint(&self, y: &mut Whole, h: f64, evaluations: &mut u64) -> Option<()> {
        let start = self.slope(y, evaluations);
        let jacobian = self.jacobian(y, &start, evaluations);
        let newton = jacobian.shifted_identity(-0.5 * h);
        let mut k = start;
        for _ in 0..MAX_ITERATIONS {
            let middle = std::array::from_fn(|i| y[i] + 0.5 * h * k[i]);
            let f = self.slope(&middle, evaluations);
            let left: Vec<f64> = (0..4).map(|i| f[i] - k[i]).collect();
            let change = newton.solve(&left)?;
            let mut done = true;
            for i in 0..4 {
                k[i] += change[i];
                done &= (h * change[i]).abs() <= 1e-13 * (1.0 + y[i].abs());
            }
            if done {
                break;
            }
        }
        add(y, &std::array::from_fn(|i| h * k[i]))
    }

    /// In the form `(I/(γh) - J) k = f(y + …) + …/h`, γ = 1/2.
    fn rodas3(&self, y: &mut Whole, h: f64, evaluations: &mut u64) -> Option<()> {
        let start = self.slope(y, evaluations);
        let jacobian = self.jacobian(y, &start, evaluations);
        let matrix = Matrix::from_fn(4, |i, j| {
            let diagonal = if i == j { 2.0 / h } else { 0.0 };
            diagonal - jacobian[(i, j)]
        });
        let stage = |f: &Whole, others: &Whole| -> Option<Whole> {
            let right: Vec<f64> = (0..4).map(|i| f[i] + others[i] / h).collect();
            matrix.solve(&right)?.try_into().ok()
        };
        let k1 = stage(&start, &[0.0; 4])?;
        let k2 = stage(&start, &k1.map(|k| 4.0 * k))?;
        let ahead: Whole = std::array::from_fn(|i| y[i] + 2.0 * k1[i]);
        let f3 = self.slope(&ahead, evaluations);
        let k3 = stage(&f3, &std::array::from_fn(|i| k1[i] - k2[i]))?;
        let ahead: Whole = std::array::from_fn(|i| y[i] + 2.0 * k1[i] + k3[i]);
        let f4 = self.slope(&ahead, evaluations);
        let others = std::array::from_fn(|i| k1[i] - k2[i] - 8.0 / 3.0 * k3[i]);
        let k4 = stage(&f4, &others)?;
        add(y, &std::array::from_fn(|i| 2.0 * k1[i] + k3[i] + k4[i]))
    }
}

/// Adds a step; none where numbers end.
fn add(y: &mut Whole, change: &Whole) -> Option<()> {
    for (y, change) in y.iter_mut().zip(change) {
        *y += change;
    }
    y.iter().all(|y| y.is_finite()).then_some(())
}

/// Largest distance of a joint \[rad\]; infinite where one ended early.
fn apart(reference: &[[f64; 2]], positions: &[[f64; 2]]) -> f64 {
    if positions.len() < reference.len() {
        return f64::INFINITY;
    }
    let both = reference.iter().flatten().zip(positions.iter().flatten());
    both.map(|(one, other)| (one - other).abs())
        .fold(0.0, f64::max)
}

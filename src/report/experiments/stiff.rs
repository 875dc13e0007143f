//! The limits of explicit methods: the cost of an error as the arm gets stiffer, beside two implicit methods.
//!
//! The arm is released from a bent pose, with a brake at its elbow: an effort `-d q̇₂` at every instant. A stronger
//! brake makes the elbow's own rate `d (M⁻¹)₂₂` faster than that of the swing, and hardly changes the motion. An
//! explicit method has to follow that rate, an implicit one has not.
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

use std::f64::consts::FRAC_PI_2;

use super::task::{Task, TaskRun};
use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::dynamics::{forward_dynamics, mass_matrix};
use crate::math::integrator::{Method, moved};
use crate::math::pid::{Gains, Setpoint};
use crate::study::beside::Steppable;
use crate::study::continuous::ContinuousLoop;
use crate::study::control_loop::{ControlLoop, no_control};
use crate::study::linear::{Linear, gravity_gradient};
use crate::study::matrix::{Matrix, largest, largest_difference};
use crate::study::stability::{Sampling, largest_timestep};

/// Simulated time of a run \[s\].
pub const DURATION: f64 = 2.0;

/// Instants at which a run is compared.
const OUTPUTS: u64 = 8;

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
    pub const fn name(self) -> &'static str {
        match self {
            Self::Explicit(method) => method.name(),
            Self::ImplicitMidpoint => "implicit midpoint",
            Self::Rodas3 => "rodas3",
        }
    }

    /// Whether it is a baseline of the report.
    pub const fn is_baseline(self) -> bool {
        !matches!(self, Self::Explicit(_))
    }
}

/// Positions and velocities of both joints.
type Whole = [f64; 4];

/// A braked arm.
pub struct StiffScene {
    control: ControlLoop<2>,
    /// The elbow's rate per that of the swing.
    pub ratio: f64,
    /// The motion, whose reference is known at eight instants.
    pub task: Task<Solver>,
}

const START: State<2> = State {
    position: [0.4, -0.3],
    velocity: [0.0; 2],
};

/// The pose of both rates: hanging, with the elbow at its angle of the start. A strong brake keeps it there.
const HANGING: [f64; 2] = [-FRAC_PI_2, START.position[1]];

impl StiffScene {
    /// The scene whose elbow's rate is `ratio` times that of its swing.
    pub fn new(ratio: f64) -> Self {
        let arm = Arm::<2>::default();
        let pull = gravity_gradient(&arm, &HANGING)[0];
        let swing = (pull / mass_matrix(&arm, &HANGING)[0][0]).sqrt();
        let linear = Linear::at(&ControlLoop::free(arm), &HANGING, &[false; 2]);
        let gains = Gains {
            kd: [0.0, ratio * swing / linear.inverse_mass[(1, 1)]],
            ..no_control()
        };
        let control = ControlLoop::new(arm, gains, Setpoint::default());
        let outputs = |solver| -> Vec<Vec<f64>> {
            let mut run = ready(&control, solver, REFERENCE_STEPS);
            let output = |_| {
                run.advance(REFERENCE_STEPS / OUTPUTS);
                run.place().to_vec()
            };
            (0..OUTPUTS).map(output).collect()
        };
        let [fine, other] = [Solver::Rodas3, Solver::ImplicitMidpoint].map(outputs);
        let pairs = fine.iter().zip(&other);
        let differences = pairs.map(|(one, other)| largest_difference(one, other));
        Self {
            control,
            ratio,
            task: Task {
                duration: DURATION,
                uncertainty: largest(differences),
                looks: OUTPUTS,
                unit: OUTPUTS,
                ready: Box::new(move |solver, steps| ready(&control, solver, steps)),
                distance: Box::new(move |done, steps, place| {
                    let output = usize::try_from(done * OUTPUTS / steps).unwrap_or(0);
                    fine.get(output.saturating_sub(1))
                        .map_or(f64::NAN, |fine| largest_difference(fine, place))
                }),
            },
        }
    }

    /// The fewest steps that the linearised loop allows an explicit method where it hangs; none for a baseline.
    pub fn fewest_stable_steps(&self, solver: Solver) -> Option<f64> {
        let Solver::Explicit(method) = solver else {
            return None;
        };
        let linear = Linear::at(&self.control, &HANGING, &[false; 2]);
        let limit = largest_timestep(&linear, method, Sampling::Continuous)?;
        Some(DURATION / limit)
    }
}

/// A run of a solver with this number of steps, before its first.
fn ready(control: &ControlLoop<2>, solver: Solver, steps: u64) -> Box<dyn TaskRun> {
    let h = DURATION / in_f64(steps);
    let step: fn(&mut Implicit) -> Option<Whole> = match solver {
        Solver::Explicit(method) => {
            let control = control.with_method(method).with_timestep(h);
            let run = ContinuousLoop::new(control, START, [0.0; 2]);
            let run: Box<dyn Steppable<2>> = Box::new(run);
            return Box::new(run);
        }
        Solver::ImplicitMidpoint => Implicit::midpoint,
        Solver::Rodas3 => Implicit::rodas3,
    };
    let [a, b] = START.position;
    Box::new(Implicit {
        control: *control,
        step,
        h,
        y: [a, b, 0.0, 0.0],
        evaluations: 0,
    })
}

/// The run of a baseline.
struct Implicit {
    control: ControlLoop<2>,
    /// The change in a step; none where it can't be computed.
    step: fn(&mut Self) -> Option<Whole>,
    /// Length of a step \[s\].
    h: f64,
    y: Whole,
    evaluations: u64,
}

impl TaskRun for Implicit {
    fn advance(&mut self, steps: u64) -> u64 {
        for taken in 0..steps {
            let change = (self.step)(self).unwrap_or([f64::NAN; 4]);
            self.y = moved(&self.y, 1.0, &change);
            if !self.y.iter().all(|y| y.is_finite()) {
                return taken;
            }
        }
        steps
    }

    fn place(&self) -> &[f64] {
        &self.y[..2]
    }

    fn evaluations(&self) -> u64 {
        self.evaluations
    }
}

impl Implicit {
    fn slope(&mut self, y: &Whole) -> Whole {
        self.evaluations += 1;
        let (q, v) = ([y[0], y[1]], [y[2], y[3]]);
        let kd = &self.control.gains.kd;
        let a = forward_dynamics(&self.control.arm, &q, &v, &[-kd[0] * v[0], -kd[1] * v[1]]);
        [v[0], v[1], a[0], a[1]]
    }

    /// `f` at the present state, and `∂f/∂y` by differences.
    fn jacobian(&mut self) -> (Whole, Matrix) {
        let y = self.y;
        let f = self.slope(&y);
        let mut jacobian = Matrix::zeros(4);
        for column in 0..4 {
            let nudge = 1e-7 * (1.0 + y[column].abs());
            let mut near = y;
            near[column] += nudge;
            let moved = self.slope(&near);
            for row in 0..4 {
                jacobian[(row, column)] = (moved[row] - f[row]) / (near[column] - y[column]);
            }
        }
        (f, jacobian)
    }

    fn midpoint(&mut self) -> Option<Whole> {
        let (y, h) = (self.y, self.h);
        let (mut k, jacobian) = self.jacobian();
        let newton = jacobian.scaled(-0.5 * h).plus_diagonal(1.0);
        for _ in 0..MAX_ITERATIONS {
            let f = self.slope(&moved(&y, 0.5 * h, &k));
            let left: Vec<f64> = (0..4).map(|i| f[i] - k[i]).collect();
            let change: Whole = newton.solve(&left)?.try_into().ok()?;
            k = moved(&k, 1.0, &change);
            if (0..4).all(|i| (h * change[i]).abs() <= 1e-13 * (1.0 + y[i].abs())) {
                break;
            }
        }
        Some(k.map(|k| h * k))
    }

    /// In the form `(I/(γh) - J) k = f(y + …) + …/h`, γ = 1/2.
    fn rodas3(&mut self) -> Option<Whole> {
        let (y, h) = (self.y, self.h);
        let (start, jacobian) = self.jacobian();
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
        let f3 = self.slope(&moved(&y, 2.0, &k1));
        let k3 = stage(&f3, &std::array::from_fn(|i| k1[i] - k2[i]))?;
        let ahead = moved(&moved(&y, 2.0, &k1), 1.0, &k3);
        let f4 = self.slope(&ahead);
        let others = std::array::from_fn(|i| k1[i] - k2[i] - 8.0 / 3.0 * k3[i]);
        let k4 = stage(&f4, &others)?;
        Some(std::array::from_fn(|i| 2.0 * k1[i] + k3[i] + k4[i]))
    }
}

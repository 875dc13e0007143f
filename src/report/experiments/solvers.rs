//! The methods of the live arm, and the baselines of the report beside them.
//!
//! | baseline | order | steps | stable | evaluations of a step |
//! | --- | --- | --- | --- | --- |
//! | a tableau, or a pair | its own | equal | as its polynomial | its stages |
//! | Dormand-Prince 5 | 5 | by tolerance | as its polynomial | 6 |
//! | DOP853 | 8 | by tolerance | as its polynomial | 12 |
//! | Taylor series | by the tolerance | by tolerance | as its polynomial | one for each coefficient |
//! | implicit midpoint | 2 | equal | for every rate that decays, and every oscillation | 5 for the Jacobian, one for each iteration |
//! | Rodas3 | 3 | equal | for every rate that decays; what is infinitely fast is gone after a step | 7 |
//!
//! The baselines are here for the report alone: none can be selected on the live arm. The law `u = kp (q* - q) + kd
//! (q̇* - q̇)` acts at every instant. The coefficients of a tableau are data, so its loops are not unrolled as those of
//! the live arm are, and implicit methods solve their equations by elimination of any size.
//!
//! Source: Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I* (1993), ch. II.4, II.5 and II.10;
//! Hairer and Wanner, *Solving Ordinary Differential Equations II* (1996), ch. IV.3 and IV.7; for Rodas3, Sandu et al.,
//! *Atmospheric Environment* 31 (1997).
//!
//! **Invariant:** every evaluation is counted, those for Jacobians and for rejected steps too.

use std::sync::Arc;

use crate::math::arm::State;
use crate::math::count::{in_f64, length_in_f64};
use crate::math::dynamics::forward_dynamics;
use crate::math::integrator::{Method, moved};
use crate::math::simulation::add_carried;
use crate::study::beside::Steppable;
use crate::study::continuous::ContinuousLoop;
use crate::study::control_loop::ControlLoop;
use crate::study::matrix::Matrix;
use crate::study::method::named;
use crate::study::tableau::{Pair, Tableau, rows};
use crate::study::taylor::TaylorReference;

/// Most iterations of Newton's method in a step of the implicit midpoint rule.
const MAX_ITERATIONS: usize = 12;

/// A method of the live arm, or a baseline.
#[derive(Debug, Clone)]
pub enum Solver {
    /// One of the four.
    Fixed(Method),
    /// An explicit method in equal steps.
    Explicit(Arc<Explicit>),
    /// The same within this tolerance, relative and absolute, in steps of its choice.
    Adaptive(Arc<Explicit>, f64),
    /// Taylor series within this tolerance.
    Taylor(f64),
    /// `y + h f((y + y') / 2)`, solved by Newton's method.
    ImplicitMidpoint,
    /// A Rosenbrock method of four stages.
    Rodas3,
}

impl From<Method> for Solver {
    fn from(method: Method) -> Self {
        Self::Fixed(method)
    }
}

/// A run of a solver, step by step.
pub(super) trait TaskRun {
    /// Takes up to `steps` steps. Returns whether the state is still finite.
    fn advance(&mut self, steps: u64) -> bool;
    /// The joint angles \[rad\].
    fn place(&self) -> &[f64];
    /// The joint rates \[rad/s\].
    fn rates(&self) -> &[f64];
    /// Evaluations of the dynamics so far.
    fn evaluations(&self) -> u64;
    /// Steps taken, and the time \[s\], of a solver that chooses its steps.
    fn chosen(&self) -> Option<(u64, f64)> {
        None
    }
}

impl<const N: usize> TaskRun for Box<dyn Steppable<N>> {
    fn advance(&mut self, steps: u64) -> bool {
        (**self).advance(steps) == steps
    }

    fn place(&self) -> &[f64] {
        &self.state().position
    }

    fn rates(&self) -> &[f64] {
        &self.state().velocity
    }

    fn evaluations(&self) -> u64 {
        (**self).evaluations()
    }
}

/// An explicit method by its tableaus.
#[derive(Debug)]
pub struct Explicit {
    pair: Pair,
    /// Weights of its error estimates; none for a method in equal steps.
    errors: Vec<Vec<f64>>,
    /// The order of the estimate.
    order: f64,
    /// Whether the last stage of a step is the first one of the next.
    is_same_as_last: bool,
}

impl Explicit {
    /// A method for equal steps.
    pub fn new(pair: Pair) -> Self {
        let (a, b) = (pair.v().a(), pair.v().b());
        let is_last = |row: &Vec<f64>| b.strip_suffix(&[0.0]) == Some(row);
        Self {
            is_same_as_last: pair.is_runge_kutta() && a.last().is_some_and(is_last),
            pair,
            errors: Vec::new(),
            order: 0.0,
        }
    }

    /// Dormand and Prince's method of order 5, whose error is estimated to order 4.
    pub fn dormand_prince5() -> Option<Self> {
        let given = named("dormand_prince5")?;
        let weights = given.pair().v().b().iter().zip(given.embedded()?.v().b());
        Some(Self {
            errors: vec![weights.map(|(b, embedded)| b - embedded).collect()],
            order: 4.0,
            ..Self::new(given.pair().clone())
        })
    }

    /// Dormand and Prince's method of order 8. Its error is estimated to orders 5 and 3, which together have order 7.
    pub fn dop853() -> Option<Self> {
        let rows = rows(include_str!("dop853.txt"))?;
        let (a, [b, fifth, third]) = rows.split_last_chunk()?;
        Some(Self {
            errors: vec![fifth.clone(), third.clone()],
            order: 7.0,
            ..Self::new(Pair::same(Tableau::new(a, b).ok()?))
        })
    }
}

/// Positions and velocities, or their rates.
type Whole<const N: usize> = [[f64; N]; 2];

/// A run of a solver with this number of steps, before its first. One of the four methods takes the live arm's steps,
/// whose law holds its effort for a step.
pub(super) fn ready_as_live<const N: usize>(
    control: &ControlLoop<N>,
    start: State<N>,
    duration: f64,
    solver: Solver,
    steps: u64,
) -> Box<dyn TaskRun> {
    let Solver::Fixed(method) = solver else {
        return ready(control, start, duration, solver, steps);
    };
    let control = control.with_method(method);
    let live = control.with_timestep(duration / in_f64(steps));
    let live: Box<dyn Steppable<N>> = Box::new(live.simulation(start));
    Box::new(live)
}

/// The same with a law that acts at every instant.
pub(super) fn ready<const N: usize>(
    control: &ControlLoop<N>,
    start: State<N>,
    duration: f64,
    solver: Solver,
    steps: u64,
) -> Box<dyn TaskRun> {
    let h = duration / in_f64(steps);
    let control = control.with_timestep(h);
    let explicit = |method: Arc<Explicit>, tolerance: Option<f64>| {
        let stages = vec![[0.0; N]; method.pair.stages()];
        Box::new(ExplicitRun {
            control,
            duration,
            h: tolerance.map_or(h, |tolerance| tolerance.powf(1.0 / (method.order + 1.0))),
            tolerance,
            method,
            state: start,
            carry: State::rest(),
            rates: [stages.clone(), stages],
            first: 0,
            steps: 0,
            time: 0.0,
            evaluations: 0,
        })
    };
    let implicit = |step| {
        Box::new(Implicit {
            control,
            step,
            y: [start.position, start.velocity],
            evaluations: 0,
        })
    };
    match solver {
        Solver::Fixed(method) => {
            let run = ContinuousLoop::new(control.with_method(method), start, [0.0; N]);
            let run: Box<dyn Steppable<N>> = Box::new(run);
            Box::new(run)
        }
        Solver::Explicit(method) => explicit(method, None),
        Solver::Adaptive(method, tolerance) => explicit(method, Some(tolerance)),
        Solver::Taylor(tolerance) => Box::new(TaylorRun {
            control,
            duration,
            motion: TaylorReference::within(start, tolerance).begun(duration),
            left: duration,
            steps: 0,
        }),
        Solver::ImplicitMidpoint => implicit(Implicit::midpoint),
        Solver::Rodas3 => implicit(Implicit::rodas3),
    }
}

fn acceleration<const N: usize>(control: &ControlLoop<N>, q: &[f64; N], v: &[f64; N]) -> [f64; N] {
    let (gains, setpoint) = (&control.gains, &control.setpoint);
    let effort = |i: usize| {
        gains.kp[i] * (setpoint.position[i] - q[i]) + gains.kd[i] * (setpoint.velocity[i] - v[i])
    };
    forward_dynamics(&control.arm, q, v, &std::array::from_fn(effort))
}

/// The run of a tableau.
struct ExplicitRun<const N: usize> {
    control: ControlLoop<N>,
    duration: f64,
    method: Arc<Explicit>,
    /// None for equal steps.
    tolerance: Option<f64>,
    /// Length of the next step \[s\].
    h: f64,
    state: State<N>,
    /// The rounding error of the state, as in the live arm.
    carry: State<N>,
    /// The velocities and accelerations of the stages.
    rates: [Vec<[f64; N]>; 2],
    /// The first stage that is not known yet.
    first: usize,
    steps: u64,
    time: f64,
    evaluations: u64,
}

/// `h Σ weight · rate`.
fn combined<const N: usize>(h: f64, weights: &[f64], rates: &[[f64; N]]) -> [f64; N] {
    let pairs = weights.iter().zip(rates).filter(|it| *it.0 != 0.0);
    let sum = pairs.fold([0.0; N], |sum, (weight, rate)| moved(&sum, *weight, rate));
    sum.map(|sum| h * sum)
}

impl<const N: usize> ExplicitRun<N> {
    /// Evaluates the stages of a step of `h` \[s\].
    fn evaluate(&mut self, h: f64) {
        let (pair, [velocities, accelerations]) = (&self.method.pair, &mut self.rates);
        let State { position, velocity } = &self.state;
        for stage in self.first..pair.stages() {
            let change = combined(h, &pair.v().a()[stage], accelerations);
            velocities[stage] = moved(velocity, 1.0, &change);
            // The last stage of a method may serve its error estimate only.
            let is_in = |weights: &Vec<f64>| weights.get(stage).is_some_and(|it| *it != 0.0);
            if pair.evaluates(stage) || self.method.errors.iter().any(is_in) {
                let change = combined(h, &pair.q().a()[stage], velocities);
                let q = moved(position, 1.0, &change);
                accelerations[stage] = acceleration(&self.control, &q, &velocities[stage]);
                self.evaluations += 1;
            }
        }
    }

    /// The estimated error of a step of `h` \[s\] to `next`, in units of the tolerance: the root of the mean square of all
    /// positions and velocities.
    fn error(&self, h: f64, next: &State<N>, tolerance: f64) -> f64 {
        let pairs = |now: &[f64; N], next: &[f64; N]| -> [f64; N] {
            std::array::from_fn(|i| tolerance * (1.0 + now[i].abs().max(next[i].abs())))
        };
        let scales = [
            pairs(&self.state.position, &next.position),
            pairs(&self.state.velocity, &next.velocity),
        ];
        let squares = self.method.errors.iter().map(|weights| {
            let parts = self.rates.iter().zip(&scales).flat_map(|(rates, scale)| {
                let error = combined(h, weights, rates);
                std::array::from_fn::<f64, N, _>(|i| error[i] / scale[i])
            });
            parts.map(|part| part * part).sum::<f64>() / length_in_f64(2 * N)
        });
        match squares.collect::<Vec<_>>()[..] {
            [one] => one.sqrt(),
            // As in the code DOP853: the estimate of order 5, reduced if that of order 3 is larger.
            [fifth, third] if fifth > 0.0 => fifth / (fifth + 0.01 * third).sqrt(),
            _ => 0.0,
        }
    }

    /// Takes a step, or tries a longer one in vain. Returns whether the state is finite.
    fn step(&mut self) -> bool {
        let end = (self.time + self.h).min(self.duration);
        let h = self.tolerance.map_or(self.h, |_| end - self.time);
        self.evaluate(h);
        let (pair, [velocities, accelerations]) = (&self.method.pair, &self.rates);
        let dq = combined(h, pair.q().b(), velocities);
        let dv = combined(h, pair.v().b(), accelerations);
        let (next, carry) = add_carried(&self.state, &self.carry, &dq, &dv);
        if let Some(tolerance) = self.tolerance {
            let error = self.error(h, &next, tolerance);
            let power = -1.0 / (self.method.order + 1.0);
            self.h = h * (0.9 * error.powf(power)).clamp(0.2, 10.0);
            if error > 1.0 {
                self.first = 1;
                return true;
            }
        }
        if !next.is_finite() {
            return false;
        }
        (self.state, self.carry) = (next, carry);
        (self.time, self.steps, self.first) = (end, self.steps + 1, 0);
        if self.method.is_same_as_last {
            let [velocities, accelerations] = &mut self.rates;
            let last = velocities.len() - 1;
            (velocities[0], accelerations[0], self.first) =
                (velocities[last], accelerations[last], 1);
        }
        true
    }
}

impl<const N: usize> TaskRun for ExplicitRun<N> {
    fn advance(&mut self, steps: u64) -> bool {
        let is_over = |it: &Self| it.tolerance.is_some() && it.time >= it.duration;
        (0..steps).all(|_| is_over(self) || self.step())
    }

    fn place(&self) -> &[f64] {
        &self.state.position
    }

    fn rates(&self) -> &[f64] {
        &self.state.velocity
    }

    fn evaluations(&self) -> u64 {
        self.evaluations
    }

    fn chosen(&self) -> Option<(u64, f64)> {
        self.tolerance.map(|_| (self.steps, self.time))
    }
}

/// The run of Taylor series, of a free arm.
struct TaylorRun<const N: usize> {
    control: ControlLoop<N>,
    duration: f64,
    motion: TaylorReference<N>,
    /// The rest of the time \[s\].
    left: f64,
    steps: u64,
}

impl<const N: usize> TaskRun for TaylorRun<N> {
    fn advance(&mut self, steps: u64) -> bool {
        for _ in 0..steps {
            if self.left > 0.0 {
                self.left = self.motion.step(&self.control.arm, &[0.0; N]);
                self.steps += 1;
            }
        }
        self.motion.state().is_finite()
    }

    fn place(&self) -> &[f64] {
        &self.motion.state().position
    }

    fn rates(&self) -> &[f64] {
        &self.motion.state().velocity
    }

    fn evaluations(&self) -> u64 {
        self.motion.coefficients()
    }

    fn chosen(&self) -> Option<(u64, f64)> {
        Some((self.steps, self.duration - self.left))
    }
}

/// The run of an implicit method.
struct Implicit<const N: usize> {
    control: ControlLoop<N>,
    /// The change in a step; none where it can't be computed.
    step: fn(&mut Self) -> Option<Whole<N>>,
    y: Whole<N>,
    evaluations: u64,
}

impl<const N: usize> TaskRun for Implicit<N> {
    fn advance(&mut self, steps: u64) -> bool {
        (0..steps).all(|_| {
            let change = (self.step)(self).unwrap_or([[f64::NAN; N]; 2]);
            self.y = plus(&self.y, 1.0, &change);
            self.y.as_flattened().iter().all(|y| y.is_finite())
        })
    }

    fn place(&self) -> &[f64] {
        &self.y[0]
    }

    fn rates(&self) -> &[f64] {
        &self.y[1]
    }

    fn evaluations(&self) -> u64 {
        self.evaluations
    }
}

/// `y + factor · k`.
fn plus<const N: usize>(y: &Whole<N>, factor: f64, k: &Whole<N>) -> Whole<N> {
    std::array::from_fn(|part| moved(&y[part], factor, &k[part]))
}

/// The solution of `matrix · x = right`.
fn solved<const N: usize>(matrix: &Matrix, right: &Whole<N>) -> Option<Whole<N>> {
    let mut x = *right;
    x.as_flattened_mut()
        .copy_from_slice(&matrix.solve(right.as_flattened())?);
    Some(x)
}

impl<const N: usize> Implicit<N> {
    fn slope(&mut self, y: &Whole<N>) -> Whole<N> {
        self.evaluations += 1;
        let [q, v] = y;
        [*v, acceleration(&self.control, q, v)]
    }

    /// `f` at the present state, and `∂f/∂y` by differences.
    fn jacobian(&mut self) -> (Whole<N>, Matrix) {
        let y = self.y;
        let f = self.slope(&y);
        let mut jacobian = Matrix::zeros(2 * N);
        for (column, at) in y.as_flattened().iter().enumerate() {
            let mut near = y;
            let there = at + 1e-7 * (1.0 + at.abs());
            near.as_flattened_mut()[column] = there;
            let changes = plus(&self.slope(&near), -1.0, &f);
            for (row, change) in changes.as_flattened().iter().enumerate() {
                jacobian[(row, column)] = change / (there - at);
            }
        }
        (f, jacobian)
    }

    fn midpoint(&mut self) -> Option<Whole<N>> {
        let (y, h) = (self.y, self.control.timestep);
        let (mut k, jacobian) = self.jacobian();
        let newton = jacobian.scaled(-0.5 * h).plus_diagonal(1.0);
        for _ in 0..MAX_ITERATIONS {
            let f = self.slope(&plus(&y, 0.5 * h, &k));
            let change = solved(&newton, &plus(&f, -1.0, &k))?;
            k = plus(&k, 1.0, &change);
            let mut pairs = change.as_flattened().iter().zip(y.as_flattened());
            if pairs.all(|(change, y)| (h * change).abs() <= 1e-13 * (1.0 + y.abs())) {
                break;
            }
        }
        Some(k.map(|k| k.map(|k| h * k)))
    }

    /// In the form `(I/(γh) - J) k = f(y + …) + …/h`, γ = 1/2.
    fn rodas3(&mut self) -> Option<Whole<N>> {
        let (y, h) = (self.y, self.control.timestep);
        let (start, jacobian) = self.jacobian();
        let matrix = jacobian.scaled(-1.0).plus_diagonal(2.0 / h);
        let stage = |f: &Whole<N>, others: &Whole<N>| solved(&matrix, &plus(f, 1.0 / h, others));
        let k1 = stage(&start, &[[0.0; N]; 2])?;
        let k2 = stage(&start, &k1.map(|k| k.map(|k| 4.0 * k)))?;
        let f3 = self.slope(&plus(&y, 2.0, &k1));
        let apart = plus(&k1, -1.0, &k2);
        let k3 = stage(&f3, &apart)?;
        let change = plus(&k1.map(|k| k.map(|k| 2.0 * k)), 1.0, &k3);
        let f4 = self.slope(&plus(&y, 1.0, &change));
        let k4 = stage(&f4, &plus(&apart, -8.0 / 3.0, &k3))?;
        Some(plus(&change, 1.0, &k4))
    }
}

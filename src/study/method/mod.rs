//! What is known about a method of the reader: order, faults of its tableau, stability, and its cost on the arm.
//!
//! | result | from |
//! | --- | --- |
//! | order | the conditions of rooted trees, and a free swing of the arm against Taylor series |
//! | stability on the real axis | `v̇ = -v` |
//! | stability on the imaginary axis | `ẍ = -x` |
//! | region | `ẍ = -k x - d ẋ`, whose eigenvalues are `z` and its conjugate |
//! | symplectic | `b_i â_ij + b̂_j a_ji = b_i b̂_j`, for forces that depend on positions only |
//! | limit of the arm's sampled loop | [`super::held_loop`] |
//!
//! **Invariant:** the swing has at most 16 runs of at most [`MOST_STEPS`] steps in each part. A piece of the computation
//! takes about a millisecond.

mod given;
mod named;
mod swing;
mod trees;

use self::given::faults;
pub use self::given::{Given, MethodError, Typed};
pub use self::named::{NAMES, named};
pub use self::swing::{ALLOWED_ERROR, MOST_STEPS, SWING, Swing, measure};
pub use self::trees::MAX_ORDER;
use super::control_loop::ControlLoop;
use super::equilibrium::{equilibrium, gravity_gradient};
use super::held_loop::{Between, Given as Robot, HeldLoop, held_limit};
use super::matrix::Matrix;
use super::paused::pause;
use super::stability::{Modes, first_unstable, growth};
use super::tableau::{Pair, Tableau};
use crate::math::arm::Arm;
use crate::math::dynamics::mass_matrix;
use crate::math::integrator::Method;

/// Largest error of a term of a polynomial or a product, within the digits of a typed coefficient.
const TOLERANCE: f64 = 1e-10;

/// Columns and rows of the picture of the region.
const PICTURE: (usize, usize) = (48, 24);

/// What is known about a method.
#[derive(Debug, Clone, PartialEq)]
pub struct Analysis {
    /// Number of stages.
    pub stages: usize,
    /// Accelerations that a step evaluates.
    pub evaluations: usize,
    /// The order by the conditions of trees, at most [`MAX_ORDER`].
    pub order: u32,
    /// The first condition that fails, in words.
    pub failing: Option<String>,
    /// The order of the embedded method.
    pub embedded_order: Option<u32>,
    /// Sums that are inconsistent, in words.
    pub faults: Vec<String>,
    /// The largest `x` with stability on `[-x, 0]`; `None` if it exceeds the search, 30.
    pub real_limit: Option<f64>,
    /// The largest `y` with stability on `[-iy, iy]`; `None` if it exceeds the search, 30.
    pub imaginary_limit: Option<f64>,
    /// Whether it is symplectic, for a constant mass matrix and forces that depend on positions only.
    pub is_symplectic: bool,
    /// The region of stability.
    pub region: Region,
    /// The largest timestep of the arm's loop if the law runs once in a step \[s\].
    pub timestep_limit_held: Option<f64>,
    /// The same at the control period of the loop: a whole part of it. Zero: none was found.
    pub timestep_limit: Option<f64>,
    /// The method on a free swing of the arm.
    pub swing: Swing,
}

/// The upper half of the region of stability, drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// The left end, the right end and the upper end. The lower end is 0.
    pub extent: [f64; 3],
    /// Rows from the top: `#` where no mode grows, `.` elsewhere.
    pub rows: Vec<String>,
}

/// Analyses a method, on the arm and the gains of a loop.
pub async fn analyse<const N: usize>(given: Given, control: ControlLoop<N>) -> Analysis {
    let pair = &given.pair;
    let found = trees::order(pair);
    let real_limit = real_limit(pair.v()).await;
    let imaginary_limit = imaginary_limit(pair).await;
    let reach = [real_limit, imaginary_limit].map(|it| it.unwrap_or(30.0));
    let (held, at_period) = loop_limits(&control, pair).await;
    Analysis {
        stages: pair.stages(),
        evaluations: pair.evaluations(),
        order: found.order,
        failing: found.failing,
        embedded_order: given.embedded.as_ref().map(|it| trees::order(it).order),
        faults: faults(&given),
        real_limit,
        imaginary_limit,
        is_symplectic: is_symplectic(pair),
        region: region(pair, reach).await,
        timestep_limit_held: held,
        timestep_limit: at_period,
        swing: measure(pair, &control.arm).await,
    }
}

/// The same swing with each of the live arm's methods, in the order of [`Method::ALL`].
pub async fn swings<const N: usize>(arm: &Arm<N>) -> [Swing; 4] {
    let mut found = [Swing::default(); 4];
    for (swing, method) in found.iter_mut().zip(Method::ALL) {
        *swing = measure(&Pair::of(method), arm).await;
    }
    found
}

fn is_symplectic(pair: &Pair) -> bool {
    let (q, v) = (pair.q(), pair.v());
    let entry = |of: &Tableau, i: usize, j: usize| {
        of.a()
            .get(i)
            .and_then(|row| row.get(j))
            .copied()
            .unwrap_or(0.0)
    };
    (0..pair.stages()).all(|i| {
        (0..pair.stages()).all(|j| {
            let (b, hat) = (q.b()[i], v.b()[j]);
            (b * entry(v, i, j) + hat * entry(q, j, i) - b * hat).abs() <= TOLERANCE
        })
    })
}

// ---- stability ------------------------------------------------------------------------------------------------------

/// The coefficients of the stability polynomial `R(z)` of one tableau, from `z⁰`.
pub fn stability_polynomial(tableau: &Tableau) -> Vec<f64> {
    let mut stages = vec![1.0; tableau.b().len()];
    let mut polynomial = vec![1.0];
    for _ in tableau.b() {
        polynomial.push(tableau.b().iter().zip(&stages).map(|(b, it)| b * it).sum());
        let next = |row: &Vec<f64>| row.iter().zip(&stages).map(|(a, it)| a * it).sum();
        stages = tableau.a().iter().map(next).collect();
    }
    polynomial
}

/// `R²` on the real axis, or `|R|²` on the imaginary one, less 1: coefficients from the first power.
fn excess(polynomial: &[f64], is_imaginary: bool) -> Vec<f64> {
    let mut product = vec![0.0; 2 * polynomial.len() - 1];
    for (i, one) in polynomial.iter().enumerate() {
        for (j, other) in polynomial.iter().enumerate() {
            // On the real axis the argument is -x. On the imaginary one the factors are iʲ and its conjugate.
            let sign = match (is_imaginary, (i + j) % 2, (i + 3 * j) % 4) {
                (false, 0, _) | (true, 0, 0) => 1.0,
                (true, 1, _) => 0.0,
                _ => -1.0,
            };
            product[i + j] += sign * one * other;
        }
    }
    product.remove(0);
    // A power that should vanish does so only within rounding error.
    let rounded = |it: f64| if it.abs() <= TOLERANCE { 0.0 } else { it };
    product.into_iter().map(rounded).collect()
}

/// The first length at which a polynomial from [`excess`] is positive.
async fn first_growth(excess: Vec<f64>, flow: Matrix) -> Option<f64> {
    let lowest = excess.iter().position(|it| *it != 0.0)?;
    let scaled = |x: f64| {
        excess[lowest..]
            .iter()
            .rev()
            .fold(0.0, |sum, it| sum * x + it)
    };
    first_unstable(&Modes::of_flow(&flow), scaled).await
}

async fn real_limit(tableau: &Tableau) -> Option<f64> {
    let flow = Matrix::from_fn(1, |_, _| -1.0);
    first_growth(excess(&stability_polynomial(tableau), false), flow).await
}

async fn imaginary_limit(pair: &Pair) -> Option<f64> {
    let flow = Matrix::from_fn(2, |i, j| [[0.0, 1.0], [-1.0, 0.0]][i][j]);
    if pair.is_runge_kutta() {
        first_growth(excess(&stability_polynomial(pair.v()), true), flow).await
    } else {
        let grows = |h: f64| growth(&step(pair, h, 1.0, 0.0), h, || 0);
        first_unstable(&Modes::of_flow(&flow), grows).await
    }
}

/// `E` of `x ↦ (I + h E) x` for `ẍ = -k x - d ẋ`.
fn step(pair: &Pair, h: f64, k: f64, d: f64) -> Matrix {
    let columns = [[1.0, 0.0], [0.0, 1.0]].map(|[x, v]| {
        let (dx, dv) = pair.increment(h, &[v], |dx, v| vec![-k * (x + dx[0]) - d * v[0]]);
        [dx[0] / h, dv[0] / h]
    });
    Matrix::from_fn(2, |i, j| columns[j][i])
}

/// The largest factor by which a step of 1 changes a mode with the eigenvalues `re ± i im`.
pub fn amplification(pair: &Pair, re: f64, im: f64) -> f64 {
    let square = re * re + im * im;
    step(pair, 1.0, square, -2.0 * re)
        .plus_diagonal(1.0)
        .spectral_radius()
}

async fn region(pair: &Pair, [real, imaginary]: [f64; 2]) -> Region {
    let (columns, rows) = PICTURE;
    let (left, top) = (
        1.2 * real.max(1.0),
        1.2 * imaginary.max(real / 2.0).max(1.0),
    );
    let (right, pixel) = (0.2 * left, |i: usize, of: usize| {
        (i as f64 + 0.5) / of as f64
    });
    let line = |row: usize| {
        let im = top * (1.0 - pixel(row, rows));
        let at = |column: usize| (left + right) * pixel(column, columns) - left;
        let is_stable = |column: usize| amplification(pair, at(column), im) <= 1.0;
        (0..columns)
            .map(|it| if is_stable(it) { '#' } else { '.' })
            .collect()
    };
    let mut lines = Vec::new();
    for row in 0..rows {
        lines.push(line(row));
        pause().await;
    }
    Region {
        extent: [-left, right, top],
        rows: lines,
    }
}

// ---- the arm's loop -------------------------------------------------------------------------------------------------

/// The largest timesteps of the arm's loop \[s\]: if the law runs in every step, and at the control period of the loop.
pub(super) async fn loop_limits<const N: usize>(
    control: &ControlLoop<N>,
    pair: &Pair,
) -> (Option<f64>, Option<f64>) {
    let Ok(held) = HeldLoop::try_from(&robot(control, pair)) else {
        return (None, None);
    };
    let period = Some(control.given_period()).filter(|it| *it > 0.0);
    let found = held_limit(held, period).await;
    let at = found.at.map(|at| at.timestep_limit);
    (found.period_limit, at.unwrap_or(found.period_limit))
}

/// The arm at the equilibrium of its loop, with the method as its motion between two runs of the law.
fn robot<const N: usize>(control: &ControlLoop<N>, pair: &Pair) -> Robot {
    let ControlLoop { arm, gains, .. } = control;
    let rest = equilibrium(control);
    let mass = |arm: &Arm<N>| {
        mass_matrix(arm, &rest.position)
            .map(|row| row.to_vec())
            .to_vec()
    };
    let gradient = gravity_gradient(arm, &rest.position);
    let row = |i: usize| (0..N).map(|j| gradient[i.max(j)]).collect();
    let ki = (0..N).map(|i| {
        if rest.integrating[i] {
            gains.ki[i]
        } else {
            0.0
        }
    });
    Robot {
        mass: mass(arm),
        kp: vec![gains.kp.to_vec()],
        kd: vec![gains.kd.to_vec()],
        ki: vec![ki.collect()],
        damping: vec![arm.viscous().to_vec()],
        stiffness: (0..N).map(row).collect(),
        delay: u64::from(control.period.delay),
        between: Between::Explicit(Box::new(pair.clone())),
        steps: 1,
    }
}

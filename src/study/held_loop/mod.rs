//! The sampled control loop of any robot near a pose: the largest stable control period, and what would raise it.
//!
//! Near a pose the robot is `M v̇ = u - D v - K x`. Once in a period `T` the law samples positions and velocities and
//! holds `u = -Kp x - Kd v + Ki s`, with `s ↦ s - T x` before it is used. The effort acts at once, or some whole periods
//! late. No mode grows as long as the eigenvalues of the matrix of a period stay within the unit circle. The search is
//! that of the arm's own limits, [`super::stability`], up to 30 time constants of the slowest mode.
//!
//! | between two runs of the law | one step of `h` |
//! | --- | --- |
//! | exact | the solution under a constant effort |
//! | an explicit method | the method, by its tableaus |
//! | implicit in velocity | `(M + h D) Δv = h (u - D v - K x)`, then `Δx = h (v + Δv)` |
//!
//! The last one is `MuJoCo`'s: `implicitfast`, and `Euler`, which is implicit in the damping of joints. Without damping it
//! is semi-implicit Euler. With exact motion and without `K`, `D`, `Ki` and delay, a joint reverses at every period from
//! `T = 2 λmin(Kd⁻¹ M)` on.
//!
//! Internally the unit of time is the period, and the coordinates are those in which `M` is the identity.
//!
//! **Invariant:** the number of states and the number of evaluations are bounded. Growth below 1e-11 of the fastest rate
//! does not count.

mod answer;
mod given;

pub use self::answer::{AtPeriod, CriticalMode, HeldLimit, held_limit};
pub use self::given::{Given, HeldError, MAX_DELAY, MAX_JOINTS, MAX_STATES, MAX_STEPS};
use super::linear::fed_back;
use super::matrix::Matrix;
use super::stability::{Modes, growth, repeated, runge_kutta};
use super::tableau::Pair;

/// Terms of the exponential series, and the largest norm for which it is summed: the rest is below rounding.
const EXACT_TERMS: u32 = 14;
const EXACT_NORM: f64 = 0.5;

/// The motion between two runs of the law.
#[derive(Debug, Clone, PartialEq)]
pub enum Between {
    /// The exact solution.
    Exact,
    /// An explicit method.
    Explicit(Box<Pair>),
    /// Semi-implicit Euler, implicit in the velocity of `D v`.
    Implicit,
}

impl Between {
    /// The names of the motions.
    pub const NAMES: [&str; 7] = [
        "exact",
        "semi_implicit",
        "implicit",
        "euler",
        "midpoint",
        "verlet",
        "rk4",
    ];

    /// The motion of one of the [`Between::NAMES`].
    pub fn named(name: &str) -> Option<Self> {
        let explicit = |pair| Some(Self::Explicit(Box::new(pair)));
        match name {
            "exact" => Some(Self::Exact),
            "implicit" => Some(Self::Implicit),
            "semi_implicit" => explicit(Pair::semi_implicit()),
            _ => explicit(Pair::of(name.parse().ok()?)),
        }
    }
}

/// A robot near a pose, under its law.
#[derive(Debug, Clone)]
pub struct HeldLoop {
    joints: Matrices,
    /// The joints' positions by coordinates in which the mass matrix is the identity, so that it cannot spoil digits.
    axes: Matrix,
    /// The same in those coordinates, except that integrals stay with their joints.
    scaled: Matrices,
    /// Effect of the integrals of the joints.
    integral_gains: Matrix,
    /// The joints that have an integral.
    integrals: Vec<usize>,
    /// Whole periods by which an effort is late.
    delay: u8,
    between: Between,
    /// Steps of the method in a period.
    steps: u32,
}

/// The matrices of a robot and its law.
#[derive(Debug, Clone)]
struct Matrices {
    mass: Matrix,
    kp: Matrix,
    kd: Matrix,
    ki: Matrix,
    damping: Matrix,
    stiffness: Matrix,
}

impl Matrices {
    fn map(&self, change: impl Fn(&Matrix) -> Matrix) -> Self {
        Self {
            mass: change(&self.mass),
            kp: change(&self.kp),
            kd: change(&self.kd),
            ki: change(&self.ki),
            damping: change(&self.damping),
            stiffness: change(&self.stiffness),
        }
    }
}

fn transposed(matrix: &Matrix) -> Matrix {
    Matrix::from_fn(matrix.size(), |i, j| matrix[(j, i)])
}

impl HeldLoop {
    /// A loop without delay, with exact motion; or the joint at which the mass matrix is not positive definite.
    fn new(joints: Matrices) -> Result<Self, usize> {
        let n = joints.mass.size();
        let holds = |&j: &usize| {
            let rows = 0..n;
            let matrices = [&joints.kp, &joints.ki, &joints.stiffness];
            rows.flat_map(|i| matrices.map(|it| it[(i, j)]))
                .any(|it| it != 0.0)
        };
        // Joints that only drift come first. Their coordinates then have no effect on others, which keeps their
        // eigenvalue of 0 exact.
        let (held, mut order): (Vec<usize>, Vec<usize>) = (0..n).partition(holds);
        order.extend(held);
        let ordered = Matrix::from_fn(n, |i, j| joints.mass[(order[i], order[j])]);
        let inverse = inverse_of_factor(&ordered).map_err(|i| order[i])?;
        let mut axes = Matrix::zeros(n);
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            axes[(order[i], j)] = inverse[(j, i)];
        }
        let across = transposed(&axes);
        let integrates = |&j: &usize| (0..n).any(|i| joints.ki[(i, j)] != 0.0);
        Ok(Self {
            scaled: joints.map(|matrix| across.product(&matrix.product(&axes))),
            integral_gains: across.product(&joints.ki),
            integrals: (0..n).filter(integrates).collect(),
            axes,
            joints,
            delay: 0,
            between: Between::Exact,
            steps: 1,
        })
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.axes.size()
    }

    /// Number of states: positions, velocities, efforts on their way, integrals.
    pub fn states(&self) -> usize {
        (2 + usize::from(self.delay)) * self.joints() + self.integrals.len()
    }

    /// The same loop with another number of steps in a period.
    #[must_use]
    fn with_steps(&self, steps: u32) -> Self {
        Self {
            steps,
            ..self.clone()
        }
    }

    /// The same loop with `kd` multiplied by a factor.
    #[must_use]
    fn with_damping_gain(&self, factor: f64) -> Self {
        let mut changed = self.clone();
        for kd in [&mut changed.scaled.kd, &mut changed.joints.kd] {
            *kd = kd.clone().scaled(factor);
        }
        changed
    }

    /// The same loop with an inertia \[kg m²\] added to those `joints`; `None` if the sum has no digits left.
    #[must_use]
    fn with_armature(&self, joints: &[usize], inertia: f64) -> Option<Self> {
        let mut heavier = self.joints.clone();
        joints.iter().for_each(|&j| heavier.mass[(j, j)] += inertia);
        let changed = Self::new(heavier).ok()?;
        Some(Self {
            delay: self.delay,
            between: self.between.clone(),
            steps: self.steps,
            ..changed
        })
    }

    /// The inertia \[kg m²\] that a joint moves while the others are free.
    pub fn effective_inertia(&self, joint: usize) -> f64 {
        let row = (0..self.joints()).map(|k| self.axes[(joint, k)]);
        1.0 / row.map(|it| it * it).sum::<f64>()
    }

    /// The loop in continuous time; `x` holds positions, velocities, integrals.
    fn modes(&self) -> Modes {
        let n = self.joints();
        let mut flow = Matrix::zeros(2 * n + self.integrals.len());
        let of = &self.scaled;
        for i in 0..n {
            flow[(i, n + i)] = 1.0;
            for j in 0..n {
                flow[(n + i, j)] = -of.stiffness[(i, j)] - of.kp[(i, j)];
                flow[(n + i, n + j)] = -of.damping[(i, j)] - of.kd[(i, j)];
            }
            for (k, &joint) in self.integrals.iter().enumerate() {
                flow[(n + i, 2 * n + k)] = self.integral_gains[(i, joint)];
                flow[(2 * n + k, i)] = -self.axes[(joint, i)];
            }
        }
        Modes::of_flow(&flow)
    }

    /// `E` of the robot alone, `x ↦ (I + E) x` in one period under constant efforts; `x` holds positions, velocities and
    /// efforts in the units of the `period` \[s\].
    fn plant(&self, period: f64) -> Matrix {
        let n = self.joints();
        let damping = self.scaled.damping.clone().scaled(period);
        let stiffness = self.scaled.stiffness.clone().scaled(period * period);
        let h = 1.0 / f64::from(self.steps);
        let unit = |is_one: bool| f64::from(u8::from(is_one));
        // The rates of velocities, and those of positions, from blocks of their columns.
        let filled = |rate: &dyn Fn(usize, usize) -> f64| {
            Matrix::from_fn(
                3 * n,
                |row, column| if row < 2 * n { rate(row, column) } else { 0.0 },
            )
        };
        let force = |i: usize, column: usize| match (column / n, column % n) {
            (0, j) => -stiffness[(i, j)],
            (1, j) => -damping[(i, j)],
            (_, j) => unit(i == j),
        };
        let flow = |row: usize, column: usize| match row.checked_sub(n) {
            None => unit(column == row + n),
            Some(i) => force(i, column),
        };
        match &self.between {
            Between::Exact => {
                let flow = filled(&flow);
                let sums = (0..2 * n).map(|i| (0..3 * n).map(|j| flow[(i, j)].abs()).sum::<f64>());
                let (mut pieces, norm) = (1_u32, sums.fold(1.0, f64::max));
                while pieces < 1 << 31 && norm > EXACT_NORM * f64::from(pieces) {
                    pieces *= 2;
                }
                let h = 1.0 / f64::from(pieces);
                repeated(&runge_kutta(&flow, EXACT_TERMS, h), h, pieces)
            }
            Between::Explicit(pair) => {
                let (dq, dv) = explicit_step(pair, h, &stiffness, &damping);
                let step = filled(&|row, column| match row.checked_sub(n) {
                    None => dq[row * 3 * n + column] / h,
                    Some(i) => dv[i * 3 * n + column] / h,
                });
                repeated(&step, h, self.steps)
            }
            Between::Implicit => {
                let mass = damping.clone().scaled(h).plus_diagonal(1.0);
                let Some(inverse) = mass.inverse() else {
                    return Matrix::from_fn(3 * n, |_, _| f64::NAN);
                };
                let change = |i: usize, column: usize| -> f64 {
                    (0..n).map(|k| inverse[(i, k)] * force(k, column)).sum()
                };
                let step = filled(&|row, column| match row.checked_sub(n) {
                    None => unit(column == row + n) + h * change(row, column),
                    Some(i) => change(i, column),
                });
                repeated(&step, h, self.steps)
            }
        }
    }

    /// `E` of the loop, `x ↦ (I + E) x` in one period \[s\]. The states are positions, velocities, efforts on their way
    /// with the next one first, and integrals, in the units of the period.
    pub fn generator(&self, period: f64) -> Matrix {
        let (n, plant) = (self.joints(), self.plant(period));
        let integrals = self.states() - self.integrals.len();
        let kp = self.scaled.kp.clone().plus(period, &self.scaled.ki);
        let kp = kp.scaled(period * period);
        let kd = self.scaled.kd.clone().scaled(period);
        let cube = period * period * period;
        // The effort of joint j, by the states.
        let mut law = Matrix::zeros(self.states());
        for (j, i) in (0..n).flat_map(|j| (0..n).map(move |i| (j, i))) {
            law[(j, i)] = -kp[(j, i)];
            law[(j, n + i)] = -kd[(j, i)];
        }
        for (j, (k, &joint)) in
            (0..n).flat_map(|j| self.integrals.iter().enumerate().map(move |it| (j, it)))
        {
            law[(j, integrals + k)] = cube * self.integral_gains[(j, joint)];
        }
        let mut closed = fed_back(&plant, &law, self.delay, 1.0);
        for (k, &joint) in self.integrals.iter().enumerate() {
            for i in 0..n {
                closed[(integrals + k, i)] = -self.axes[(joint, i)];
            }
        }
        closed
    }

    /// Fastest growth of any mode, relative to the fastest change.
    fn growth(&self, period: f64) -> f64 {
        growth(&self.generator(period), 1.0, || 0)
    }

    /// Periods by which a held effort lags behind the law's sample, where the motion is slow against a period: half a
    /// period with exact motion.
    fn lag(&self) -> f64 {
        let one = Self {
            scaled: self.scaled.map(|_| Matrix::zeros(1)),
            axes: Matrix::zeros(1),
            ..self.clone()
        };
        f64::from(self.delay) + 1.0 - one.plant(1.0)[(0, 2)]
    }
}

/// The changes of positions and velocities in a step of a method: rows of n joints, columns of 3 n states.
fn explicit_step(
    pair: &Pair,
    h: f64,
    stiffness: &Matrix,
    damping: &Matrix,
) -> (Vec<f64>, Vec<f64>) {
    let n = stiffness.size();
    let columns = 3 * n;
    // One row for each joint: its position, velocity or effort at the start of the step.
    let start = |block: usize| {
        let mut rows = vec![0.0; n * columns];
        let own = rows.iter_mut().skip(block * n).step_by(columns + 1);
        own.take(n).for_each(|it| *it = 1.0);
        rows
    };
    let (x, efforts) = (start(0), start(2));
    pair.increment(h, &start(1), |dq, v| {
        let mut rates = efforts.clone();
        for (i, row) in rates.chunks_exact_mut(columns).enumerate() {
            for k in 0..n {
                let (held, slowed) = (stiffness[(i, k)], damping[(i, k)]);
                if held == 0.0 && slowed == 0.0 {
                    continue;
                }
                for (rate, at) in row.iter_mut().zip(k * columns..) {
                    *rate -= held * (x[at] + dq[at]) + slowed * v[at];
                }
            }
        }
        rates
    })
}

/// The inverse of the lower factor of a Cholesky factorisation, or the row at which it fails.
fn inverse_of_factor(mass: &Matrix) -> Result<Matrix, usize> {
    let n = mass.size();
    let (mut lower, mut inverse) = (Matrix::zeros(n), Matrix::zeros(n));
    for i in 0..n {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| lower[(i, k)] * lower[(j, k)]).sum();
            let rest = mass[(i, j)] - known;
            if i > j {
                lower[(i, j)] = rest / lower[(j, j)];
            } else if rest > f64::EPSILON * mass[(i, i)] {
                lower[(i, i)] = rest.sqrt();
            } else {
                return Err(i);
            }
        }
        for j in 0..=i {
            let known: f64 = (j..i).map(|k| lower[(i, k)] * inverse[(k, j)]).sum();
            let unit = if i == j { 1.0 } else { 0.0 };
            inverse[(i, j)] = (unit - known) / lower[(i, i)];
        }
    }
    Ok(inverse)
}

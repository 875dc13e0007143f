//! The motion of an arm as a power series in time, coefficient by coefficient.
//!
//! In the angles of the links to the horizontal, `φ_i = q_1 + … + q_i`, the equation of motion is
//!
//! `Σ_j K_ij (cos(φ_i - φ_j) φ̈_j + sin(φ_i - φ_j) φ̇_j²) + W_i cos φ_i = τ_i - τ_{i+1}`
//!
//! Sine and cosine of an angle cost one recurrence each, `s' = c φ'` and `c' = -s φ'`, products of series are
//! convolutions, and the accelerations' coefficients solve one linear system after the other, always with the same
//! matrix. The first of them comes from the arm's own kernel, which loses fewer digits. Known limit: a last link of
//! a billion times the mass of the two that it folds costs a digit or two beyond those that its start can't tell.
//!
//! Source: Jorba and Zou, *A software package for the numerical integration of ODEs by means of high-order Taylor
//! methods*, Experimental Mathematics 14 (2005).
//!
//! **Invariant:** it uses sums, products, quotients and square roots alone, so that every machine gives the same bits.

#![allow(
    clippy::indexing_slicing,
    clippy::needless_range_loop,
    reason = "indices run over 0..N, and over the coefficients computed so far, as they do in the recurrences"
)]

use crate::math::arm::{Arm, State};
use crate::math::count::length_in_f64;
use crate::math::dynamics::forward_dynamics;
use crate::math::trig;

/// Highest order of the rates.
pub(super) const ORDER: usize = 22;

/// Coefficients of as many series as there are links.
type PerLink<const N: usize> = [[f64; N]; ORDER + 1];

/// Coefficients of a series for each two links: at `[d][i]` that of links `i` and `i - d`, or of link `i` alone for
/// `d = 0`.
type PerPair<const N: usize> = [[[f64; N]; N]; ORDER];

/// Where the coefficient of an order stands in a series that is kept backwards, so that both factors of a convolution
/// are read forwards.
const fn backwards(order: usize) -> usize {
    ORDER - 1 - order
}

/// Series of the angles of the links \[rad\], their rates \[rad/s\], and what they are computed from.
#[derive(Debug, Clone)]
pub(super) struct PowerSeries<const N: usize> {
    /// Order up to which rates are known.
    order: usize,
    pub(super) angle: PerLink<N>,
    pub(super) rate: PerLink<N>,
    /// Accelerations and squared rates, backwards.
    acceleration: [[f64; N]; ORDER],
    squared_rate: [[f64; N]; ORDER],
    /// Sine and cosine of the angle from one link to the other, and its rate, backwards.
    sin: PerPair<N>,
    cos: PerPair<N>,
    turning: PerPair<N>,
    equation: Equation<N>,
}

/// The constants of the equation of motion, and its matrix where the series begins.
#[derive(Debug, Clone)]
struct Equation<const N: usize> {
    /// At `[d][i]` the `K_ij` of links `i` and `i - d` \[kg m²\]; `W_i` \[N m\] for `d = 0`.
    factors: [[f64; N]; N],
    /// The matrix where the series begins, eliminated: inverse pivots on the diagonal, multipliers above it.
    eliminated: [[f64; N]; N],
}

impl<const N: usize> PowerSeries<N> {
    pub(super) fn new() -> Self {
        Self {
            order: 0,
            angle: [[0.0; N]; ORDER + 1],
            rate: [[0.0; N]; ORDER + 1],
            acceleration: [[0.0; N]; ORDER],
            squared_rate: [[0.0; N]; ORDER],
            sin: [[[0.0; N]; N]; ORDER],
            cos: [[[0.0; N]; N]; ORDER],
            turning: [[[0.0; N]; N]; ORDER],
            equation: Equation {
                factors: [[0.0; N]; N],
                eliminated: [[0.0; N]; N],
            },
        }
    }

    /// Order up to which rates are known.
    pub(super) fn order(&self) -> usize {
        self.order
    }

    /// The series about a state under constant efforts \[N m\]: rates up to order 1, angles of order 0 left out.
    pub(super) fn begin(&mut self, arm: &Arm<N>, state: &State<N>, effort: &[f64; N]) {
        let State { position, velocity } = state;
        let (sin, cos) = trig::sin_cos(position);
        for i in 0..N {
            // The joints between two links turn one into the other: no angle is summed, and none loses digits.
            let (mut s, mut c) = (sin[i], cos[i]);
            for d in 1..=i {
                (self.sin[0][d][i], self.cos[0][d][i]) = (s, c);
                let j = i - d;
                (s, c) = (s * cos[j] + c * sin[j], c * cos[j] - s * sin[j]);
            }
            (self.sin[0][0][i], self.cos[0][0][i]) = (s, c);
        }
        self.equation.set(arm, &self.cos[0]);
        self.rate[0] = sums(velocity);
        self.squared_rate[backwards(0)] = self.rate[0].map(|rate| rate * rate);
        let acceleration = forward_dynamics(arm, position, velocity, effort);
        self.close(0, sums(&acceleration));
    }

    /// Computes the rates of the next order.
    #[inline]
    pub(super) fn extend(&mut self) {
        let k = self.order;
        let zero = [[0.0; N]; N];
        // Sums for sines, cosines and squares, and for what a link does to one farther out, and to one farther in.
        let (mut sine, mut cosine, mut square) = (zero, zero, [0.0; N]);
        let (mut pull, mut push) = ((zero, zero), (zero, zero));
        {
            let (sin, cos, rate) = (&self.sin[..k], &self.cos[..k], &self.rate[1..=k]);
            let turning = &self.turning[backwards(k - 1)..][..k];
            let squared = &self.squared_rate[backwards(k)..][..k];
            let acceleration = &self.acceleration[backwards(k)..][..k];
            for m in 0..k {
                for d in 0..N {
                    for i in d..N {
                        sine[d][i] += turning[m][d][i] * cos[m][d][i];
                        cosine[d][i] += turning[m][d][i] * sin[m][d][i];
                    }
                }
                for i in 0..N {
                    square[i] += turning[m][0][i] * rate[m][i];
                }
                if m > 0 {
                    for d in 1..N {
                        for i in d..N {
                            pull.0[d][i] += sin[m][d][i] * squared[m][i - d];
                            pull.1[d][i] += cos[m][d][i] * acceleration[m][i - d];
                            push.0[d][i] += sin[m][d][i] * squared[m][i];
                            push.1[d][i] += cos[m][d][i] * acceleration[m][i];
                        }
                    }
                }
            }
        }
        let per_k = 1.0 / length_in_f64(k);
        let (first_square, first) = (
            self.squared_rate[backwards(0)],
            self.acceleration[backwards(0)],
        );
        let mut right = [0.0; N];
        for i in 0..N {
            square[i] += self.rate[0][i] * self.rate[k][i];
        }
        self.squared_rate[backwards(k)] = square;
        for d in 0..N {
            for i in d..N {
                let (sin, cos) = (sine[d][i] * per_k, -(cosine[d][i] * per_k));
                (self.sin[k][d][i], self.cos[k][d][i]) = (sin, cos);
                let factor = self.equation.factors[d][i];
                if d == 0 {
                    right[i] -= factor * cos;
                } else {
                    let (j, at_start) = (i - d, self.sin[0][d][i]);
                    let across = pull.0[d][i] + (at_start * square[j] + sin * first_square[j]);
                    right[i] -= factor * (across + (pull.1[d][i] + cos * first[j]));
                    let across = push.0[d][i] + (at_start * square[i] + sin * first_square[i]);
                    right[j] -= factor * ((push.1[d][i] + cos * first[i]) - across);
                }
            }
        }
        let acceleration = self.equation.solve(right);
        self.close(k, acceleration);
    }

    /// Keeps the accelerations of order `k`, and what follows from them.
    #[inline(always)]
    fn close(&mut self, k: usize, acceleration: [f64; N]) {
        self.acceleration[backwards(k)] = acceleration;
        let next = 1.0 / length_in_f64(k + 1);
        let rate = self.rate[k];
        self.angle[k + 1] = rate.map(|rate| rate * next);
        self.rate[k + 1] = acceleration.map(|acceleration| acceleration * next);
        let turning = &mut self.turning[backwards(k)];
        for d in 0..N {
            for i in d..N {
                turning[d][i] = if d == 0 {
                    rate[i]
                } else {
                    rate[i] - rate[i - d]
                };
            }
        }
        self.order = k + 1;
    }

    /// By how much positions and velocities of the joints change in a time \[s\].
    pub(super) fn change(&self, time: f64) -> ([f64; N], [f64; N]) {
        let change = |series: &PerLink<N>, order: usize| {
            let mut value = series[order];
            for coefficient in series[1..order].iter().rev() {
                for i in 0..N {
                    value[i] = value[i] * time + coefficient[i];
                }
            }
            differences(&value.map(|value| value * time))
        };
        (
            change(&self.angle, self.order),
            change(&self.rate, self.order),
        )
    }
}

impl<const N: usize> Equation<N> {
    fn set(&mut self, arm: &Arm<N>, cos: &[[f64; N]; N]) {
        let (l, m) = (arm.lengths(), arm.masses());
        let mut beyond = 0.0;
        let matrix = &mut self.eliminated;
        for i in (0..N).rev() {
            let (first, second) = (m[i] / 2.0 + beyond, m[i] / 3.0 + beyond);
            for j in 0..i {
                let coupling = first * l[i] * l[j];
                self.factors[i - j][i] = coupling;
                matrix[i][j] = coupling * cos[i - j][i];
            }
            self.factors[0][i] = arm.gravity() * first * l[i];
            matrix[i][i] = second * l[i] * l[i];
            beyond += m[i];
        }
        for pivot in 0..N {
            matrix[pivot][pivot] = 1.0 / matrix[pivot][pivot];
            for row in pivot + 1..N {
                let factor = matrix[row][pivot] * matrix[pivot][pivot];
                for column in row..N {
                    // The matrix is symmetric, and the part below the diagonal is still whole.
                    let lost = factor * matrix[column][pivot];
                    matrix[column][row] -= lost;
                }
                matrix[pivot][row] = factor;
            }
        }
    }

    fn solve(&self, mut right: [f64; N]) -> [f64; N] {
        let matrix = &self.eliminated;
        for row in 1..N {
            for column in 0..row {
                right[row] -= matrix[column][row] * right[column];
            }
        }
        for row in (0..N).rev() {
            right[row] *= matrix[row][row];
            for column in row + 1..N {
                right[row] -= matrix[row][column] * right[column];
            }
        }
        right
    }
}

/// Rates of the links from those of the joints.
fn sums<const N: usize>(joints: &[f64; N]) -> [f64; N] {
    let mut sum = 0.0;
    joints.map(|joint| {
        sum += joint;
        sum
    })
}

/// Rates of the joints from those of the links.
fn differences<const N: usize>(links: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| {
        if i == 0 {
            links[i]
        } else {
            links[i] - links[i - 1]
        }
    })
}

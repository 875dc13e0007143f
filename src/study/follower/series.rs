//! The motion of an arm as a power series in time, coefficient by coefficient.
//!
//! In the angles of the links to the horizontal, `φ_i = q_1 + … + q_i`, the equation of motion is
//!
//! `Σ_j K_ij (cos(φ_i - φ_j) φ̈_j + sin(φ_i - φ_j) φ̇_j²) + W_i cos φ_i = τ_i - τ_{i+1}`
//!
//! Sine and cosine of an angle cost one recurrence each, `s' = c φ'` and `c' = -s φ'`, products of series are
//! convolutions, and the accelerations' coefficients solve one linear system after the other, always with the same
//! matrix. The first of them comes from the arm's own kernel, which loses fewer digits.
//!
//! Source: Jorba and Zou, *A software package for the numerical integration of ODEs by means of high-order Taylor
//! methods*, Experimental Mathematics 14 (2005).
//!
//! **Invariant:** nothing but sums, products, quotients and square roots, so that every machine gives the same bits.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N, and over the coefficients reckoned so far, as they do in the recurrences"
)]

use crate::math::arm::{Arm, State};
use crate::math::count::length_in_f64;
use crate::math::dynamics::forward_dynamics;
use crate::math::trig;

/// Highest order of the rates.
pub(super) const ORDER: usize = 22;

/// Coefficients of as many series as there are links.
type PerLink<const N: usize> = [[f64; N]; ORDER + 1];

/// Coefficients of one series for each two links, and one for each link with itself.
type PerPair<const N: usize> = [[[f64; N]; N]; ORDER];

/// Series of the angles of the links \[rad\], their rates \[rad/s\], and what they are reckoned from.
#[derive(Debug, Clone)]
pub(super) struct Series<const N: usize> {
    /// Order up to which rates are known.
    order: usize,
    pub(super) angle: PerLink<N>,
    pub(super) rate: PerLink<N>,
    acceleration: PerLink<N>,
    squared_rate: PerLink<N>,
    /// Of `φ_i - φ_j` and, for a link with itself, of `φ_i`: sine, cosine, and the rate of the angle.
    sin: PerPair<N>,
    cos: PerPair<N>,
    turning: PerPair<N>,
    equation: Equation<N>,
}

/// The constants of the equation of motion, and its matrix where the series begins.
#[derive(Debug, Clone)]
struct Equation<const N: usize> {
    /// `K_ij` \[kg m²\]; on the diagonal `W_i` \[N m\] instead, the factor of `cos φ_i`.
    factors: [[f64; N]; N],
    /// The matrix where the series begins, eliminated: inverse pivots on the diagonal, multipliers above it.
    eliminated: [[f64; N]; N],
}

impl<const N: usize> Series<N> {
    pub(super) fn new() -> Self {
        Self {
            order: 0,
            angle: [[0.0; N]; ORDER + 1],
            rate: [[0.0; N]; ORDER + 1],
            acceleration: [[0.0; N]; ORDER + 1],
            squared_rate: [[0.0; N]; ORDER + 1],
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
            let (mut s, mut c) = (0.0, 1.0);
            for j in (0..=i).rev() {
                if i != j {
                    (self.sin[0][i][j], self.cos[0][i][j]) = (s, c);
                    (self.sin[0][j][i], self.cos[0][j][i]) = (-s, c);
                }
                (s, c) = (s * cos[j] + c * sin[j], c * cos[j] - s * sin[j]);
            }
            (self.sin[0][i][i], self.cos[0][i][i]) = (s, c);
        }
        self.equation.set(arm, &self.cos[0]);
        self.rate[0] = sums(velocity);
        self.acceleration[0] = sums(&forward_dynamics(arm, position, velocity, effort));
        self.order = 0;
        self.close(0);
    }

    /// Reckons the rates of the next order.
    pub(super) fn extend(&mut self) {
        let k = self.order;
        let per_k = 1.0 / length_in_f64(k);
        let (mut sin, mut cos) = ([[0.0; N]; N], [[0.0; N]; N]);
        let before = self.sin[..k].iter().zip(&self.cos[..k]).rev();
        for (turning, (s, c)) in self.turning[..k].iter().zip(before) {
            for i in 0..N {
                for j in 0..N {
                    sin[i][j] += turning[i][j] * c[i][j];
                    cos[i][j] += turning[i][j] * s[i][j];
                }
            }
        }
        self.sin[k] = sin.map(|row| row.map(|sum| sum * per_k));
        self.cos[k] = cos.map(|row| row.map(|sum| -(sum * per_k)));
        self.close_square(k);

        let mut sum = [[0.0; N]; N];
        let squares = self.squared_rate[..=k].iter().rev();
        for (sin, square) in self.sin[..=k].iter().zip(squares) {
            for i in 0..N {
                for j in 0..N {
                    sum[i][j] += sin[i][j] * square[j];
                }
            }
        }
        let accelerations = self.acceleration[..k].iter().rev();
        for (cos, acceleration) in self.cos[1..=k].iter().zip(accelerations) {
            for i in 0..N {
                for j in 0..N {
                    sum[i][j] += cos[i][j] * acceleration[j];
                }
            }
        }
        let factors = &self.equation.factors;
        let right = std::array::from_fn(|i| {
            let mut right = factors[i][i] * self.cos[k][i][i];
            for j in (0..N).filter(|&j| j != i) {
                right += factors[i][j] * sum[i][j];
            }
            -right
        });
        self.acceleration[k] = self.equation.solve(right);
        self.close(k);
    }

    /// What follows from the accelerations of order `k`.
    fn close(&mut self, k: usize) {
        if k == 0 {
            self.close_square(0);
        }
        let next = 1.0 / length_in_f64(k + 1);
        for i in 0..N {
            self.angle[k + 1][i] = self.rate[k][i] * next;
            self.rate[k + 1][i] = self.acceleration[k][i] * next;
            for j in 0..N {
                let other = if i == j { 0.0 } else { self.rate[k][j] };
                self.turning[k][i][j] = self.rate[k][i] - other;
            }
        }
        self.order = k + 1;
    }

    fn close_square(&mut self, k: usize) {
        let mut sum = [0.0; N];
        for (one, other) in self.rate[..=k].iter().zip(self.rate[..=k].iter().rev()) {
            for i in 0..N {
                sum[i] += one[i] * other[i];
            }
        }
        self.squared_rate[k] = sum;
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
        (change(&self.angle, self.order), change(&self.rate, self.order))
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
                self.factors[i][j] = coupling;
                self.factors[j][i] = coupling;
                matrix[i][j] = coupling * cos[i][j];
                matrix[j][i] = matrix[i][j];
            }
            self.factors[i][i] = arm.gravity() * first * l[i];
            matrix[i][i] = second * l[i] * l[i];
            beyond += m[i];
        }
        for pivot in 0..N {
            matrix[pivot][pivot] = 1.0 / matrix[pivot][pivot];
            for row in pivot + 1..N {
                let factor = matrix[row][pivot] * matrix[pivot][pivot];
                for column in row..N {
                    // Symmetric: what stands below the diagonal is still whole.
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
    std::array::from_fn(|i| if i == 0 { links[i] } else { links[i] - links[i - 1] })
}

//! The motion of an arm as a power series in time, coefficient by coefficient.
//!
//! In the angles of the links to the horizontal, `φ_i = q_1 + … + q_i`, the equation of motion is
//!
//! `Σ_j K_ij (cos(φ_i - φ_j) φ̈_j + sin(φ_i - φ_j) φ̇_j²) + W_i cos φ_i = τ_i - τ_{i+1}`
//!
//! Sine and cosine of an angle cost one recurrence each, `s' = c φ'` and `c' = -s φ'`. Products of series are
//! convolutions. Each order of the accelerations solves a linear system, always with the same matrix. The first order
//! is an input, so that it can come from a kernel that loses fewer digits. Known limit: on a folded arm with a last
//! link a billion times heavier than the others, the series loses one or two digits more than its start.
//!
//! Source: Jorba and Zou, *A software package for the numerical integration of ODEs by means of high-order Taylor
//! methods*, Experimental Mathematics 14 (2005).
//!
//! **Invariant:** it uses only sums, products, quotients and square roots, so results are bit-identical on every
//! machine.

#![allow(
    clippy::needless_range_loop,
    reason = "indices run over 0..N, and over the coefficients computed so far, as they do in the recurrences"
)]

use crate::math::arm::Arm;
use crate::math::count::length_in_f64;
use crate::math::dynamics::running_sum;
use crate::math::number::Arithmetic;

/// Highest order of the rates.
pub(crate) const ORDER: usize = 30;

/// Coefficients of as many series as there are links.
type PerLink<T, const N: usize> = [[T; N]; ORDER + 1];

/// Coefficients of a series for each two links: at `[d][i]` that of links `i` and `i - d`, or of link `i` alone for
/// `d = 0`.
type PerPair<T, const N: usize> = [[[T; N]; N]; ORDER];

/// Index of a coefficient in a series stored in reverse order. Both factors of a convolution are then read forwards.
const fn backwards(order: usize) -> usize {
    ORDER - 1 - order
}

/// Series of the angles of the links \[rad\], their rates \[rad/s\], and the series from which they are computed.
#[derive(Debug, Clone)]
pub(crate) struct PowerSeries<T, const N: usize> {
    /// Order up to which rates are known.
    order: usize,
    pub(crate) angle: PerLink<T, N>,
    pub(crate) rate: PerLink<T, N>,
    /// Accelerations and squared rates, in reverse order.
    acceleration: [[T; N]; ORDER],
    squared_rate: [[T; N]; ORDER],
    /// Sine and cosine of the angle from one link to the other, and its rate, in reverse order.
    sin: PerPair<T, N>,
    cos: PerPair<T, N>,
    turning: PerPair<T, N>,
    equation: Equation<T, N>,
}

/// The constants of the equation of motion, and its matrix at the start of the series.
#[derive(Debug, Clone)]
struct Equation<T, const N: usize> {
    /// At `[d][i]` the `K_ij` of links `i` and `i - d` \[kg m²\]; `W_i` \[N m\] for `d = 0`.
    factors: [[T; N]; N],
    /// The matrix at the start of the series, after elimination: inverse pivots on the diagonal, multipliers above it.
    eliminated: [[T; N]; N],
}

impl<T: Arithmetic + Default, const N: usize> PowerSeries<T, N> {
    pub(crate) fn new() -> Self {
        let zeros = [T::default(); N];
        Self {
            order: 0,
            angle: [zeros; ORDER + 1],
            rate: [zeros; ORDER + 1],
            acceleration: [zeros; ORDER],
            squared_rate: [zeros; ORDER],
            sin: [[zeros; N]; ORDER],
            cos: [[zeros; N]; ORDER],
            turning: [[zeros; N]; ORDER],
            equation: Equation {
                factors: [zeros; N],
                eliminated: [zeros; N],
            },
        }
    }

    /// Order up to which rates are known.
    pub(crate) fn order(&self) -> usize {
        self.order
    }

    /// The series about a state, by sine and cosine of the joint angles and the joints' rates and accelerations there.
    /// It has rates up to order 1; angles of order 0 are left out.
    pub(crate) fn begin(
        &mut self,
        arm: &Arm<N>,
        directions: &([T; N], [T; N]),
        velocity: &[T; N],
        acceleration: &[T; N],
    ) {
        (self.sin[0], self.cos[0]) = between(directions);
        self.equation = Equation::new(arm, &self.cos[0]);
        self.rate[0] = running_sum(velocity);
        self.squared_rate[backwards(0)] = self.rate[0].map(|rate| rate * rate);
        self.close(0, running_sum(acceleration));
    }

    /// Computes the rates of the next order, with the coefficient of that order of the efforts about the links.
    #[inline]
    pub(crate) fn extend(&mut self, effort: &[T; N]) {
        let k = self.order;
        let zero = [[T::default(); N]; N];
        // Sums for sines, cosines and squares, and for the effect of a link on outer and on inner links.
        let (mut sine, mut cosine, mut square) = (zero, zero, [T::default(); N]);
        let (mut pull, mut push) = ((zero, zero), (zero, zero));
        {
            let (sin, cos, rate) = (&self.sin[..k], &self.cos[..k], &self.rate[1..=k]);
            let turning = &self.turning[backwards(k - 1)..][..k];
            let squared = &self.squared_rate[backwards(k)..][..k];
            let acceleration = &self.acceleration[backwards(k)..][..k];
            for m in 0..k {
                for d in 0..N {
                    for i in d..N {
                        sine[d][i] = sine[d][i] + turning[m][d][i] * cos[m][d][i];
                        cosine[d][i] = cosine[d][i] + turning[m][d][i] * sin[m][d][i];
                    }
                }
                for i in 0..N {
                    square[i] = square[i] + turning[m][0][i] * rate[m][i];
                }
                if m > 0 {
                    for d in 1..N {
                        for i in d..N {
                            pull.0[d][i] = pull.0[d][i] + sin[m][d][i] * squared[m][i - d];
                            pull.1[d][i] = pull.1[d][i] + cos[m][d][i] * acceleration[m][i - d];
                            push.0[d][i] = push.0[d][i] + sin[m][d][i] * squared[m][i];
                            push.1[d][i] = push.1[d][i] + cos[m][d][i] * acceleration[m][i];
                        }
                    }
                }
            }
        }
        let per_k = reciprocal::<T>(k);
        let (first_square, first) = (
            self.squared_rate[backwards(0)],
            self.acceleration[backwards(0)],
        );
        let mut right = *effort;
        for i in 0..N {
            square[i] = square[i] + self.rate[0][i] * self.rate[k][i];
        }
        self.squared_rate[backwards(k)] = square;
        for d in 0..N {
            for i in d..N {
                let (sin, cos) = (sine[d][i] * per_k, -(cosine[d][i] * per_k));
                (self.sin[k][d][i], self.cos[k][d][i]) = (sin, cos);
                let factor = self.equation.factors[d][i];
                if d == 0 {
                    right[i] = right[i] - factor * cos;
                } else {
                    let (j, at_start) = (i - d, self.sin[0][d][i]);
                    let across = pull.0[d][i] + (at_start * square[j] + sin * first_square[j]);
                    right[i] = right[i] - factor * (across + (pull.1[d][i] + cos * first[j]));
                    let across = push.0[d][i] + (at_start * square[i] + sin * first_square[i]);
                    right[j] = right[j] - factor * ((push.1[d][i] + cos * first[i]) - across);
                }
            }
        }
        let acceleration = self.equation.solve(right);
        self.close(k, acceleration);
    }

    /// Stores the accelerations of order `k` and the coefficients that follow from them.
    #[inline(always)]
    fn close(&mut self, k: usize, acceleration: [T; N]) {
        self.acceleration[backwards(k)] = acceleration;
        let next = reciprocal::<T>(k + 1);
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

    /// The changes of the joints' positions and velocities in a time \[s\].
    pub(crate) fn change(&self, time: T) -> ([T; N], [T; N]) {
        let change = |series: &PerLink<T, N>, order: usize| {
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

impl<T: Arithmetic + Default, const N: usize> Equation<T, N> {
    fn new(arm: &Arm<N>, cos: &[[T; N]; N]) -> Self {
        let (mut factors, mut matrix) = ([[T::default(); N]; N], [[T::default(); N]; N]);
        let real = |value| T::default().like(value);
        let (l, m) = (arm.lengths().map(real), arm.masses().map(real));
        let mut beyond = T::default();
        for i in (0..N).rev() {
            let (first, second) = (m[i] / real(2.0) + beyond, m[i] / real(3.0) + beyond);
            for j in 0..i {
                let coupling = first * l[i] * l[j];
                factors[i - j][i] = coupling;
                matrix[i][j] = coupling * cos[i - j][i];
            }
            factors[0][i] = real(arm.gravity()) * first * l[i];
            matrix[i][i] = second * l[i] * l[i];
            beyond = beyond + m[i];
        }
        for pivot in 0..N {
            matrix[pivot][pivot] = real(1.0) / matrix[pivot][pivot];
            for row in pivot + 1..N {
                let factor = matrix[row][pivot] * matrix[pivot][pivot];
                for column in row..N {
                    // The matrix is symmetric, and the part below the diagonal is still whole.
                    let lost = factor * matrix[column][pivot];
                    matrix[column][row] = matrix[column][row] - lost;
                }
                matrix[pivot][row] = factor;
            }
        }
        Self {
            factors,
            eliminated: matrix,
        }
    }

    fn solve(&self, mut right: [T; N]) -> [T; N] {
        let matrix = &self.eliminated;
        for row in 1..N {
            for column in 0..row {
                right[row] = right[row] - matrix[column][row] * right[column];
            }
        }
        for row in (0..N).rev() {
            right[row] = right[row] * matrix[row][row];
            for column in row + 1..N {
                right[row] = right[row] - matrix[row][column] * right[column];
            }
        }
        right
    }
}

/// Sines and cosines of the angle from one link to the other. The joints between two links turn one into the other: no
/// angle is summed, and none loses digits.
fn between<T: Arithmetic + Default, const N: usize>(
    (sin, cos): &([T; N], [T; N]),
) -> ([[T; N]; N], [[T; N]; N]) {
    let zeros = [[T::default(); N]; N];
    let (mut sines, mut cosines) = (zeros, zeros);
    for i in 0..N {
        let (mut s, mut c) = (sin[i], cos[i]);
        for d in 1..=i {
            (sines[d][i], cosines[d][i]) = (s, c);
            let j = i - d;
            (s, c) = (s * cos[j] + c * sin[j], c * cos[j] - s * sin[j]);
        }
        (sines[0][i], cosines[0][i]) = (s, c);
    }
    (sines, cosines)
}

/// Joint accelerations \[rad/s²\] by the equation of motion itself, from sine and cosine of the joint angles.
#[cfg(feature = "report")]
pub(crate) fn acceleration<T: Arithmetic + Default, const N: usize>(
    arm: &Arm<N>,
    directions: &([T; N], [T; N]),
    velocity: &[T; N],
    effort: &[T; N],
) -> [T; N] {
    let (sin, cos) = between(directions);
    let equation = Equation::new(arm, &cos);
    let rate = running_sum(velocity);
    let mut right = link_efforts(effort);
    for i in 0..N {
        right[i] = right[i] - equation.factors[0][i] * cos[0][i];
        for d in 1..=i {
            let across = equation.factors[d][i] * sin[d][i];
            right[i] = right[i] - across * rate[i - d] * rate[i - d];
            right[i - d] = right[i - d] + across * rate[i] * rate[i];
        }
    }
    differences(&equation.solve(right))
}

/// Effort about each link's angle from the efforts of the joints at both its ends.
pub(crate) fn link_efforts<T: Arithmetic, const N: usize>(joints: &[T; N]) -> [T; N] {
    std::array::from_fn(|i| {
        if i + 1 < N {
            joints[i] - joints[i + 1]
        } else {
            joints[i]
        }
    })
}

fn reciprocal<T: Arithmetic + Default>(count: usize) -> T {
    let real = |value| T::default().like(value);
    real(1.0) / real(length_in_f64(count))
}

/// Rates of the joints from those of the links.
pub(crate) fn differences<T: Arithmetic, const N: usize>(links: &[T; N]) -> [T; N] {
    std::array::from_fn(|i| {
        if i == 0 {
            links[i]
        } else {
            links[i] - links[i - 1]
        }
    })
}

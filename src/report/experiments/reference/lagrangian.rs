//! The arm's Lagrangian with double-double constants: the start of every reference.
//!
//! In the angles of the links to the horizontal, `φ_i = q_1 + … + q_i`:
//!
//! `Σ_j μ_ij l_i l_j (cos(φ_i - φ_j) φ̈_j + sin(φ_i - φ_j) φ̇_j²) + g γ_i l_i cos φ_i = τ_i - τ_{i+1}`
//!
//! with `γ_i = m_i/2 + Σ_{k>i} m_k`, `μ_ij = γ_max(i,j)` off the diagonal and `μ_ii = m_i/3 + Σ_{k>i} m_k`. Solved as a
//! dense linear system: the arm's own kernel is a recursion along the links and shares neither formula nor code with
//! it.
//!
//! **Invariant:** parameters and states given as doubles are taken exactly.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N of arrays that have N elements, as they do in the formulas"
)]

use super::double_double::DoubleDouble as Real;
use crate::math::arm::Arm;
use crate::study::taylor::series::{differences, sums};

/// Constants of the equations of motion.
#[derive(Debug, Clone)]
pub(super) struct Lagrangian<const N: usize> {
    /// `μ_ij l_i l_j` \[kg m²\].
    pub(super) coupling: [[Real; N]; N],
    /// `g γ_i l_i` \[N m\].
    pub(super) weight: [Real; N],
}

impl<const N: usize> Lagrangian<N> {
    pub(super) fn new(arm: &Arm<N>) -> Self {
        let mass = arm.masses().map(Real::from);
        let length = arm.lengths().map(Real::from);
        let beyond: [Real; N] =
            std::array::from_fn(|i| (i + 1..N).fold(Real::ZERO, |sum, k| sum + mass[k]));
        let first = |i: usize| mass[i] / Real::from(2.0) + beyond[i];
        let second = |i: usize| mass[i] / Real::from(3.0) + beyond[i];
        Self {
            coupling: std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    let moment = if i == j { second(i) } else { first(i.max(j)) };
                    moment * length[i] * length[j]
                })
            }),
            weight: std::array::from_fn(|i| Real::from(arm.gravity()) * first(i) * length[i]),
        }
    }

    /// Joint accelerations \[rad/s²\] under the joint efforts `tau` \[N m\].
    pub(super) fn acceleration(&self, q: &[Real; N], qd: &[Real; N], tau: &[Real; N]) -> [Real; N] {
        let direction = sums(q).map(Real::sin_cos);
        let rate = sums(qd);
        let effort = link_efforts(tau);
        let mut matrix = self.coupling;
        let right: [Real; N] = std::array::from_fn(|i| {
            let (sin_i, cos_i) = direction[i];
            let mut right = effort[i] - self.weight[i] * cos_i;
            for j in 0..N {
                let (sin_j, cos_j) = direction[j];
                let turned = sin_i * cos_j - cos_i * sin_j;
                right += -(self.coupling[i][j] * turned * rate[j] * rate[j]);
                matrix[i][j] = self.coupling[i][j] * (cos_i * cos_j + sin_i * sin_j);
            }
            right
        });
        differences(&Factors::of(matrix).solve(right))
    }
}

/// A symmetric positive definite matrix, eliminated without pivots; kept so that many right sides can be solved for.
#[derive(Debug, Clone)]
pub(super) struct Factors<const N: usize> {
    /// Upper triangle with the pivots; below it the multipliers.
    reduced: [[Real; N]; N],
}

impl<const N: usize> Factors<N> {
    pub(super) fn of(mut matrix: [[Real; N]; N]) -> Self {
        for pivot in 0..N {
            for row in pivot + 1..N {
                let factor = matrix[row][pivot] / matrix[pivot][pivot];
                matrix[row][pivot] = factor;
                let above = matrix[pivot];
                for (value, above) in matrix[row].iter_mut().zip(above).skip(pivot + 1) {
                    *value += -(factor * above);
                }
            }
        }
        Self { reduced: matrix }
    }

    pub(super) fn solve(&self, mut right: [Real; N]) -> [Real; N] {
        for row in 1..N {
            for column in 0..row {
                right[row] = right[row] - self.reduced[row][column] * right[column];
            }
        }
        for row in (0..N).rev() {
            for column in row + 1..N {
                right[row] = right[row] - self.reduced[row][column] * right[column];
            }
            right[row] = right[row] / self.reduced[row][row];
        }
        right
    }
}

/// Effort about each link's angle from the efforts of the joints at both its ends.
pub(super) fn link_efforts<const N: usize>(joints: &[Real; N]) -> [Real; N] {
    std::array::from_fn(|i| {
        if i + 1 < N {
            joints[i] - joints[i + 1]
        } else {
            joints[i]
        }
    })
}

//! Eigenvalues of a small real matrix, in three textbook stages: balancing by powers of two, Householder reduction to
//! Hessenberg form, and Francis' QR iteration. Its double shifts keep a pair of complex eigenvalues in real arithmetic.
//! The Hessenberg form is balanced too. Without it the iteration converges slowly, or not at all, if a block of slow
//! modes has entries of very different sizes.
//!
//! Source: Golub and Van Loan, *Matrix Computations* (2013), ch. 7.4 and 7.5.
//!
//! **Invariant:** the iteration ends; an eigenvalue that does not converge is NaN.

use std::ops::RangeInclusive;

use libm::{exp2, log2};

use super::{Complex, Matrix, largest};

/// QR sweeps per eigenvalue before the iteration gives up. Two or three are usual.
const MAX_SWEEPS: usize = 60;

impl Matrix {
    /// All eigenvalues, in no particular order; NaN for an eigenvalue that does not converge, and for every one if an
    /// entry is not finite.
    pub fn eigenvalues(&self) -> Vec<Complex> {
        if !self.entries.iter().all(|entry| entry.is_finite()) {
            return vec![Complex::real(f64::NAN); self.n];
        }
        // A state on which no other depends, such as the angle of a joint that only drifts, has its diagonal entry for
        // an eigenvalue. Rounding would spread a double one to the square root of its size.
        let mut kept: Vec<usize> = (0..self.n).collect();
        let mut values = Vec::with_capacity(self.n);
        let alone = |kept: &[usize], j| kept.iter().all(|&i| i == j || self[(i, j)] == 0.0);
        while let Some(at) = kept.iter().position(|&j| alone(&kept, j)) {
            let j = kept.remove(at);
            values.push(Complex::real(self[(j, j)]));
        }
        let mut matrix = Self::from_fn(kept.len(), |i, j| self[(kept[i], kept[j])]);
        matrix.balance();
        matrix.reduce_to_hessenberg();
        matrix.balance();
        values.extend(matrix.iterate());
        values
    }

    /// A diagonal similarity that makes rows and columns similar in size. It uses powers of two and is therefore exact.
    /// Without it small eigenvalues would be lost in rounding: velocities and positions, or links of a milligram and of
    /// a kilogram, differ in scale.
    fn balance(&mut self) {
        let n = self.n;
        // Each pass at least halves some row or column by 5 %; a dozen passes suffice.
        for _ in 0..24 {
            let mut settled = true;
            for i in 0..n {
                let others = || (0..n).filter(move |&j| j != i);
                let row: f64 = others().map(|j| self[(i, j)].abs()).sum();
                let column: f64 = others().map(|j| self[(j, i)].abs()).sum();
                let exponent = (0.5 * log2(row / column)).round();
                // Zero rows and columns have no scale to match.
                if row == 0.0 || column == 0.0 || exponent == 0.0 || exponent.abs() > 900.0 {
                    continue;
                }
                let factor = exp2(exponent);
                if column * factor + row / factor < 0.95 * (column + row) {
                    settled = false;
                    for j in 0..n {
                        self[(i, j)] /= factor;
                        self[(j, i)] *= factor;
                    }
                }
            }
            if settled {
                break;
            }
        }
    }

    /// Zeros below the subdiagonal, by reflections from both sides.
    fn reduce_to_hessenberg(&mut self) {
        let n = self.n;
        for k in 0..n.saturating_sub(2) {
            let mut across: Vec<f64> = (k + 1..n).map(|i| self[(i, k)]).collect();
            self.reflect(k + 1, &mut across, 0..=n - 1);
            for i in k + 2..n {
                self[(i, k)] = 0.0;
            }
        }
    }

    /// Reflects from both sides so that a vector, whose first entry belongs to row `start`, turns into a multiple of
    /// its first axis. Only the rows and columns in `block` are updated.
    fn reflect(&mut self, start: usize, across: &mut [f64], block: RangeInclusive<usize>) {
        let size = largest(across.iter().map(|u| u.abs()));
        if size == 0.0 {
            return;
        }
        across.iter_mut().for_each(|u| *u /= size);
        let norm = across.iter().map(|u| u * u).sum::<f64>().sqrt();
        across[0] += norm.copysign(across[0]);
        let per_square = 2.0 / across.iter().map(|u| u * u).sum::<f64>();
        for column in block.clone() {
            let rows = (start..).zip(&*across);
            let dot: f64 = rows.clone().map(|(row, u)| u * self[(row, column)]).sum();
            rows.for_each(|(row, u)| self[(row, column)] -= per_square * dot * u);
        }
        for row in block {
            let columns = (start..).zip(&*across);
            let dot: f64 = columns
                .clone()
                .map(|(column, u)| u * self[(row, column)])
                .sum();
            columns.for_each(|(column, u)| self[(row, column)] -= per_square * dot * u);
        }
    }

    /// The eigenvalues of a matrix with zeros below the subdiagonal: blocks of one or two rows split off at its end.
    fn iterate(mut self) -> Vec<Complex> {
        let norm = largest(self.entries.iter().map(|entry| entry.abs()));
        let mut values = vec![Complex::real(f64::NAN); self.n];
        let (mut active, mut sweeps) = (self.n, 0);
        while active > 0 {
            let last = active - 1;
            let splits = |&i: &usize| self.is_negligible(i, sweeps, norm);
            let first = (1..active).rev().find(splits).unwrap_or(0);
            match last - first {
                0 => values[last] = Complex::real(self[(last, last)]),
                1 => [values[first], values[last]] = self.pair(last),
                _ if sweeps == MAX_SWEEPS => break,
                _ => {
                    sweeps += 1;
                    self.sweep(first, last, sweeps);
                    continue;
                }
            }
            (active, sweeps) = (first, 0);
        }
        values
    }

    /// Whether the entry left of the diagonal in row `i` is negligible.
    fn is_negligible(&self, i: usize, sweeps: usize, norm: f64) -> bool {
        let beside = self[(i, i)].abs() + self[(i - 1, i - 1)].abs();
        // Compared with two zero eigenvalues no entry is small. After some sweeps the size of the matrix is the scale.
        let least = if sweeps < MAX_SWEEPS / 3 { 0.0 } else { norm };
        self[(i, i - 1)].abs() <= f64::EPSILON * beside.max(least)
    }

    /// The eigenvalues of the block of two rows that ends at `last`.
    fn pair(&self, last: usize) -> [Complex; 2] {
        let d = self[(last, last)];
        let half = 0.5 * (self[(last - 1, last - 1)] - d);
        let product = self[(last - 1, last)] * self[(last, last - 1)];
        let square = half * half + product;
        let root = square.abs().sqrt();
        if square < 0.0 {
            return [root, -root].map(|im| Complex { re: d + half, im });
        }
        // The larger part is computed first, so that the other follows without cancellation.
        let larger = half + root.copysign(half);
        let other = if larger == 0.0 { 0.0 } else { product / larger };
        [d + larger, d - other].map(Complex::real)
    }

    /// A double-shift step of the iteration on rows and columns `first..=last`. The first column of the product of both
    /// factors is reflected to one entry. This leaves a bulge below the subdiagonal, which is reduced column by column.
    fn sweep(&mut self, first: usize, last: usize, sweeps: usize) {
        // The shifts are the eigenvalues of the last block, by its diagonal and the product of its other entries. Every
        // tenth sweep uses exceptional shifts, to break a cycle.
        let (diagonal, product) = if sweeps.is_multiple_of(10) {
            let size = self[(last, last - 1)].abs() + self[(last - 1, last - 2)].abs();
            ([0.75 * size; 2], -0.4375 * size * size)
        } else {
            let product = self[(last - 1, last)] * self[(last, last - 1)];
            ([last - 1, last].map(|i| self[(i, i)]), product)
        };
        let at = |i: usize, j: usize| self[(first + i, first + j)];
        let [one, other] = diagonal.map(|entry| entry - at(0, 0));
        let mut bulge = [
            (one * other - product) / at(1, 0) + at(0, 1),
            at(1, 1) - at(0, 0) - one - other,
            at(2, 1),
        ];
        let mut height = bulge.len();
        for k in first..last {
            self.reflect(k, &mut bulge[..height], first..=last);
            if k > first {
                (1..height).for_each(|i| self[(k + i, k - 1)] = 0.0);
            }
            height = bulge.len().min(last - k);
            for (row, entry) in (k + 1..).zip(&mut bulge[..height]) {
                *entry = self[(row, k)];
            }
        }
    }
}

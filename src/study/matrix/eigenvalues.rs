//! Eigenvalues of a small real matrix, in three textbook stages: balancing by powers of two, Householder reduction to
//! Hessenberg form, and the QR iteration. Wilkinson's shift in complex arithmetic treats real and complex eigenvalues
//! alike.
//!
//! Source: Golub and Van Loan, *Matrix Computations* (2013), ch. 7.4 and 7.5.
//!
//! **Invariant:** the iteration ends; an eigenvalue that does not converge is NaN.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..n of an n×n matrix, as they do in the formulas"
)]

use super::{Complex, Matrix, largest};
use crate::math::elementary::{exp2, hypot, log2};

/// QR sweeps per eigenvalue before the iteration gives up. Two or three are usual.
const MAX_SWEEPS: usize = 60;

impl Matrix {
    /// All eigenvalues, in no particular order; NaN for what does not converge or starts from what is not finite.
    #[must_use]
    pub fn eigenvalues(&self) -> Vec<Complex> {
        if !self.entries.iter().all(|entry| entry.is_finite()) {
            return vec![Complex::real(f64::NAN); self.n];
        }
        let mut matrix = self.clone();
        matrix.balance();
        matrix.reduce_to_hessenberg();
        Hessenberg::new(&matrix).eigenvalues()
    }

    /// A diagonal similarity, in powers of two and so exact, that makes rows and columns alike in size. Velocities
    /// beside positions, or an outer link of a milligram beside a link of a kilogram, would otherwise drown the small
    /// eigenvalues.
    fn balance(&mut self) {
        let n = self.n;
        // Each pass at least halves some row or column by 5 %; a dozen passes settle what can be settled.
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
            let largest = (k + 1..n).fold(0.0, |max: f64, i| max.max(self[(i, k)].abs()));
            if (k + 2..n).all(|i| self[(i, k)] == 0.0) || largest == 0.0 {
                continue;
            }
            let mut u: Vec<f64> = (k + 1..n).map(|i| self[(i, k)] / largest).collect();
            let norm = u.iter().map(|u| u * u).sum::<f64>().sqrt();
            u[0] += norm.copysign(u[0]);
            let per_square = 2.0 / u.iter().map(|u| u * u).sum::<f64>();
            for column in 0..n {
                let dot: f64 = (k + 1..n).map(|i| u[i - k - 1] * self[(i, column)]).sum();
                for i in k + 1..n {
                    self[(i, column)] -= per_square * dot * u[i - k - 1];
                }
            }
            for row in 0..n {
                let dot: f64 = (k + 1..n).map(|j| u[j - k - 1] * self[(row, j)]).sum();
                for j in k + 1..n {
                    self[(row, j)] -= per_square * dot * u[j - k - 1];
                }
            }
            for i in k + 2..n {
                self[(i, k)] = 0.0;
            }
        }
    }
}

/// A complex matrix with zeros below the subdiagonal, on the way to its eigenvalues.
struct Hessenberg {
    n: usize,
    entries: Vec<Complex>,
    /// Largest modulus of an entry at the start.
    norm: f64,
}

impl Hessenberg {
    fn new(matrix: &Matrix) -> Self {
        let entries = matrix.entries.iter().map(|&entry| Complex::real(entry));
        Self {
            n: matrix.n,
            entries: entries.collect(),
            norm: largest(matrix.entries.iter().map(|entry| entry.abs())),
        }
    }

    fn at(&self, row: usize, column: usize) -> Complex {
        self.entries[row * self.n + column]
    }

    fn eigenvalues(mut self) -> Vec<Complex> {
        let mut values = vec![Complex::real(f64::NAN); self.n];
        let mut active = self.n;
        let mut sweeps = 0;
        while active > 0 {
            let last = active - 1;
            let first = (1..active)
                .rev()
                .find(|&i| self.is_negligible(i, sweeps))
                .unwrap_or(0);
            if first == last {
                values[last] = self.at(last, last);
                active = last;
                sweeps = 0;
            } else if sweeps == MAX_SWEEPS {
                break;
            } else {
                sweeps += 1;
                let shift = self.shift(last, sweeps);
                self.sweep(first, last, shift);
            }
        }
        values
    }

    /// Whether the entry left of the diagonal in row `i` can be taken for zero.
    fn is_negligible(&self, i: usize, sweeps: usize) -> bool {
        let beside = self.at(i, i).modulus() + self.at(i - 1, i - 1).modulus();
        // Nothing is small beside two eigenvalues that are zero: then the size of the whole matrix is taken.
        let scale = if sweeps < MAX_SWEEPS / 3 {
            beside
        } else {
            beside.max(self.norm)
        };
        self.at(i, i - 1).modulus() <= f64::EPSILON * scale
    }

    /// Wilkinson's shift: the eigenvalue of the last 2×2 block that is nearer to its last entry. Every tenth sweep
    /// takes another, to break a cycle.
    fn shift(&self, last: usize, sweeps: usize) -> Complex {
        let d = self.at(last, last);
        let product = self.at(last - 1, last) * self.at(last, last - 1);
        if sweeps.is_multiple_of(10) {
            return d + Complex::real(self.at(last, last - 1).modulus());
        }
        let half = (self.at(last - 1, last - 1) - d).scaled(0.5);
        let root = (half * half + product).sqrt();
        let toward = half.re * root.re + half.im * root.im;
        let denominator = if toward >= 0.0 {
            half + root
        } else {
            half - root
        };
        let square = denominator.re * denominator.re + denominator.im * denominator.im;
        if square == 0.0 {
            return d;
        }
        d - (product * denominator.conjugate()).scaled(1.0 / square)
    }

    /// One step `H - σI = QR`, `H ← RQ + σI` on rows and columns `first..=last`, by plane rotations.
    fn sweep(&mut self, first: usize, last: usize, shift: Complex) {
        let n = self.n;
        for i in first..=last {
            self.entries[i * n + i] = self.at(i, i) - shift;
        }
        let mut rotations = Vec::with_capacity(last - first);
        for k in first..last {
            let (a, b) = (self.at(k, k), self.at(k + 1, k));
            let length = hypot(a.modulus(), b.modulus());
            let (c, s) = if length == 0.0 {
                (Complex::real(1.0), Complex::ZERO)
            } else {
                (a.scaled(1.0 / length), b.scaled(1.0 / length))
            };
            rotations.push((c, s));
            for column in k..=last {
                let (upper, lower) = (self.at(k, column), self.at(k + 1, column));
                self.entries[k * n + column] = c.conjugate() * upper + s.conjugate() * lower;
                self.entries[(k + 1) * n + column] = c * lower - s * upper;
            }
        }
        for (k, (c, s)) in (first..last).zip(rotations) {
            for row in first..=(k + 1).min(last) {
                let (left, right) = (self.at(row, k), self.at(row, k + 1));
                self.entries[row * n + k] = c * left + s * right;
                self.entries[row * n + k + 1] = c.conjugate() * right - s.conjugate() * left;
            }
        }
        for i in first..=last {
            self.entries[i * n + i] = self.at(i, i) + shift;
        }
    }
}

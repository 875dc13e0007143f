//! Small dense matrices: what the step matrices of the stability predictions need, sizes up to some ten.
//!
//! Eigenvalues come from three textbook stages: balancing by powers of two, Householder reduction to Hessenberg form, and
//! the QR iteration with Wilkinson's shift in complex arithmetic, which treats real and complex eigenvalues alike.
//! Uses nothing but floating point.
//!
//! Source: Golub and Van Loan, *Matrix Computations* (2013), ch. 7.4 and 7.5.
//!
//! **Invariant:** no input panics or loops for ever; what can't be computed comes out as NaN, which no comparison
//! takes for stable.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..n of an n×n matrix, as they do in the formulas"
)]

use std::ops::{Add, Index, IndexMut, Mul, Sub};

/// QR sweeps per eigenvalue before the iteration gives up. Two or three are usual.
const MAX_SWEEPS: usize = 60;

/// A complex number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Complex {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
}

impl Complex {
    const ZERO: Self = Self { re: 0.0, im: 0.0 };

    const fn real(re: f64) -> Self {
        Self { re, im: 0.0 }
    }

    /// Modulus, without overflow on the way.
    #[must_use]
    pub fn modulus(self) -> f64 {
        self.re.hypot(self.im)
    }

    fn conjugate(self) -> Self {
        Self {
            re: self.re,
            im: -self.im,
        }
    }

    fn scaled(self, factor: f64) -> Self {
        Self {
            re: self.re * factor,
            im: self.im * factor,
        }
    }

    /// Principal square root.
    fn sqrt(self) -> Self {
        let modulus = self.modulus();
        // The larger of the two parts first: the other follows without cancellation.
        let part = (0.5 * (modulus + self.re.abs())).sqrt();
        if part == 0.0 {
            return Self::ZERO;
        }
        let other = 0.5 * self.im / part;
        if self.re >= 0.0 {
            Self {
                re: part,
                im: other,
            }
        } else {
            Self {
                re: other.abs(),
                im: part.copysign(self.im),
            }
        }
    }
}

impl Add for Complex {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            re: self.re + other.re,
            im: self.im + other.im,
        }
    }
}

impl Sub for Complex {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self {
            re: self.re - other.re,
            im: self.im - other.im,
        }
    }
}

impl Mul for Complex {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self {
            re: self.re * other.re - self.im * other.im,
            im: self.re * other.im + self.im * other.re,
        }
    }
}

/// A real square matrix, indexed by `(row, column)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrix {
    n: usize,
    /// Row by row.
    entries: Vec<f64>,
}

impl Index<(usize, usize)> for Matrix {
    type Output = f64;
    fn index(&self, (row, column): (usize, usize)) -> &f64 {
        &self.entries[row * self.n + column]
    }
}

impl IndexMut<(usize, usize)> for Matrix {
    fn index_mut(&mut self, (row, column): (usize, usize)) -> &mut f64 {
        &mut self.entries[row * self.n + column]
    }
}

impl Matrix {
    /// The n×n matrix of zeros.
    #[must_use]
    pub fn zeros(n: usize) -> Self {
        Self {
            n,
            entries: vec![0.0; n * n],
        }
    }

    /// The n×n matrix whose entry at `(row, column)` is what `entry` says.
    #[must_use]
    pub fn from_fn(n: usize, mut entry: impl FnMut(usize, usize) -> f64) -> Self {
        let mut matrix = Self::zeros(n);
        for row in 0..n {
            for column in 0..n {
                matrix[(row, column)] = entry(row, column);
            }
        }
        matrix
    }

    /// Number of rows and of columns.
    #[must_use]
    pub fn size(&self) -> usize {
        self.n
    }

    /// `self · other`; both have the same size.
    #[must_use]
    pub fn product(&self, other: &Self) -> Self {
        debug_assert_eq!(self.n, other.n, "a product needs matrices of one size");
        let mut product = Self::zeros(self.n);
        for row in 0..self.n {
            for inner in 0..self.n {
                let factor = self[(row, inner)];
                if factor != 0.0 {
                    for column in 0..self.n {
                        product[(row, column)] += factor * other[(inner, column)];
                    }
                }
            }
        }
        product
    }

    /// `self + factor · other`; both have the same size.
    #[must_use]
    pub fn plus(mut self, factor: f64, other: &Self) -> Self {
        debug_assert_eq!(self.n, other.n, "a sum needs matrices of one size");
        for (entry, other) in self.entries.iter_mut().zip(&other.entries) {
            *entry += factor * other;
        }
        self
    }

    /// `I + factor · self`.
    #[must_use]
    pub fn shifted_identity(mut self, factor: f64) -> Self {
        for entry in &mut self.entries {
            *entry *= factor;
        }
        for i in 0..self.n {
            self[(i, i)] += 1.0;
        }
        self
    }

    /// The solution `x` of `self · x = b`, by elimination with partial pivoting; `None` if the matrix is singular or `b` has
    /// not n entries.
    #[must_use]
    pub fn solve(&self, b: &[f64]) -> Option<Vec<f64>> {
        let n = self.n;
        if b.len() != n {
            return None;
        }
        let (mut a, mut x) = (self.clone(), b.to_vec());
        for k in 0..n {
            let pivot = (k..n).max_by(|&i, &j| a[(i, k)].abs().total_cmp(&a[(j, k)].abs()))?;
            if a[(pivot, k)] == 0.0 || !a[(pivot, k)].is_finite() {
                return None;
            }
            for column in 0..n {
                a.entries.swap(k * n + column, pivot * n + column);
            }
            x.swap(k, pivot);
            for row in k + 1..n {
                let factor = a[(row, k)] / a[(k, k)];
                for column in k..n {
                    a[(row, column)] -= factor * a[(k, column)];
                }
                x[row] -= factor * x[k];
            }
        }
        for row in (0..n).rev() {
            let known: f64 = (row + 1..n).map(|j| a[(row, j)] * x[j]).sum();
            x[row] = (x[row] - known) / a[(row, row)];
        }
        x.iter().all(|x| x.is_finite()).then_some(x)
    }

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

    /// Largest modulus of an eigenvalue; NaN where [`Matrix::eigenvalues`] has one.
    #[must_use]
    pub fn spectral_radius(&self) -> f64 {
        largest(self.eigenvalues().into_iter().map(Complex::modulus))
    }

    /// A diagonal similarity, in powers of two and so exact, that makes rows and columns alike in size. Velocities beside
    /// positions, or a tip of a milligram beside a link of a kilogram, would otherwise drown the small eigenvalues.
    fn balance(&mut self) {
        let n = self.n;
        // Each pass at least halves some row or column by 5 %; a dozen passes settle what can be settled.
        for _ in 0..24 {
            let mut settled = true;
            for i in 0..n {
                let others = || (0..n).filter(move |&j| j != i);
                let row: f64 = others().map(|j| self[(i, j)].abs()).sum();
                let column: f64 = others().map(|j| self[(j, i)].abs()).sum();
                let exponent = (0.5 * (row / column).log2()).round();
                // Zero rows and columns have no scale to match.
                if row == 0.0 || column == 0.0 || exponent == 0.0 || exponent.abs() > 900.0 {
                    continue;
                }
                let factor = exponent.exp2();
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

/// The largest of `values`; NaN if one of them is.
pub(super) fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |max, value| {
        if value > max || value.is_nan() {
            value
        } else {
            max
        }
    })
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
        // Beside two eigenvalues that are zero nothing is small; then the size of the whole matrix has to do.
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
        if sweeps % 10 == 0 {
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
            let length = a.modulus().hypot(b.modulus());
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

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test that panics has failed"
)]
mod tests {
    use super::*;

    fn sorted(matrix: &Matrix) -> Vec<(f64, f64)> {
        let mut values: Vec<_> = matrix
            .eigenvalues()
            .iter()
            .map(|value| (value.re, value.im))
            .collect();
        values.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        values
    }

    /// A companion matrix has the roots of its polynomial for eigenvalues, here those of
    /// `(z - 1)(z + 2)(z² + z + 1)(z - 0.5) = z⁵ + 1.5 z⁴ - z³ - z² - 1.5 z + 1`.
    #[test]
    fn a_companion_matrix_has_the_roots_of_its_polynomial() {
        let coefficients = [1.0, -1.5, -1.0, -1.0, 1.5];
        let matrix = Matrix::from_fn(5, |row, column| {
            if column == 4 {
                -coefficients[row]
            } else {
                f64::from(u8::from(row == column + 1))
            }
        });
        let half_root_3 = 0.75_f64.sqrt();
        let expected = [
            (-2.0, 0.0),
            (-0.5, -half_root_3),
            (-0.5, half_root_3),
            (0.5, 0.0),
            (1.0, 0.0),
        ];
        // Simple, well separated roots: some ten units of rounding.
        for (found, expected) in sorted(&matrix).iter().zip(expected) {
            assert!((found.0 - expected.0).abs() < 1e-14, "{found:?}");
            assert!((found.1 - expected.1).abs() < 1e-14, "{found:?}");
        }
    }

    #[test]
    fn widely_scaled_states_keep_their_slow_eigenvalues() {
        // A fast pole at -1e9 and a slow one at -1e-3, states scaled apart by 1e12.
        let scale = 1e12;
        let matrix = Matrix::from_fn(2, |row, column| match (row, column) {
            (0, 0) => -1e-3,
            (0, 1) => scale,
            (1, 1) => -1e9,
            _ => 0.0,
        });
        let values = sorted(&matrix);
        assert!((values[0].0 / -1e9 - 1.0).abs() < 1e-14);
        assert!((values[1].0 / -1e-3 - 1.0).abs() < 1e-14);
    }

    #[test]
    fn a_nilpotent_matrix_has_zeros_for_eigenvalues() {
        let matrix = Matrix::from_fn(6, |row, column| f64::from(u8::from(column == row + 3)));
        assert!(matrix.spectral_radius() == 0.0);
    }

    #[test]
    fn what_is_not_finite_comes_out_as_nan() {
        let matrix = Matrix::from_fn(3, |row, _| if row == 1 { f64::NAN } else { 1.0 });
        assert!(matrix.spectral_radius().is_nan());
    }

    #[test]
    fn a_solution_satisfies_its_equations() {
        let matrix = Matrix::from_fn(3, |row, column| {
            [[0.0, 2.0, 1.0], [1.0, -1.0, 3.0], [4.0, 0.5, -2.0]][row][column]
        });
        // Of x = (1, -2, 3): exact in a few units of rounding.
        let x = matrix.solve(&[-1.0, 12.0, -3.0]).unwrap();
        for (x, expected) in x.iter().zip([1.0, -2.0, 3.0]) {
            assert!((x - expected).abs() < 1e-14);
        }
        assert!(Matrix::zeros(2).solve(&[1.0, 1.0]).is_none());
    }
}

//! Small dense matrices for the step matrices of the stability predictions, of sizes up to some ten.
//!
//! **Invariant:** no entry causes a panic or an endless loop. A value that cannot be computed is NaN, which every
//! comparison treats as unstable.

mod eigenvalues;

use std::ops::{Index, IndexMut};

use libm::hypot;

/// A real square matrix, indexed by `(row, column)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrix {
    n: usize,
    /// Row by row.
    entries: Vec<f64>,
}

impl Index<(usize, usize)> for Matrix {
    type Output = f64;
    #[inline]
    fn index(&self, (row, column): (usize, usize)) -> &f64 {
        &self.entries[row * self.n + column]
    }
}

impl IndexMut<(usize, usize)> for Matrix {
    #[inline]
    fn index_mut(&mut self, (row, column): (usize, usize)) -> &mut f64 {
        &mut self.entries[row * self.n + column]
    }
}

impl Matrix {
    /// The n×n matrix of zeros.
    pub fn zeros(n: usize) -> Self {
        Self {
            n,
            entries: vec![0.0; n * n],
        }
    }

    /// The n×n matrix whose entry at `(row, column)` is `entry(row, column)`.
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
    pub fn size(&self) -> usize {
        self.n
    }

    /// `self · other`; both have the same size.
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

    /// `factor · self`.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        self.entries.iter_mut().for_each(|entry| *entry *= factor);
        self
    }

    /// `self + value · I`.
    #[must_use]
    pub fn plus_diagonal(mut self, value: f64) -> Self {
        for i in 0..self.n {
            self[(i, i)] += value;
        }
        self
    }

    /// The solution `x` of `self · x = b`, by elimination with partial pivoting; `None` if the matrix is singular or
    /// `b` does not have n entries.
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

    /// The inverse; `None` if the matrix is singular.
    pub fn inverse(&self) -> Option<Self> {
        let n = self.n;
        let unit = |column: usize| -> Vec<f64> {
            (0..n)
                .map(|row| f64::from(u8::from(row == column)))
                .collect()
        };
        let columns: Option<Vec<_>> = (0..n).map(|column| self.solve(&unit(column))).collect();
        let columns = columns?;
        Some(Self::from_fn(n, |row, column| columns[column][row]))
    }

    /// The vector that the matrix shortens most, by inverse iteration. Its largest entry is 1 or -1. Each step reduces
    /// the error by the ratio of the two eigenvalues that are nearest to zero.
    ///
    /// Source: Golub and Van Loan, *Matrix Computations* (2013), ch. 7.6.
    pub fn most_shortened(&self) -> Option<Vec<f64>> {
        const ITERATIONS: u32 = 6;
        let mut x = vec![1.0; self.n];
        for _ in 0..ITERATIONS {
            x = self.solve(&x)?;
            let length = largest(x.iter().map(|x| x.abs()));
            x.iter_mut().for_each(|x| *x /= length);
        }
        Some(x)
    }

    /// Largest modulus of an eigenvalue; NaN if [`Matrix::eigenvalues`] has a NaN.
    pub fn spectral_radius(&self) -> f64 {
        largest(self.eigenvalues().into_iter().map(Complex::modulus))
    }
}

/// A complex number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Complex {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
}

impl Complex {
    const fn real(re: f64) -> Self {
        Self { re, im: 0.0 }
    }

    /// Modulus, without intermediate overflow.
    #[must_use]
    pub fn modulus(self) -> f64 {
        hypot(self.re, self.im)
    }
}

/// The largest difference of two entries in the same place; NaN if one is.
pub(crate) fn largest_difference(one: &[f64], other: &[f64]) -> f64 {
    let pairs = one.iter().zip(other);
    largest(pairs.map(|(one, other)| (one - other).abs()))
}

/// The largest of `values` and 0; NaN if one of them is.
pub fn largest(values: impl Iterator<Item = f64>) -> f64 {
    largest_above(0.0, values)
}

/// The largest of `values` and `least`; NaN if one of them is.
pub(super) fn largest_above(least: f64, values: impl Iterator<Item = f64>) -> f64 {
    values.fold(least, |max, value| {
        if value > max || value.is_nan() {
            value
        } else {
            max
        }
    })
}

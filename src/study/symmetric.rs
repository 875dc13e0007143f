//! Eigenvalues and eigenvectors of symmetric matrices of two or three rows, by Jacobi's rotations.
//!
//! Source: Golub and Van Loan, *Matrix Computations* (2013), ch. 8.5.
//!
//! **Invariant:** the sweeps are bounded; infinities and NaN are passed on.

use crate::math::elementary::hypot;

/// A symmetric matrix, row by row.
pub(super) type Symmetric<const N: usize> = [[f64; N]; N];

/// Most sweeps over all pairs; convergence is quadratic, so five are enough.
const SWEEPS: usize = 20;

/// Eigenvalues, each with its unit vector, in no particular order.
pub(super) fn eigen<const N: usize>(matrix: &Symmetric<N>) -> [(f64, [f64; N]); N] {
    let mut a = *matrix;
    // Row i is the vector of a[i][i].
    let mut vectors: Symmetric<N> =
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    for _ in 0..SWEEPS {
        let mut turned = false;
        for p in 0..N {
            for q in p + 1..N {
                let off = a[p][q];
                if off == 0.0 || off.abs() < 1e-18 * (a[p][p] * a[q][q]).abs().sqrt() {
                    continue;
                }
                turned = true;
                let theta = 0.5 * (a[q][q] - a[p][p]) / off;
                let t = 1.0_f64.copysign(theta) / (theta.abs() + hypot(theta, 1.0));
                let c = 1.0 / hypot(t, 1.0);
                let s = t * c;
                for row in &mut a {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
                for k in 0..N {
                    (a[p][k], a[q][k]) = (c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]);
                    (vectors[p][k], vectors[q][k]) = (
                        c * vectors[p][k] - s * vectors[q][k],
                        s * vectors[p][k] + c * vectors[q][k],
                    );
                }
                (a[p][q], a[q][p]) = (0.0, 0.0);
            }
        }
        if !turned {
            break;
        }
    }
    std::array::from_fn(|i| (a[i][i], vectors[i]))
}

/// Whether every eigenvalue is positive: all pivots of an elimination are positive.
pub(super) fn is_positive<const N: usize>(matrix: &Symmetric<N>) -> bool {
    let mut a = *matrix;
    (0..N).all(|k| {
        let pivot = a[k];
        for row in a.iter_mut().skip(k + 1) {
            let factor = row[k] / pivot[k];
            for (entry, above) in row.iter_mut().zip(pivot).skip(k + 1) {
                *entry -= factor * above;
            }
        }
        // This is false for NaN too.
        pivot[k] > 0.0 && pivot[k].is_finite()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `A v = λ v`, and unit vectors at right angles: some ten units of rounding of matrices of size 1.
    #[test]
    fn vectors_are_turned_into_their_multiples() {
        let mut rng = fastrand::Rng::with_seed(7);
        for _ in 0..1000 {
            let half: [[f64; 3]; 3] =
                std::array::from_fn(|_| std::array::from_fn(|_| 2.0 * rng.f64() - 1.0));
            let matrix: Symmetric<3> =
                std::array::from_fn(|i| std::array::from_fn(|j| half[i][j] + half[j][i]));
            let pairs = eigen(&matrix);
            for (k, (value, vector)) in pairs.iter().enumerate() {
                for i in 0..3 {
                    let image: f64 = (0..3).map(|j| matrix[i][j] * vector[j]).sum();
                    assert!((image - value * vector[i]).abs() < 4e-15);
                }
                for (l, (_, other)) in pairs.iter().enumerate() {
                    let dot: f64 = (0..3).map(|i| vector[i] * other[i]).sum();
                    assert!((dot - f64::from(u8::from(k == l))).abs() < 4e-15);
                }
            }
            let least = pairs
                .iter()
                .map(|pair| pair.0)
                .fold(f64::INFINITY, f64::min);
            assert_eq!(is_positive(&matrix), least > 0.0, "{least:e}");
        }
    }
}

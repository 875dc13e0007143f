//! Sine and cosine of all joint angles of an arm at once.
//!
//! **Invariant:** the same angle gives the same bits, whatever stands beside it.

/// Sines and cosines of `angles` \[rad\]: `(sin, cos)`.
#[must_use]
pub fn sin_cos<const N: usize>(angles: &[f64; N]) -> ([f64; N], [f64; N]) {
    (angles.map(f64::sin), angles.map(f64::cos))
}

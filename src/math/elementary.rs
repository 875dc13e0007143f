//! Elementary functions with the same bits on every platform. Functions of the standard library differ between
//! platforms.
//!
//! **Invariant:** angles are in radians. Results are as accurate as those of a C library, to about one unit in
//! the last place.

/// Sine and cosine.
pub(crate) fn sin_cos(angle: f64) -> (f64, f64) {
    libm::sincos(angle)
}

/// Angle of the point (`x`, `y`), in [-π, π].
pub(crate) fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// Length of (`x`, `y`), without intermediate overflow.
pub(crate) fn hypot(x: f64, y: f64) -> f64 {
    libm::hypot(x, y)
}

/// `base` to the power of `exponent`.
pub(crate) fn pow(base: f64, exponent: f64) -> f64 {
    libm::pow(base, exponent)
}

/// Cube root.
pub(crate) fn cbrt(x: f64) -> f64 {
    libm::cbrt(x)
}

/// Natural logarithm.
pub(crate) fn ln(x: f64) -> f64 {
    libm::log(x)
}

/// Logarithm to base 2.
pub(crate) fn log2(x: f64) -> f64 {
    libm::log2(x)
}

/// 2 to the power of `x`.
pub(crate) fn exp2(x: f64) -> f64 {
    libm::exp2(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_and_logarithms_are_those_of_the_standard_library_to_a_few_units() {
        for x in [0.3, 1.7, 250.0_f64] {
            for (got, want) in [
                (pow(x, 1.5), x.powf(1.5)),
                (cbrt(x), x.cbrt()),
                (ln(x), x.ln()),
                (log2(x), x.log2()),
                (exp2(x), x.exp2()),
            ] {
                let off = (got - want).abs();
                assert!(off <= 1e-15 * want.abs(), "{x}: {got} and {want}");
            }
        }
    }
}

//! Sine and cosine of all joint angles of an arm at once: half of the cost of its dynamics.
//!
//! Every stage is done for all angles before the next begins, so that the compiler can put two of them into one
//! register, and nothing branches on the angle (but for arms that have turned more than 30,000 times). The same
//! operations in the same order on every platform: the physics does not hang on the C library.
//!
//! The angle is reduced to `r = angle - k π/2`, `|r| <= π/4`, with π/2 in three parts, the first two of 36 bits, so
//! that their products with `k < 2¹⁷` are exact (Cody and Waite). What rounding takes from `r` is kept as `tail`. Then
//!
//! `sin(r + tail) = r + (tail + r³ S(r²))`, `cos(r + tail) = 1 - r²/2 + (r⁴ C(r²) - r tail)`
//!
//! with polynomials `S`, `C` of degree 5, minimax in relative error (2⁻⁵⁷ of the sine, 2⁻⁶³ of the cosine; Remez
//! exchange in 60 digits), and the quadrant `k mod 4` exchanges the two and sets their signs.
//!
//! Error against 60-digit values: at most 0.88 ulp in 300,000 angles up to the limit, 0.50 ulp at the doubles next to
//! each of the multiples of π/2 up to it. So it is never more than one floating-point number from the C library's. The
//! sine of -0 is 0.
//!
//! **Invariant:** the same angle gives the same bits, whatever stands beside it.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N of arrays that have N elements, and over the six coefficients"
)]
use std::array::from_fn;
use std::f64::consts::FRAC_2_PI;

/// Largest magnitude of an angle \[rad\] for which the reduction holds: beyond it `k` would need more than 17 bits.
const LIMIT: f64 = 2.0e5;

/// Adding this rounds to an integer, which is then in the low bits of the sum: `1.5 * 2^52`.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// π/2 in parts of 36, 36 and 53 bits.
const HALF_PI: [f64; 3] = [
    1.570_796_326_792_333_3,
    2.563_344_151_583_955_8e-12,
    1.056_299_906_698_742_8e-23,
];

/// `(sin r - r) / r³` in powers of `r²`.
const S: [f64; 6] = [
    -0.166_666_666_666_666_3,
    0.008_333_333_333_322_118,
    -0.000_198_412_698_295_895_4,
    2.755_731_362_138_567_6e-6,
    -2.505_074_776_285_035e-8,
    1.589_623_015_722_155_2e-10,
];

/// `(cos r - 1 + r²/2) / r⁴` in powers of `r²`.
const C: [f64; 6] = [
    0.041_666_666_666_666_595,
    -0.001_388_888_888_887_305_6,
    2.480_158_728_885_170_4e-5,
    -2.755_731_417_929_674e-7,
    2.087_570_084_197_472_6e-9,
    -1.135_853_652_138_747_7e-11,
];

/// Sines and cosines of `angles` \[rad\], in this order. Not a number where an angle is not finite.
#[must_use]
#[inline(always)]
pub fn sin_cos<const N: usize>(angles: &[f64; N]) -> ([f64; N], [f64; N]) {
    let shifted = angles.map(|angle| angle * FRAC_2_PI + ROUND);
    let k = shifted.map(|shifted| shifted - ROUND);
    let first: [f64; N] = from_fn(|i| angles[i] - k[i] * HALF_PI[0]);
    let second = k.map(|k| k * HALF_PI[1]);
    let r: [f64; N] = from_fn(|i| first[i] - second[i]);
    let tail: [f64; N] = from_fn(|i| ((first[i] - r[i]) - second[i]) - k[i] * HALF_PI[2]);

    let r2 = r.map(|r| r * r);
    let r4 = r2.map(|r2| r2 * r2);
    let r8 = r4.map(|r4| r4 * r4);
    let polynomial = |p: [f64; 6]| -> [f64; N] {
        // Pairwise (Estrin), which waits half as long as Horner's rule.
        from_fn(|i| {
            (p[0] + p[1] * r2[i]) + r4[i] * (p[2] + p[3] * r2[i]) + r8[i] * (p[4] + p[5] * r2[i])
        })
    };
    let (s, c) = (polynomial(S), polynomial(C));
    let sine: [f64; N] = from_fn(|i| r[i] + (tail[i] + r[i] * r2[i] * s[i]));
    let cosine: [f64; N] = from_fn(|i| {
        let half = 0.5 * r2[i];
        let head = 1.0 - half;
        head + (((1.0 - head) - half) + (r4[i] * c[i] - r[i] * tail[i]))
    });

    let mut sin = [0.0; N];
    let mut cos = [0.0; N];
    for i in 0..N {
        let quadrant = shifted[i].to_bits();
        let odd = 0_u64.wrapping_sub(quadrant & 1);
        let (sine, cosine) = (sine[i].to_bits(), cosine[i].to_bits());
        let exchange = (sine ^ cosine) & odd;
        let negative_sine = (quadrant & 2) << 62;
        let negative_cosine = (quadrant.wrapping_add(1) & 2) << 62;
        sin[i] = f64::from_bits(sine ^ exchange ^ negative_sine);
        cos[i] = f64::from_bits(cosine ^ exchange ^ negative_cosine);
    }
    if !angles.iter().all(|angle| angle.abs() <= LIMIT) {
        replace_far(angles, &mut sin, &mut cos);
    }
    (sin, cos)
}

/// The C library's sine and cosine wherever the angle is beyond the limit or not finite.
#[cold]
#[inline(never)]
fn replace_far<const N: usize>(angles: &[f64; N], sin: &mut [f64; N], cos: &mut [f64; N]) {
    for i in 0..N {
        if angles[i].abs() > LIMIT || angles[i].is_nan() {
            (sin[i], cos[i]) = angles[i].sin_cos();
        }
    }
}

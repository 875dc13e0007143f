//! Sine and cosine of all joint angles of an arm at once. They are half of the cost of its dynamics.
//!
//! Almost every stage is done for all angles before the next begins, so that the compiler can put two of them into one
//! register. There is no branch on the angle, except for arms that have turned more than 30,000 times. Every
//! platform executes the same operations in the same order. Results do not depend on the platform's libm.
//!
//! The angle is reduced to `r = angle - k π/2`, `|r| <= π/4`, with π/2 in three parts, the first two of 36 bits, so
//! that their products with `k < 2¹⁷` are exact (Cody and Waite). The rounding error of `r` is kept as `tail`. Then
//!
//! `sin(r + tail) = r + (tail + r³ S(r²))`, `cos(r + tail) = 1 - r²/2 + (r⁴ C(r²) - r tail)`
//!
//! with polynomials `S`, `C` of degree 5, minimax in relative error (2⁻⁵⁷ of the sine, 2⁻⁶³ of the cosine; Remez
//! exchange in 60 digits). The quadrant `k mod 4` exchanges the two and sets their signs.
//!
//! The error is below 1 ulp: against more exact values it was at most 0.98 ulp in 10 million angles up to the limit, next
//! to odd multiples of π/4. At the doubles next to multiples of π/2 it is at most 0.50 ulp. So a result differs from the C
//! library's by at most one floating-point number. The sine of -0 is 0.
//!
//! **Invariant:** the same angle gives the same bits in every lane.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N of arrays that have N elements, and over the six coefficients"
)]
use std::f64::consts::FRAC_2_PI;

use super::number::{Number, entries};

/// Largest magnitude of an angle \[rad\] for which the reduction is exact. Beyond it `k` would need more than 17 bits.
pub(super) const LIMIT: f64 = 2.0e5;

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

/// Sines and cosines of `angles` \[rad\], in this order. NaN if an angle is not finite.
#[must_use]
#[inline(always)]
pub fn sin_cos<T: Number, const N: usize>(angles: &[T; N]) -> ([T; N], [T; N]) {
    let (mut sin, mut cos) = sin_cos_within(angles);
    if !T::all_within(angles, LIMIT) {
        // The entries are passed one by one. Otherwise this rare call would force the arrays into memory.
        let (any, replaced) = (angles[0], replaced_far(*angles, sin, cos));
        sin = entries!(any, i => replaced.0[i]);
        cos = entries!(any, i => replaced.1[i]);
    }
    (sin, cos)
}

/// Sines and cosines of angles within [`LIMIT`]. The last angle is first, because an arm's dynamics begin at its tip.
#[inline(always)]
pub(super) fn sin_cos_within<T: Number, const N: usize>(angles: &[T; N]) -> ([T; N], [T; N]) {
    let any = angles[0];
    let angles = entries!(any, i => angles[N - 1 - i]);
    let shifted = entries!(any, i => angles[i] * FRAC_2_PI + ROUND);
    let k = entries!(any, i => shifted[i] + -ROUND);
    let first = entries!(any, i => angles[i].sub_exact_product(k[i], HALF_PI[0]));
    // A product that is used twice is computed once: multipliers are what the registers wait for. It is exact, so the
    // bits are those of a fused operation.
    let second = entries!(any, i => k[i] * HALF_PI[1]);
    let r = entries!(any, i => first[i] - second[i]);
    let tail = entries!(any, i => ((first[i] - r[i]) - second[i]) - k[i] * HALF_PI[2]);

    let r2 = entries!(any, i => r[i] * r[i]);
    let r4 = entries!(any, i => r2[i] * r2[i]);
    // Terms of low degree are added while those of high degree are still multiplied, so few sums wait for the last
    // product.
    let c = entries!(any, i => upper(C, r2[i], r4[i]));
    let s = entries!(any, i => upper(S, r2[i], r4[i]));
    let r3 = entries!(any, i => r[i] * r2[i]);
    let (mut sin, mut cos) = (s, c);
    if T::LANES == 1 {
        // The compiler puts single numbers into one register only if all stages are done for all angles.
        let sine = entries!(any, i => sine(r[i], tail[i], [r2[i], r3[i], r4[i]], s[i]));
        let cosine = entries!(any, i => cosine(r[i], tail[i], [r2[i], r4[i]], c[i]));
        for i in 0..N {
            (sin[N - 1 - i], cos[N - 1 - i]) = shifted[i].turned(sine[i], cosine[i]);
        }
    } else {
        // Angle by angle, fewer operations wait in the processor's scheduler for earlier ones.
        for i in 0..N {
            let sine = sine(r[i], tail[i], [r2[i], r3[i], r4[i]], s[i]);
            let cosine = cosine(r[i], tail[i], [r2[i], r4[i]], c[i]);
            (sin[N - 1 - i], cos[N - 1 - i]) = shifted[i].turned(sine, cosine);
        }
    }
    (sin, cos)
}

#[inline(always)]
fn sine<T: Number>(r: T, tail: T, [r2, r3, r4]: [T; 3], upper: T) -> T {
    let low = tail + r3 * (r2 * S[1] + S[0]);
    r + (low + r3 * r4 * upper)
}

#[inline(always)]
fn cosine<T: Number>(r: T, tail: T, [r2, r4]: [T; 2], upper: T) -> T {
    let one = r.like(1.0);
    let half = r2 * 0.5;
    let head = one - half;
    let low = r4 * (r2 * C[1] + C[0]) - r * tail;
    head + ((((one - head) - half) + low) + r4 * r4 * upper)
}

/// The terms of `p` from the third on, over the second power of its variable, which is `r2`.
#[inline(always)]
fn upper<T: Number>(p: [f64; 6], r2: T, r4: T) -> T {
    (r2 * p[3] + p[2]) + r4 * (r2 * p[5] + p[4])
}

/// The sine and cosine of the `libm` crate, which is the same on every platform, if the angle is beyond the limit or not
/// finite.
#[cold]
#[inline(never)]
fn replaced_far<T: Number, const N: usize>(
    angles: [T; N],
    mut sin: [T; N],
    mut cos: [T; N],
) -> ([T; N], [T; N]) {
    for i in 0..N {
        for lane in 0..T::LANES {
            let angle = angles[i].lane(lane);
            if angle.abs() > LIMIT || angle.is_nan() {
                let (sine, cosine) = libm::sincos(angle);
                sin[i].set_lane(lane, sine);
                cos[i].set_lane(lane, cosine);
            }
        }
    }
    (sin, cos)
}

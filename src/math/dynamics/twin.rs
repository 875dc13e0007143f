//! x
#![allow(clippy::indexing_slicing, reason = "x")]
use super::articulated_body::accelerations;
use crate::math::arm::{Arm, Rod};
use crate::math::number::{Arithmetic, Number, Twin, entries};
use crate::math::trig;
use fearless_simd::Simd;

#[inline(always)]
pub(super) fn forward<S: Simd, const N: usize>(simd: S, arm: &Arm<N>, q: &[f64; N], qd: &[f64; N], tau: &[f64; N]) -> [f64; N] {
    let zero = Twin::one(simd, 0.0);
    let (mut sin, mut cos) = ([zero; N], [zero; N]);
    let mut i = 0;
    while i + 1 < N {
        let ([s], [c]) = trig::sin_cos(&[Twin::two(simd, q[i], q[i + 1])]);
        sin[i] = s; sin[i + 1] = s.upper();
        cos[i] = c; cos[i + 1] = c.upper();
        i += 2;
    }
    if i < N {
        let ([s], [c]) = trig::sin_cos(&[Twin::one(simd, q[i])]);
        sin[i] = s; cos[i] = c;
    }
    let one = |x: f64| Twin::one(simd, x);
    let rods = entries!(rod(&arm.rods[0], simd), i => rod(&arm.rods[i], simd));
    let qd = entries!(zero, i => one(qd[i]));
    let tau = entries!(zero, i => one(tau[i]));
    let a = accelerations::<Twin<S>, N, true>(&rods, &one(arm.gravity), &sin, &cos, &qd, &tau);
    let mut out = [0.0; N];
    for i in 0..N { out[i] = a[i].lane(0); }
    out
}
#[inline(always)]
fn rod<S: Simd>(rod: &Rod, simd: S) -> Rod<Twin<S>> {
    Rod {
        length: Twin::one(simd, rod.length),
        beyond: Twin::one(simd, rod.beyond),
        mass_ratio: Twin::one(simd, rod.mass_ratio),
        per_length: Twin::one(simd, rod.per_length),
        per_mass_length: Twin::one(simd, rod.per_mass_length),
    }
}

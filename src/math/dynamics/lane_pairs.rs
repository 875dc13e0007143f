//! One arm in the lower lanes of two-lane registers, with sines and cosines in both lanes: the fastest layout on
//! baseline `x86-64`.
//!
//! The compiler alone packs numbers of the recursion into pairs. That saves instructions, but shuffles each pair on
//! the critical path: with 3 links a third of the time. Values that are in a two-lane register from the start need no
//! shuffle.
//!
//! **Invariant:** results are bit-identical to the same recursion over plain numbers.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N of arrays that have N elements"
)]

use fearless_simd::{Simd, Sse2, f64x2};

use super::articulated_body::recursion_along;
use crate::math::arm::{Arm, Rod};
use crate::math::number::{Arithmetic, Number, Wide, entries};
use crate::math::trig;

/// Computes [`super::forward_dynamics`], with or without gravity.
#[inline(always)]
pub(super) fn accelerations<const N: usize, const USES_FIRST_ANGLE: bool>(
    simd: Sse2,
    arm: &Arm<N>,
    q: &[f64; N],
    qd: &[f64; N],
    tau: &[f64; N],
) -> [f64; N] {
    let zero = alone(simd, 0.0);
    let (mut sin, mut cos) = ([zero; N], [zero.like(1.0); N]);
    let mut i = if USES_FIRST_ANGLE { 0 } else { 1 };
    while i + 1 < N {
        let ([sines], [cosines]) = trig::sin_cos(&[Wide::two(simd, q[i], q[i + 1])]);
        (sin[i], sin[i + 1]) = (sines, sines.upper());
        (cos[i], cos[i + 1]) = (cosines, cosines.upper());
        i += 2;
    }
    if i < N {
        ([sin[i]], [cos[i]]) = trig::sin_cos(&[alone(simd, q[i])]);
    }
    let rods = entries!(rod(simd, &arm.rods[0]), i => rod(simd, &arm.rods[i]));
    let qd = entries!(zero, i => alone(simd, qd[i]));
    let tau = entries!(zero, i => alone(simd, tau[i]));
    let gravity = alone(simd, arm.gravity);
    let found = recursion_along::<_, N, USES_FIRST_ANGLE>(&rods, &gravity, (&sin, &cos), &qd, &tau);
    let mut accelerations = [0.0; N];
    for i in 0..N {
        accelerations[i] = found[i].lane(0);
    }
    accelerations
}

/// A number in the lower lane and 0 in the upper, as after a load.
#[inline(always)]
fn alone<S: Simd<f64s = f64x2<S>>>(simd: S, value: f64) -> Wide<S, 1> {
    Wide::two(simd, value, 0.0)
}

#[inline(always)]
fn rod(simd: Sse2, rod: &Rod) -> Rod<Wide<Sse2, 1>> {
    Rod {
        length: alone(simd, rod.length),
        beyond: alone(simd, rod.beyond),
        mass_ratio: alone(simd, rod.mass_ratio),
        per_length: alone(simd, rod.per_length),
        per_mass_length: alone(simd, rod.per_mass_length),
    }
}

#[cfg(test)]
mod tests {
    use super::super::articulated_body::recursion;
    use super::*;
    use fearless_simd::Level;

    fn check<const N: usize>() {
        let simd = Level::baseline().as_sse2().unwrap();
        let mut rng = fastrand::Rng::with_seed(1);
        let mut each = |least: f64, most: f64| -> [f64; N] {
            std::array::from_fn(|_| least + (most - least) * rng.f64())
        };
        for case in 0..2000 {
            let arm = Arm::new(each(0.1, 10.0), each(0.01, 10.0), 9.81).unwrap();
            let far = if case % 10 == 0 { 1e6 } else { 10.0 };
            let (q, qd, tau) = (each(-far, far), each(-5.0, 5.0), each(-20.0, 20.0));
            let plain = recursion::<f64, N, true>(&arm.rods, &arm.gravity, &q, &qd, &tau);
            let packed = accelerations::<N, true>(simd, &arm, &q, &qd, &tau);
            assert_eq!(
                plain.map(f64::to_bits),
                packed.map(f64::to_bits),
                "{arm:?} {q:?}"
            );
            let plain = recursion::<f64, N, false>(&arm.rods, &arm.gravity, &q, &qd, &tau);
            let packed = accelerations::<N, false>(simd, &arm, &q, &qd, &tau);
            assert_eq!(
                plain.map(f64::to_bits),
                packed.map(f64::to_bits),
                "{arm:?} {q:?}"
            );
        }
    }

    #[test]
    fn an_arm_has_the_same_bits_in_registers_of_two() {
        check::<1>();
        check::<2>();
        check::<3>();
        check::<4>();
        check::<5>();
    }
}

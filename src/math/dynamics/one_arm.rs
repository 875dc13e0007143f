//! The accelerations of one arm.
//!
//! **Invariant:** results are bit-identical for every SIMD width.

use super::articulated_body::recursion;
use crate::math::arm::Arm;

/// Joint accelerations \[rad/s²\] at positions `q` \[rad\] and rates `qd` \[rad/s\] under the efforts `tau` \[N m\].
///
/// Never panics. The result is not finite if the input is not, or if an intermediate value exceeds the range of
/// `f64` (mass ratios of about 1e75 between neighbours).
#[must_use]
#[inline(always)]
pub fn forward_dynamics<const N: usize>(
    arm: &Arm<N>,
    q: &[f64; N],
    qd: &[f64; N],
    tau: &[f64; N],
) -> [f64; N] {
    accelerations::<N, true>(arm, q, qd, tau)
}

/// [`forward_dynamics`] of an arm without gravity, in fewer instructions. The results are bit-identical, except the
/// sign of an acceleration of zero. The first angle is not used, and need not be finite.
#[must_use]
#[inline(always)]
pub fn weightless_dynamics<const N: usize>(
    arm: &Arm<N>,
    q: &[f64; N],
    qd: &[f64; N],
    tau: &[f64; N],
) -> [f64; N] {
    accelerations::<N, false>(arm, q, qd, tau)
}

#[inline(always)]
fn accelerations<const N: usize, const USES_FIRST_ANGLE: bool>(
    arm: &Arm<N>,
    q: &[f64; N],
    qd: &[f64; N],
    tau: &[f64; N],
) -> [f64; N] {
    #[cfg(all(feature = "batch", target_arch = "x86_64"))]
    if let Some(simd) = fearless_simd::Level::baseline().as_sse2() {
        return super::lane_pairs::accelerations::<N, USES_FIRST_ANGLE>(simd, arm, q, qd, tau);
    }
    recursion::<f64, N, USES_FIRST_ANGLE>(&arm.rods, &arm.gravity, q, qd, tau)
}

//! Forward dynamics by a planar articulated-body recursion in sums of positive terms.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N of arrays that have N elements, as they do in the formulas"
)]

use super::super::arm::Arm;
use super::super::trig;

/// Joint accelerations \[rad/s²\] at `q` \[rad\], `qd` \[rad/s\] under the efforts `tau` \[N m\].
#[must_use]
#[inline]
pub fn forward_dynamics<const N: usize>(
    arm: &Arm<N>,
    q: &[f64; N],
    qd: &[f64; N],
    tau: &[f64; N],
) -> [f64; N] {
    let (sin, cos) = trig::sin_cos(q);
    let of = &arm.derived;
    let mut rate = 0.0;
    let w: [f64; N] = std::array::from_fn(|i| {
        rate += qd[i];
        arm.lengths()[i] * rate * rate
    });
    // What is carried by the tip of link i, in its frame and in units of its mass.
    let (mut a, mut b, mut c, mut d) = (0.0, 0.0, 0.0, 0.0);
    let (mut bx, mut by) = (0.0, 0.0);
    let mut saved = [(0.0, 0.0, 0.0); N];
    let mut outer = 0.0;
    for i in (0..N).rev() {
        let u = (tau[i] - outer) * of.per_mass_length[i];
        outer = tau[i];
        let pw = 1.0 / (1.0 + 3.0 * c);
        let z = u - by;
        saved[i] = (pw, b, z);
        if i == 0 {
            break;
        }
        let x = 1.0 + a + 3.0 * (c + d);
        let px = 1.0 / x;
        let xx = x * pw;
        let k = -0.5 * b * px;
        let rest = (0.25 * (1.0 + a) + c + d) * px;
        let fx = bx + 3.0 * b * pw * z - w[i] * ((a + 3.0 * d) * pw + 0.5);
        let fy = u + 0.5 * pw * (z + w[i] * b);
        let (s, co) = (sin[i], cos[i]);
        let r = of.mass_ratio[i];
        let vx = co - s * k;
        let vy = s + co * k;
        a = r * (xx * vx * vx + rest * s * s);
        c = r * (xx * vy * vy + rest * co * co);
        b = r * (xx * vx * vy - rest * s * co);
        d = r * r * xx * rest;
        bx = r * (co * fx - s * fy);
        by = r * (s * fx + co * fy);
    }
    let (mut px, mut py) = (0.0, arm.gravity());
    let mut inner = 0.0;
    std::array::from_fn(|i| {
        (px, py) = (cos[i] * px + sin[i] * py, cos[i] * py - sin[i] * px);
        let (pw, b, z) = saved[i];
        let tx = px - w[i];
        let ty = pw * (3.0 * (z - b * tx) - 0.5 * py);
        let alpha = (ty - py) * of.per_length[i];
        let qdd = alpha - inner;
        inner = alpha;
        (px, py) = (tx, ty);
        qdd
    })
}

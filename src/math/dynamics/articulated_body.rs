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
    let (mut x, mut d, mut phi, mut psi, mut vx, mut vy, mut s, mut c) =
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    let mut saved = [(0.0, 0.0, 0.0); N];
    let mut outer = 0.0;
    for i in (0..N).rev() {
        let u = (tau[i] - outer) * of.per_mass_length[i];
        outer = tau[i];
        let axx = x * vx * vx + d * s * s;
        let axy = x * vx * vy - d * s * c;
        let ayy = x * vy * vy + d * c * c;
        let det = x * d;
        let bx = x * phi * vx - psi * s;
        let by = x * phi * vy + psi * c;
        let big_w = 1.0 + 3.0 * ayy;
        let per_w = 1.0 / big_w;
        saved[i] = (3.0 * per_w * (u - by), 3.0 * per_w * axy, 0.5 * per_w);
        if i == 0 {
            break;
        }
        let big_x = 1.0 + axx + 3.0 * (ayy + det);
        let per_x = 1.0 / big_x;
        let k = -0.5 * axy * per_x;
        let e1 = x * (d * phi * c - psi * vy);
        let e2 = x * (d * phi * s + psi * vx);
        phi = (bx + 3.0 * (e1 + axy * u) + 0.5 * w[i] * big_w) * per_x - w[i];
        psi = u + (u * (1.0 + axx) + 0.5 * axy * w[i] - by - e2) * (0.5 * per_x);
        let r = of.mass_ratio[i];
        psi *= r;
        x = r * (big_x * per_w);
        d = r * ((0.25 * (1.0 + axx) + ayy + det) * per_x);
        (s, c) = (sin[i], cos[i]);
        (vx, vy) = (c - s * k, s + c * k);
    }
    let (mut px, mut py) = (0.0, arm.gravity());
    let mut inner = 0.0;
    std::array::from_fn(|i| {
        (px, py) = (cos[i] * px + sin[i] * py, cos[i] * py - sin[i] * px);
        let (z, b, h) = saved[i];
        let tx = px - w[i];
        let ty = (z - h * py) - b * tx;
        let alpha = (ty - py) * of.per_length[i];
        let qdd = alpha - inner;
        inner = alpha;
        (px, py) = (tx, ty);
        qdd
    })
}

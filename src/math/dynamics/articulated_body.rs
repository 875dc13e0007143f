//! Forward dynamics by a planar articulated-body recursion in sums of positive terms.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N of arrays that have N elements, as they do in the formulas"
)]

use super::super::arm::Arm;
use super::super::trig;
use glam::DVec2;

/// Joint accelerations \[rad/s²\] at `q` \[rad\], `qd` \[rad/s\] under the efforts `tau` \[N m\].
#[must_use]
#[inline(always)]
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
    let mut outer = 0.0;
    let mut hinges = [(0.0, 0.0, 0.0); N];
    let mut load = Load {
        a: 0.0,
        b: 0.0,
        c: 0.0,
        det: 0.0,
        bias: DVec2::ZERO,
        e: DVec2::ZERO,
    };
    for i in (0..N).rev() {
        let u = (tau[i] - outer) * of.per_mass_length[i];
        outer = tau[i];
        let big_w = 1.0 + 3.0 * load.c;
        let per_w = 1.0 / big_w;
        hinges[i] = (
            3.0 * per_w * (u - load.bias.y),
            3.0 * per_w * load.b,
            0.5 * per_w,
        );
        if i > 0 {
            let link = if i + 1 == N {
                Link {
                    x: 1.0,
                    k: 0.0,
                    d: 0.25,
                    phi: -0.5 * w[i],
                    psi: 1.5 * u,
                }
            } else {
                load.inner(u, w[i], big_w, per_w)
            };
            let dir = DVec2::new(cos[i], sin[i]);
            load = if i + 1 == N {
                link.carry_straight(of.mass_ratio[i], dir)
            } else {
                link.carry(of.mass_ratio[i], dir)
            };
        }
    }
    let mut p = DVec2::new(0.0, arm.gravity());
    let mut inner = 0.0;
    std::array::from_fn(|i| {
        let dir = DVec2::new(cos[i], sin[i]);
        p = DVec2::new(dir.dot(p), dir.perp_dot(p));
        let (z, b, h) = hinges[i];
        let tx = p.x - w[i];
        let ty = (z - h * p.y) - b * tx;
        let alpha = (ty - p.y) * of.per_length[i];
        let qdd = alpha - inner;
        inner = alpha;
        p = DVec2::new(tx, ty);
        qdd
    })
}

#[derive(Clone, Copy)]
struct Link {
    x: f64,
    k: f64,
    d: f64,
    phi: f64,
    psi: f64,
}

impl Link {
    #[inline(always)]
    fn carry_straight(self, ratio: f64, u: DVec2) -> Load {
        self.carry_along(ratio, u, u)
    }
    #[inline(always)]
    fn carry(self, ratio: f64, u: DVec2) -> Load {
        self.carry_along(ratio, u, u + self.k * u.perp())
    }
    #[inline(always)]
    fn carry_along(self, ratio: f64, u: DVec2, v: DVec2) -> Load {
        let x = ratio * self.x;
        let d = ratio * self.d;
        let psi = ratio * self.psi;
        let w = u.perp();
        Load {
            a: x * v.x * v.x + d * w.x * w.x,
            b: x * v.x * v.y + d * w.x * w.y,
            c: x * v.y * v.y + d * w.y * w.y,
            det: x * d,
            bias: x * self.phi * v + psi * w,
            e: x * (d * self.phi * u + psi * v.perp()),
        }
    }
}

#[derive(Clone, Copy)]
struct Load {
    a: f64,
    b: f64,
    c: f64,
    det: f64,
    bias: DVec2,
    e: DVec2,
}

impl Load {
    #[inline(always)]
    fn inner(&self, u: f64, w: f64, big_w: f64, per_w: f64) -> Link {
        let big_x = 1.0 + self.a + 3.0 * (self.c + self.det);
        let per_x = 1.0 / big_x;
        Link {
            x: big_x * per_w,
            k: -0.5 * self.b * per_x,
            d: (0.25 * (1.0 + self.a) + self.c + self.det) * per_x,
            phi: (self.bias.x + 3.0 * (self.e.x + self.b * u) + 0.5 * w * big_w) * per_x - w,
            psi: u
                + (u * (1.0 + self.a) + 0.5 * self.b * w - self.bias.y - self.e.y) * (0.5 * per_x),
        }
    }
}

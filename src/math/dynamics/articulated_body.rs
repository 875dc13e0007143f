//! Forward dynamics by an articulated-body recursion in which nothing cancels.
//!
//! A joint transmits a force and an effort, and the effort is known. So all that link `i` with everything beyond it is
//! to the link before is a relation between the acceleration `p` of its joint and the force `f` through it: `f = A p +
//! B`, with a symmetric positive definite 2×2 tensor `A`. One pass from the tip to the base finds every `A` and `B`,
//! one pass back the accelerations.
//!
//! In the frame of link `i` (x along it, y across it) and in units of its mass, let its tip carry `A = (a b; b c)` and
//! `B`. With `u = (τ_i - τ_{i+1}) / (m_i l_i)`, `w = l_i φ̇_i²`, `W = 1 + 3c`, `X = 1 + a + 3c + 3 det A` and `E = det
//! A · A⁻¹ B`, Newton and Euler give for a uniform rod, whatever its length:
//!
//! | | |
//! | --- | --- |
//! | acceleration of its tip | `t_x = p_x - w`, `t_y = 3 (u - B_y - b t_x) / W - p_y / 2W` |
//! | what it is to the link before | `A' = x v vᵀ + d y yᵀ`, `B' = x φ v + ψ y`, along `v = (1, k)` and `y = (0, 1)` |
//! | stiff and soft part of `A'` | `x = X / W`, `d = ((1 + a) / 4 + c + det A) / X`, `k = -b / 2X` |
//! | stiff part of `B'` | `φ = (B_x + 3 E_x + 3 b u + w W / 2) / X - w` |
//! | soft part of `B'` | `ψ = u + ((1 + a) u + b w / 2 - B_y - E_y) / 2X` |
//!
//! Why so: the masses enter by sums of positive terms alone. `A'` is kept as two squares, because squares stay squares
//! when they are turned into the frame of the link before; turned as a matrix it would cancel. `B'` is kept along the
//! same two directions, because a heavy tip makes `x` 1e9 times `d`: as a plain vector, the rounding error of its stiff
//! part would bury the soft one. `E` comes from these parts too. Each of the two costs up to ten digits otherwise.
//! Rotations are taken joint by joint, so that a joint wound up by 1e8 rad costs nothing either. Gravity is an upward
//! acceleration of the base. Without it nothing depends on where the first link points to, and
//! [`weightless_dynamics`] leaves out that angle's sine and cosine.
//!
//! Lost on the stored arms of 1 to 6 links, masses 1e-9 to 1e9, lengths 1e-6 to 1e6: at most one digit, and 1.2 with a
//! heavy tip (`tests/math/`). Known limit: where masses *and* lengths spread by many powers of ten at once,
//! such as 1e7 kg in 0.1 mm at the end of 500 km of gram-light links, the joint of the tiny tip may lose eight.
//!
//! **Invariant:** one kernel for every arm and every n. Source of the method: Featherstone, *Rigid Body Dynamics
//! Algorithms* (2008), ch. 7; the split into two directions is our own.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N of arrays that have N elements, as they do in the formulas"
)]

use std::ops::Add;

use crate::math::arm::{Arm, Rod};
use crate::math::number::{Number, entries};
use crate::math::trig;

/// Joint accelerations \[rad/s²\] at positions `q` \[rad\] and rates `qd` \[rad/s\] under the efforts `tau` \[N m\].
///
/// Never panics. The result is not finite where the input is not, or where an intermediate value leaves the range
/// of `f64` (mass ratios of about 1e150 between neighbours).
#[must_use]
#[inline(always)]
pub fn forward_dynamics<const N: usize>(
    arm: &Arm<N>,
    q: &[f64; N],
    qd: &[f64; N],
    tau: &[f64; N],
) -> [f64; N] {
    recursion::<f64, N, true>(&arm.rods, &arm.gravity, q, qd, tau)
}

/// [`forward_dynamics`] of an arm whose gravity is zero: the same bits, but for the sign of an acceleration of zero,
/// for fewer instructions. The first angle is not looked at, not even whether it is finite.
#[must_use]
#[inline(always)]
pub fn weightless_dynamics<const N: usize>(
    arm: &Arm<N>,
    q: &[f64; N],
    qd: &[f64; N],
    tau: &[f64; N],
) -> [f64; N] {
    recursion::<f64, N, false>(&arm.rods, &arm.gravity, q, qd, tau)
}

/// The joint accelerations of one arm or of several side by side, with or without gravity.
#[inline(always)] // all of it: the recursion is unrolled, and what is constant at its two ends disappears
pub(in crate::math) fn recursion<T: Number, const N: usize, const WEIGHS: bool>(
    rods: &[Rod<T>; N],
    gravity: &T,
    q: &[T; N],
    qd: &[T; N],
    tau: &[T; N],
) -> [T; N] {
    let zero = q[0].like(0.0);
    let (sin, cos) = if WEIGHS {
        trig::sin_cos(q)
    } else {
        sin_cos_beyond_first(q)
    };
    let mut rate = qd[0];
    let w = entries!(zero, i => {
        if i > 0 {
            rate = rate + qd[i];
        }
        rods[i].length * rate * rate
    });

    // From the tip to the base: what each link carries, and how its tip will answer its joint.
    let mut carried = Carried::nothing(zero);
    let mut hinges = [Hinge::none(zero); N];
    let mut outer = zero;
    for i in (0..N).rev() {
        let u = (tau[i] - outer) * rods[i].per_mass_length;
        outer = tau[i];
        let big_w = carried.c * 3.0 + 1.0;
        let per_w = zero.like(1.0) / big_w;
        hinges[i] = Hinge {
            free: per_w * 3.0 * (u - carried.bias.y),
            along: per_w * 3.0 * carried.b,
            across: per_w * 0.5,
        };
        if i > 0 {
            let x_axis = Planar::new(cos[i], sin[i]);
            carried = if i + 1 == N {
                Body::bare(u, w[i]).turned(rods[i].mass_ratio, x_axis, x_axis)
            } else {
                let body = carried.with_rod(u, w[i], big_w, per_w);
                let v = x_axis + x_axis.perp().scaled(body.k);
                body.turned(rods[i].mass_ratio, x_axis, v)
            };
        }
    }

    // From the base to the tip: accelerations, gravity being an acceleration of the base upwards.
    let mut tip = Planar::new(zero, if WEIGHS { *gravity } else { zero });
    let mut inner = zero;
    entries!(zero, i => {
        let x_axis = Planar::new(cos[i], sin[i]);
        let joint = Planar::new(x_axis.dot(tip), x_axis.perp_dot(tip));
        let along = joint.x - w[i];
        let mut across = hinges[i].free - hinges[i].across * joint.y;
        if i + 1 < N {
            across = across - hinges[i].along * along;
        }
        tip = Planar::new(along, across);
        let link = (across - joint.y) * rods[i].per_length;
        let relative = link - inner;
        inner = link;
        relative
    })
}

/// Sines and cosines of all angles but the first, for which those of 0 stand.
#[inline(always)]
fn sin_cos_beyond_first<T: Number, const N: usize>(q: &[T; N]) -> ([T; N], [T; N]) {
    // The constant stands last, where the compiler takes its sine and cosine and finds the others side by side: with it
    // in front a step of 3 links takes fewer instructions and half as long again.
    let zero = q[0].like(0.0);
    let beyond = entries!(zero, i => if i + 1 < N { q[i + 1] } else { zero });
    let (sin, cos) = trig::sin_cos(&beyond);
    (
        entries!(zero, i => sin[(i + N - 1) % N]),
        entries!(zero, i => cos[(i + N - 1) % N]),
    )
}

/// A vector in the plane.
#[derive(Clone, Copy)]
struct Planar<T> {
    x: T,
    y: T,
}

impl<T: Number> Planar<T> {
    #[inline(always)]
    fn new(x: T, y: T) -> Self {
        Self { x, y }
    }

    #[inline(always)]
    fn dot(self, other: Self) -> T {
        self.x * other.x + self.y * other.y
    }

    /// Turned by a right angle.
    #[inline(always)]
    fn perp(self) -> Self {
        Self::new(-self.y, self.x)
    }

    #[inline(always)]
    fn perp_dot(self, other: Self) -> T {
        self.x * other.y - self.y * other.x
    }

    #[inline(always)]
    fn scaled(self, factor: T) -> Self {
        Self::new(factor * self.x, factor * self.y)
    }
}

impl<T: Number> Add for Planar<T> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y)
    }
}

/// How the tip of a link accelerates across it: `t_y = free - along t_x - across p_y`.
#[derive(Clone, Copy)]
struct Hinge<T> {
    free: T,
    along: T,
    across: T,
}

impl<T: Number> Hinge<T> {
    #[inline(always)]
    fn none(zero: T) -> Self {
        Self {
            free: zero,
            along: zero,
            across: zero,
        }
    }
}

/// A link and everything beyond it as its own joint feels it, in its own frame, per unit of its mass:
/// `A' = x v vᵀ + d y yᵀ` with `v = (1, k)`, and `B' = x φ v + ψ y`.
#[derive(Clone, Copy)]
struct Body<T> {
    x: T,
    k: T,
    d: T,
    phi: T,
    psi: T,
}

impl<T: Number> Body<T> {
    /// The outermost link, which carries nothing.
    #[inline(always)]
    fn bare(u: T, w: T) -> Self {
        Self {
            x: u.like(1.0),
            k: u.like(0.0),
            d: u.like(0.25),
            phi: w * -0.5,
            psi: u * 1.5,
        }
    }

    /// The same in the frame of the link before and per unit of *its* mass, from the direction of this link and of
    /// `v` in that frame.
    #[inline(always)]
    fn turned(self, mass_ratio: T, x_axis: Planar<T>, v: Planar<T>) -> Carried<T> {
        let (x, d, psi) = (
            mass_ratio * self.x,
            mass_ratio * self.d,
            mass_ratio * self.psi,
        );
        let y_axis = x_axis.perp();
        Carried {
            a: x * v.x * v.x + d * y_axis.x * y_axis.x,
            b: x * v.x * v.y + d * y_axis.x * y_axis.y,
            c: x * v.y * v.y + d * y_axis.y * y_axis.y,
            det: x * d,
            bias: v.scaled(x * self.phi) + y_axis.scaled(psi),
            e: (x_axis.scaled(d * self.phi) + v.perp().scaled(psi)).scaled(x),
        }
    }
}

/// The load at the tip of a link, in the frame of that link and per unit of its mass: `A = (a b; b c)` and `B`.
#[derive(Clone, Copy)]
struct Carried<T> {
    a: T,
    b: T,
    c: T,
    det: T,
    bias: Planar<T>,
    /// `E = (c B_x - b B_y, a B_y - b B_x)`, without its cancellation.
    e: Planar<T>,
}

impl<T: Number> Carried<T> {
    #[inline(always)]
    fn nothing(zero: T) -> Self {
        Self {
            a: zero,
            b: zero,
            c: zero,
            det: zero,
            bias: Planar::new(zero, zero),
            e: Planar::new(zero, zero),
        }
    }

    /// Adds the rod that carries this and turns about its joint; `W` and `1 / W` are at hand.
    #[inline(always)]
    fn with_rod(&self, u: T, w: T, big_w: T, per_w: T) -> Body<T> {
        let big_x = (self.a + 1.0) + (self.c + self.det) * 3.0;
        let per_x = u.like(1.0) / big_x;
        let along = self.bias.x + (self.e.x + self.b * u) * 3.0 + w * 0.5 * big_w;
        let across = u * (self.a + 1.0) + self.b * 0.5 * w - self.bias.y - self.e.y;
        Body {
            x: big_x * per_w,
            k: self.b * -0.5 * per_x,
            d: ((self.a + 1.0) * 0.25 + self.c + self.det) * per_x,
            phi: along * per_x - w,
            psi: u + across * (per_x * 0.5),
        }
    }
}

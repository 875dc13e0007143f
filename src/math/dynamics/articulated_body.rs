//! Forward dynamics by an articulated-body recursion in which nothing cancels.
//!
//! A joint transmits a force and an effort, and the effort is known. So link `i` and all links beyond it act on the
//! previous link as `f = A p + B`: the force `f` through the joint depends on the joint's acceleration `p`. `A` is a
//! symmetric positive definite 2×2 tensor. A pass from the tip to the base computes every `A` and `B`. A second pass
//! from the base to the tip computes the accelerations.
//!
//! In the frame of link `i` (x along it, y across it) and in units of its mass, let its tip carry `A = (a b; b c)` and
//! `B`. With `u = (τ_i - τ_{i+1}) / (m_i l_i)`, `w = l_i φ̇_i²`, `W = 1 + 3c`, `X = 1 + a + 3c + 3 det A` and `E = det
//! A · A⁻¹ B`, Newton and Euler give for a uniform rod of any length:
//!
//! | | |
//! | --- | --- |
//! | acceleration of its tip | `t_x = p_x - w`, `t_y = 3 (u - B_y - b t_x) / W - p_y / 2W` |
//! | what it is to the link before | `A' = x v vᵀ + d y yᵀ`, `B' = x φ v + ψ y`, along `v = (1, k)` and `y = (0, 1)` |
//! | stiff and soft part of `A'` | `x = X / W`, `d = ((1 + a) / 4 + c + det A) / X`, `k = -b / 2X` |
//! | stiff part of `B'` | `φ = (B_x + 3 E_x + 3 b u + w W / 2) / X - w` |
//! | soft part of `B'` | `ψ = u + ((1 + a) u + b w / 2 - B_y - E_y) / 2X` |
//!
//! A link needs one quotient, `1 / (W X)`. A division has the longest latency, so all independent terms are computed
//! meanwhile, and few operations depend on the result. For the outermost link, which carries nothing, `A'` is `1/4 +
//! 3/4 x xᵀ`.
//!
//! The masses enter only through sums of positive terms. `A'` is kept as two squares, because a rotation into the frame
//! of the previous link keeps squares. A rotated matrix would have cancellation. `B'` is kept along the same two
//! directions, because a heavy tip makes `x` 1e9 times `d`. As a plain vector, the rounding error of its stiff part
//! would bury the soft one. `E` comes from these parts too. Without either of the two, up to ten digits are lost.
//! Rotations are composed joint by joint, so a joint angle of 1e8 rad loses no digits either. Gravity is an upward
//! acceleration of the base. Without gravity nothing depends on the first joint angle, and
//! [`super::weightless_dynamics`] omits its sine and cosine.
//!
//! The stored arms have 2 and 3 links, masses 1e-9 to 1e9 and lengths 1e-6 to 1e6. They lose at most one digit, and 1.2
//! with a heavy tip (`tests/math/`). Known limit: masses *and* lengths that both differ by many powers of ten. An
//! example is 1e7 kg in 0.1 mm at the end of 500 km of links of a gram. There the last joint may lose eight digits.
//!
//! **Invariant:** every arm and every n uses this one kernel. Source of the method: Featherstone, *Rigid Body
//! Dynamics Algorithms* (2008), ch. 7; the split into two directions is our own.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N of arrays that have N elements, as they do in the formulas"
)]

use crate::math::arm::Rod;
use crate::math::number::{Number, entries};
use crate::math::trig;

const THIRD: f64 = 1.0 / 3.0;

/// The joint accelerations of one arm, or of several side by side, with or without gravity.
#[inline(always)] // inlined: the recursion is unrolled, and constants at both ends are folded
pub(in crate::math) fn recursion<T: Number, const N: usize, const USES_FIRST_ANGLE: bool>(
    rods: &[Rod<T>; N],
    gravity: &T,
    q: &[T; N],
    qd: &[T; N],
    tau: &[T; N],
) -> [T; N] {
    let (sin, cos) = if USES_FIRST_ANGLE {
        trig::sin_cos(q)
    } else {
        // The first angle counts as 0, and the compiler evaluates its sine and cosine itself.
        let zero = q[0].like(0.0);
        trig::sin_cos(&entries!(zero, i => if i > 0 { q[i] } else { zero }))
    };
    recursion_along::<T, N, USES_FIRST_ANGLE>(rods, gravity, (&sin, &cos), qd, tau)
}

/// The recursion, given the sines and cosines of all angles. Without gravity the first pair is not used.
#[inline(always)]
pub(super) fn recursion_along<T: Number, const N: usize, const USES_FIRST_ANGLE: bool>(
    rods: &[Rod<T>; N],
    gravity: &T,
    (sin, cos): (&[T; N], &[T; N]),
    qd: &[T; N],
    tau: &[T; N],
) -> [T; N] {
    let zero = qd[0].like(0.0);
    let x_axis = entries!(Planar::new(zero, zero), i => Planar::new(cos[i], sin[i]));
    let mut rate = qd[0];
    let w = entries!(zero, i => {
        if i > 0 {
            rate = rate + qd[i];
        }
        rods[i].length * rate * rate
    });
    let u = entries!(zero, i => {
        let transmitted = if i + 1 < N { tau[i] - tau[i + 1] } else { tau[i] };
        transmitted * rods[i].per_mass_length
    });

    // From the tip to the base: the inertia and bias that each link carries, and the acceleration
    // of its tip as a function of the previous tip's.
    let mut carried = Carried::nothing(zero);
    let mut hinges = [Hinge::none(zero); N];
    let mut per_w = [zero; N];
    for i in (1..N).rev() {
        carried = if i + 1 == N {
            Carried::outermost(u[i], w[i], rods[i].mass_ratio, x_axis[i])
        } else {
            let body = carried.with_rod(u[i], w[i]);
            hinges[i] = carried.hinge(u[i], w[i], x_axis[i]);
            per_w[i] = body.per_w();
            body.turned(u[i], rods[i].mass_ratio, x_axis[i])
        };
    }
    per_w[0] = zero.like(1.0) / carried.big_w;

    // From the base to the tip: the accelerations. Gravity is an upward acceleration of the base.
    let u3 = if N > 1 { tau[0] - tau[1] } else { tau[0] } * (rods[0].per_mass_length * 3.0);
    let free = u3 - carried.bias_y3;
    let (mut tip, mut inner);
    if USES_FIRST_ANGLE {
        let joint = Planar::new(x_axis[0].y * *gravity, x_axis[0].x * *gravity);
        let along = joint.x - w[0];
        let across = (free.sub_exact_product(joint.y, 0.5) - carried.b3 * along) * per_w[0];
        tip = Planar::new(along, across);
        inner = (across - joint.y) * rods[0].per_length;
    } else {
        tip = Planar::new(-w[0], (free + carried.b3 * w[0]) * per_w[0]);
        inner = tip.y * rods[0].per_length;
    }
    let mut relative = [inner; N];
    for i in 1..N {
        let joint_y = x_axis[i].perp_dot(tip);
        let per_length = rods[i].per_length;
        if i + 1 == N {
            relative[i] = (u[i] * (per_length * 3.0) - inner) - per_length * 1.5 * joint_y;
        } else {
            let hinge = hinges[i];
            let along = (x_axis[i].x * tip.x - w[i]) + x_axis[i].y * tip.y;
            let across = ((hinge.free - hinge.x * tip.x) - hinge.y * tip.y) * per_w[i];
            let link = (across - joint_y) * per_length;
            relative[i] = link - inner;
            (tip, inner) = (Planar::new(along, across), link);
        }
    }
    relative
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
    fn perp_dot(self, other: Self) -> T {
        self.x * other.y - self.y * other.x
    }
}

/// The acceleration of a link's tip across the link, times `W`: `free - x p_x - y p_y`. `p` is the acceleration of
/// the previous link's tip, in that link's frame.
#[derive(Clone, Copy)]
struct Hinge<T> {
    free: T,
    x: T,
    y: T,
}

impl<T: Number> Hinge<T> {
    #[inline(always)]
    fn none(zero: T) -> Self {
        Self {
            free: zero,
            x: zero,
            y: zero,
        }
    }
}

/// The load at the tip of a link, `A = (a b; b c)` and `B`, in the frame of that link and per unit of its mass.
/// The fields are the terms that the link uses.
#[derive(Clone, Copy)]
struct Carried<T> {
    a: T,
    /// `3 b`.
    b3: T,
    /// `W = 1 + 3 c`.
    big_w: T,
    /// `3 det A`.
    det3: T,
    /// `3 B_y`.
    bias_y3: T,
    /// `B_x + 3 E_x`.
    stiff: T,
    /// `B_y + E_y`.
    soft: T,
}

impl<T: Number> Carried<T> {
    #[inline(always)]
    fn nothing(zero: T) -> Self {
        Self {
            a: zero,
            b3: zero,
            big_w: zero.like(1.0),
            det3: zero,
            bias_y3: zero,
            stiff: zero,
            soft: zero,
        }
    }

    /// The outermost link, which carries nothing: `A' = 1/4 + 3/4 x xᵀ`, `B' = -w/2 x + 3u/2 y`.
    #[inline(always)]
    fn outermost(u: T, w: T, mass_ratio: T, x_axis: Planar<T>) -> Self {
        let Planar { x, y } = x_axis;
        let m = mass_ratio;
        let (quarter, three, nine) = (m * 0.25, m * 0.75, m * 2.25);
        let (phi3, psi3) = (w * (m * -1.5), u * (m * 4.5));
        Self {
            a: quarter + three * (x * x),
            b3: nine * (x * y),
            big_w: (three + 1.0) + nine * (y * y),
            det3: three * m,
            bias_y3: phi3 * y + psi3 * x,
            stiff: phi3 * ((quarter + THIRD) * x) - psi3 * ((m + THIRD) * y),
            soft: phi3 * ((quarter * THIRD + THIRD) * y) + psi3 * ((m * THIRD + THIRD) * x),
        }
    }

    /// The acceleration of the tip that carries this, as a function of its joint's acceleration, times `W`.
    #[inline(always)]
    fn hinge(&self, u: T, w: T, x_axis: Planar<T>) -> Hinge<T> {
        Hinge {
            free: (((u + u) + u) + self.b3 * w) - self.bias_y3,
            x: (self.b3 * x_axis.x).sub_exact_product(x_axis.y, 0.5),
            y: (self.b3 * x_axis.y).sub_exact_product(x_axis.x, -0.5),
        }
    }

    /// Adds the rod that carries this load and turns about its joint.
    #[inline(always)]
    fn with_rod(&self, u: T, w: T) -> Body<T> {
        let big_w = self.big_w;
        let big_x = big_w + (self.a + self.det3);
        let one_a = self.a + 1.0;
        let (half_b, half_w) = (self.b3 * (1.0 / 6.0), big_w * 0.5);
        Body {
            big_w,
            big_x,
            half_b,
            half_w,
            d: big_x.sub_exact_product(one_a, 0.25) * THIRD,
            phi: (self.b3 * u - w * (big_x - half_w)) + self.stiff,
            psi: (u * one_a + half_b * w) - self.soft,
            quotient: u.like(1.0) / (big_w * big_x),
        }
    }
}

/// The load of a link and all links beyond it on the link's joint, in the link's frame, per unit of its mass. Every
/// product and sum that does not depend on the quotient is computed before it, because the division has the longest
/// latency.
#[derive(Clone, Copy)]
struct Body<T> {
    big_w: T,
    big_x: T,
    /// `-X k`.
    half_b: T,
    /// `W / 2`.
    half_w: T,
    /// `X d`.
    d: T,
    /// `X φ`.
    phi: T,
    /// `2 X (ψ - u)`.
    psi: T,
    /// `1 / (W X)`.
    quotient: T,
}

impl<T: Number> Body<T> {
    /// `1 / W`.
    #[inline(always)]
    fn per_w(&self) -> T {
        self.big_x * self.quotient
    }

    /// The same in the frame of the previous link and per unit of *its* mass. The argument is the direction of this
    /// link in that frame.
    #[inline(always)]
    fn turned(&self, u: T, mass_ratio: T, x_axis: Planar<T>) -> Carried<T> {
        let Planar { x, y } = x_axis;
        let (m, m3) = (mass_ratio, mass_ratio * 3.0);
        // X v, W X d and the axes of the soft part.
        let v = Planar::new(
            self.big_x * x + self.half_b * y,
            self.big_x * y - self.half_b * x,
        );
        let d = self.big_w * self.d;
        let (half_w, q) = (self.half_w, self.quotient);
        let m3q = m3 * q;
        let bias = Planar::new(
            self.phi * v.x - self.psi * (half_w * y),
            self.phi * v.y + self.psi * (half_w * x),
        );
        // E, as the sum of its stiff and soft part.
        let psi = (u + self.psi * half_w * q) * self.big_x;
        let d_phi = self.d * self.phi;
        let e3 = Planar::new(
            m * m3q * (d_phi * x - psi * v.y),
            m * m3q * (d_phi * y + psi * v.x),
        );
        let bias_x = m * q * bias.x - m * u * y;
        let bias_y3 = m3q * bias.y + m3 * (u * x);
        Carried {
            a: m * q * (v.x * v.x + d * (y * y)),
            b3: m3q * (v.x * v.y - d * (x * y)),
            big_w: m3 * (v.y * v.y + d * (x * x)) * q + 1.0,
            det3: m * m3q * (self.d * self.big_x),
            bias_y3,
            stiff: bias_x + e3.x,
            soft: (bias_y3 + e3.y) * THIRD,
        }
    }
}

//! The one-step methods, side by side: each advances `q̈ = a(t, q, q̇)` from `t` to `t + h`.
//!
//! | method | order | evaluations | map, with `a₁ = a(t, q, v)` |
//! | --- | --- | --- | --- |
//! | Euler | 1 | 1 | `q + h v`, `v + h a₁` |
//! | midpoint | 2 | 2 | `qₘ = q + h/2 v`, `vₘ = v + h/2 a₁`; `q + h vₘ`, `v + h a(t + h/2, qₘ, vₘ)` |
//! | Verlet | 2 | 2 | `q' = q + h v + h²/2 a₁`; `v + h/2 (a₁ + a(t + h, q', v + h a₁))` |
//! | Runge-Kutta 4 | 4 | 4 | classical 1:2:2:1 on the pair `(q, v)` |
//!
//! Positions and velocities are an array each, one entry per joint; a particle on a line has one. Only
//! [`increment`] steps the live arm and `/arm_sim/integration_step`. All arithmetic is floating-point.
//!
//! Source: Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I* (1993), ch. II.1; for Verlet, Swope
//! et al., *J. Chem. Phys.* 76 (1982), with the velocity predicted by `v + h a₁` for the second evaluation.
//!
//! This file has the facts and the steps of each method, for any number type.
//!
//! **Invariant:** every evaluation is at the time of its stage: `t`, `t + h/2` or `t + h`.

#![allow(
    clippy::indexing_slicing,
    reason = "every index runs over arrays of the same constant length"
)]

use std::fmt;
use std::str::FromStr;

use super::number::{Arithmetic, entries};

/// One of the selectable one-step methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Method {
    /// Forward Euler, order 1. Weakness: gains energy on every undamped swing, at every timestep.
    Euler,
    /// Explicit midpoint, order 2. Weakness: an undamped swing still grows, though only by `(ω h)⁴ / 8` a step.
    Midpoint,
    /// Velocity Verlet that predicts the velocity and corrects it once, order 2. Weakness: the forces of an arm depend
    /// on velocity, so it does not conserve energy as its textbook form does. Stiff damping makes it diverge without
    /// oscillating.
    Verlet,
    /// Classical Runge-Kutta, order 4. Weakness: four evaluations a step, and no larger a stable timestep than the
    /// other two of order above 1 when the effort is held over the step.
    Rk4,
}

impl Method {
    /// All methods, in the order in which they are taught.
    pub const ALL: [Self; 4] = [Self::Euler, Self::Midpoint, Self::Verlet, Self::Rk4];

    const fn facts(self) -> Facts {
        match self {
            Self::Euler => Facts {
                name: "euler",
                order: 1,
                evaluations: 1,
            },
            Self::Midpoint => Facts {
                name: "midpoint",
                order: 2,
                evaluations: 2,
            },
            Self::Verlet => Facts {
                name: "verlet",
                order: 2,
                evaluations: 2,
            },
            Self::Rk4 => Facts {
                name: "rk4",
                order: 4,
                evaluations: 4,
            },
        }
    }

    /// The name that requests and messages use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.facts().name
    }

    /// Order of the global error in the timestep.
    #[must_use]
    pub const fn order(self) -> u32 {
        self.facts().order
    }

    /// Acceleration evaluations that one step makes.
    #[must_use]
    pub const fn evaluations(self) -> u32 {
        self.facts().evaluations
    }
}

/// The properties of a method.
struct Facts {
    name: &'static str,
    order: u32,
    evaluations: u32,
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A name that no method has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("must be one of {}", Method::ALL.map(Method::name).join(", "))]
pub struct UnknownMethod;

impl FromStr for Method {
    type Err = UnknownMethod;

    fn from_str(name: &str) -> Result<Self, UnknownMethod> {
        Self::ALL
            .into_iter()
            .find(|method| method.name() == name)
            .ok_or(UnknownMethod)
    }
}

/// The increments of position and velocity in one step: `(Δq, Δv)`.
pub type Increment<const N: usize, T = f64> = ([T; N], [T; N]);

/// The increment of one step of length `h` \[s\] from `(q, v)` at time `t` \[s\].
///
/// `acceleration(t, q, v)` \[rad/s²\] is evaluated [`Method::evaluations`] times, always first at the start itself.
/// Increments, not states, are returned, so a caller can sum them with compensation ([`two_sum`]). Values that are not
/// finite are returned too; the caller checks them.
#[inline(always)]
pub fn increment<T: Arithmetic, const N: usize>(
    method: Method,
    mut acceleration: impl FnMut(T, &[T; N], &[T; N]) -> [T; N],
    t: T,
    q: &[T; N],
    v: &[T; N],
    h: T,
) -> Increment<N, T> {
    // No value is computed before the match: the compiler makes faster code of each method as a whole.
    match method {
        Method::Euler => {
            let a1 = acceleration(t, q, v);
            (scaled(h, v), scaled(h, &a1))
        }
        Method::Midpoint => {
            let half = h * 0.5;
            let a1 = acceleration(t, q, v);
            let qm = moved(q, half, v);
            let vm = moved(v, half, &a1);
            let am = acceleration(t + half, &qm, &vm);
            (scaled(h, &vm), scaled(h, &am))
        }
        Method::Verlet => {
            let half = h * 0.5;
            let a1 = acceleration(t, q, v);
            let dq = entries!(h, i => h * (v[i] + half * a1[i]));
            let predicted_q = entries!(h, i => q[i] + dq[i]);
            let predicted_v = moved(v, h, &a1);
            let a2 = acceleration(t + h, &predicted_q, &predicted_v);
            (dq, entries!(h, i => half * (a1[i] + a2[i])))
        }
        Method::Rk4 => {
            let half = h * 0.5;
            let a1 = acceleration(t, q, v);
            let v2 = moved(v, half, &a1);
            let a2 = acceleration(t + half, &moved(q, half, v), &v2);
            let v3 = moved(v, half, &a2);
            let a3 = acceleration(t + half, &moved(q, half, &v2), &v3);
            let v4 = moved(v, h, &a3);
            let a4 = acceleration(t + h, &moved(q, h, &v3), &v4);
            let sixth = h / h.like(6.0);
            (
                entries!(h, i => sixth * (v[i] + (v2[i] + v3[i]) * 2.0 + v4[i])),
                entries!(h, i => sixth * (a1[i] + (a2[i] + a3[i]) * 2.0 + a4[i])),
            )
        }
    }
}

/// `a + b` rounded, and its exact rounding error (Knuth's two-sum, without a branch on which is larger).
///
/// If the error is carried into the next addition, a million small steps are as accurate as one.
#[inline(always)]
#[must_use]
pub fn two_sum<T: Arithmetic>(a: T, b: T) -> (T, T) {
    let sum = a + b;
    let b_in_sum = sum - a;
    (sum, (a - (sum - b_in_sum)) + (b - b_in_sum))
}

#[inline(always)]
fn scaled<T: Arithmetic, const N: usize>(h: T, x: &[T; N]) -> [T; N] {
    entries!(h, i => h * x[i])
}

/// `x + h rate`.
#[inline(always)]
pub(crate) fn moved<T: Arithmetic, const N: usize>(x: &[T; N], h: T, rate: &[T; N]) -> [T; N] {
    entries!(h, i => x[i] + h * rate[i])
}

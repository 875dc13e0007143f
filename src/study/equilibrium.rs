//! Resting poses of an arm under its control law.
//!
//! Joints that integrate stay at the setpoint. The others go downhill on the potential of the arm and of its springs,
//! `V = U + ½ kp (q - q*)² - c q`, and come to rest in one of its minima. A saddle, which has no slope either but
//! curves down in some direction, is left, as a real arm leaves it.
//!
//! **Invariant:** whatever the arm and the gains, a pose is found in bounded time.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N of arrays that have N elements"
)]

use std::f64::consts::FRAC_PI_2;

use super::control_loop::ControlLoop;
use super::symmetric::{Symmetric, eigen};
use crate::math::arm::Arm;
use crate::math::dynamics::{gravity_load, potential_energy};
use crate::math::pid::{Gains, INTEGRAL_LIMIT, Setpoint};

/// Newton steps before an equilibrium is given up. From a setpoint nearby five do.
const MAX_NEWTON: usize = 200;

/// Saddles that are left before the search is given up; an arm has no more of them on one way down.
const MAX_SADDLES: usize = 8;

/// First length of a step that is trusted \[rad\]: within half a radian an arm's potential is not far from a parabola.
const TRUSTED: f64 = 0.5;

/// A step shorter than this changes no angle \[rad\].
const SMALLEST_TRUSTED: f64 = 1e-18;

/// How far a saddle is left before going downhill again \[rad\]: a fall that stands out from rounding.
const LEAVING: f64 = 1e-3;

/// A sag that counts as none \[rad\]: some units of rounding of an angle of many turns.
const BALANCED: f64 = 1e-9;

/// Curvature, in parts of the largest, that rounding can feign.
const FLAT: f64 = 1e-12;

/// A pose at which an arm rests under control.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Equilibrium<const N: usize> {
    /// Joint positions \[rad\].
    pub position: [f64; N],
    /// Integral of the position error \[rad s\]; zero where there is no integral gain.
    pub integral: [f64; N],
    /// Joints whose integral still moves: an integral gain, and a load that the integral can carry within its limit.
    pub integrating: [bool; N],
    /// Largest effort that is left unbalanced \[N m\]: some units of rounding, or more where no equilibrium exists.
    pub residual: f64,
    /// Whether the setpoint itself is an exact balance that the arm leaves, upright with soft gains, say: it may as
    /// well fall to the other side.
    pub balanced: bool,
}

/// The equilibrium that the arm settles at from the setpoint. It is the setpoint itself where every joint has an
/// integral, the sagging pose otherwise, and the hanging one for an arm left to itself.
///
/// Joints that integrate stay at the setpoint. The others go downhill on the potential `V = U + ½ kp (q - q*)² - c q`
/// by Newton steps, and down from every saddle. So the result is a pose that the arm would rest in. An integral that
/// would have to exceed its limit is taken as a constant effort at the limit.
#[must_use]
pub fn equilibrium<const N: usize>(control: &ControlLoop<N>) -> Equilibrium<N> {
    let ControlLoop {
        arm,
        gains,
        setpoint,
        ..
    } = control;
    if control.is_free() {
        let mut position = [0.0; N];
        if let Some(first) = position.first_mut().filter(|_| arm.gravity() > 0.0) {
            *first = -FRAC_PI_2;
        } else {
            position = setpoint.position;
        }
        return Equilibrium {
            position,
            integral: [0.0; N],
            integrating: [false; N],
            residual: 0.0,
            balanced: false,
        };
    }
    let mut descent = Descent {
        arm,
        gains,
        setpoint,
        integrating: control.integrating(),
        push: std::array::from_fn(|i| gains.kd[i] * setpoint.velocity[i]),
    };
    let mut integral = [0.0; N];
    let mut balanced = false;
    // Every pass but the last takes an integral that saturates out of the joints that still integrate.
    for _ in 0..=N {
        let (sag, leaves) = descent.settle();
        balanced |= leaves;
        let load = descent.gradient(&sag);
        let mut saturated = false;
        for i in 0..N {
            if !descent.integrating[i] {
                continue;
            }
            integral[i] = load[i] / gains.ki[i];
            if integral[i].abs() > INTEGRAL_LIMIT {
                saturated = true;
                integral[i] = INTEGRAL_LIMIT.copysign(integral[i]);
                descent.integrating[i] = false;
                descent.push[i] += gains.ki[i] * integral[i];
            }
        }
        if !saturated {
            let left = (0..N).filter(|&i| !descent.integrating[i]);
            return Equilibrium {
                position: std::array::from_fn(|i| setpoint.position[i] + sag[i]),
                integral,
                integrating: descent.integrating,
                residual: left.fold(0.0, |max, i| max.max(load[i].abs())),
                balanced,
            };
        }
    }
    Equilibrium {
        position: setpoint.position,
        integral,
        integrating: [false; N],
        residual: f64::INFINITY,
        balanced,
    }
}

/// The potential that an arm goes downhill on, in the sag `y = q - q*` of its joints.
struct Descent<'a, const N: usize> {
    arm: &'a Arm<N>,
    gains: &'a Gains<N>,
    setpoint: &'a Setpoint<N>,
    integrating: [bool; N],
    /// Constant effort `kd q̇*`, and that of integrals at their limit \[N m\].
    push: [f64; N],
}

impl<const N: usize> Descent<'_, N> {
    fn position(&self, sag: &[f64; N]) -> [f64; N] {
        std::array::from_fn(|i| self.setpoint.position[i] + sag[i])
    }

    /// `∂V/∂y`, joints that integrate included \[N m\].
    fn gradient(&self, sag: &[f64; N]) -> [f64; N] {
        let load = gravity_load(self.arm, &self.position(sag));
        std::array::from_fn(|i| load[i] + self.gains.kp[i] * sag[i] - self.push[i])
    }

    fn potential(&self, sag: &[f64; N]) -> f64 {
        let spring: f64 = (0..N)
            .map(|i| (0.5 * self.gains.kp[i] * sag[i] - self.push[i]) * sag[i])
            .sum();
        potential_energy(self.arm, &self.position(sag)) + spring
    }

    /// Size of the gradient over the joints that move.
    fn slope(&self, sag: &[f64; N]) -> f64 {
        let gradient = self.gradient(sag);
        (0..N)
            .filter(|&i| !self.integrating[i])
            .fold(0.0, |max: f64, i| max.max(gradient[i].abs()))
    }

    /// Goes downhill from no sag to a pose in which the arm rests. Also says whether no sag was an exact balance, from
    /// which an arm falls to either side.
    fn settle(&self) -> ([f64; N], bool) {
        let mut sag = self.descend([0.0; N]);
        let mut balanced = false;
        for saddle in 0..MAX_SADDLES {
            let Some(way) = self.way_down(&sag) else {
                break;
            };
            let still = sag.iter().all(|sag| sag.abs() < BALANCED);
            balanced |= saddle == 0 && still;
            let sides = [1.0, -1.0].map(|side| moved(&sag, &way, side * LEAVING));
            let [one, other] = sides.map(|side| self.potential(&side));
            sag = self.descend(sides[usize::from(other < one)]);
        }
        (sag, balanced)
    }

    /// Goes downhill to where the slope ends, by Newton steps within a trusted radius. Where the potential curves down,
    /// the step is turned about, so that it leads down there too.
    ///
    /// Source: Nocedal and Wright, *Numerical Optimization* (2006), ch. 3.4 and 4.
    fn descend(&self, mut sag: [f64; N]) -> [f64; N] {
        let mut radius = TRUSTED;
        for _ in 0..MAX_NEWTON {
            let slope = self.slope(&sag);
            if slope == 0.0 {
                break;
            }
            let stiffness = self.stiffness(&sag);
            let step = self.newton(&sag, &stiffness);
            let length = step.iter().fold(0.0, |max: f64, step| max.max(step.abs()));
            let part = (radius / length).min(1.0);
            let next = moved(&sag, &step, part);
            let height = self.potential(&sag);
            // Near the bottom the potential is flat to rounding, and the slope alone shows progress.
            let rounding = 1e-13 * (height.abs() + size(&stiffness));
            let drop = height - self.potential(&next);
            if drop > rounding || (drop >= -rounding && self.slope(&next) < slope) {
                sag = next;
                radius = if part < 1.0 { 2.0 * radius } else { radius };
            } else if radius > SMALLEST_TRUSTED {
                radius = 0.25 * radius.min(length);
            } else {
                // This is as near as rounding lets it come, or there is no place to rest.
                break;
            }
        }
        sag
    }

    /// The direction in which the potential curves down most, if it does in any.
    fn way_down(&self, sag: &[f64; N]) -> Option<[f64; N]> {
        let stiffness = self.stiffness(sag);
        let (curvature, way) = eigen(&stiffness)
            .into_iter()
            .min_by(|one, other| one.0.total_cmp(&other.0))?;
        (curvature < -FLAT * size(&stiffness)).then_some(way)
    }

    /// `∂²V/∂y²` \[N m/rad\] of the joints that move; the others are tied to nothing but themselves.
    fn stiffness(&self, sag: &[f64; N]) -> Symmetric<N> {
        let gradient = gravity_gradient(self.arm, &self.position(sag));
        std::array::from_fn(|i| {
            std::array::from_fn(
                |j| match (i == j, self.integrating[i] || self.integrating[j]) {
                    (true, true) => 1.0,
                    (false, true) => 0.0,
                    (_, false) => gradient[i.max(j)] + if i == j { self.gains.kp[i] } else { 0.0 },
                },
            )
        })
    }

    fn newton(&self, sag: &[f64; N], stiffness: &Symmetric<N>) -> [f64; N] {
        let gradient = self.gradient(sag);
        let mut step = [0.0; N];
        for (curvature, along) in eigen(stiffness) {
            let moving = (0..N).filter(|&i| !self.integrating[i]);
            let slope: f64 = moving.map(|i| gradient[i] * along[i]).sum();
            // Where it is flat the radius alone ends the step.
            let length = slope / curvature.abs().max(1e-15 * size(stiffness));
            if length.is_finite() {
                step = moved(&step, &along, -length);
            }
        }
        step
    }
}

fn moved<const N: usize>(from: &[f64; N], way: &[f64; N], length: f64) -> [f64; N] {
    std::array::from_fn(|i| from[i] + length * way[i])
}

/// The largest entry of a symmetric matrix on its diagonal.
fn size<const N: usize>(matrix: &Symmetric<N>) -> f64 {
    (0..N).fold(0.0, |max: f64, i| max.max(matrix[i][i].abs()))
}

/// `∂G_k/∂q_j` is entry `max(k, j)` of this \[N m/rad\]. Turning any joint up to `k` turns all links beyond `k` alike,
/// and turning the whole arm by a quarter makes that derivative out of the load itself.
pub(crate) fn gravity_gradient<const N: usize>(arm: &Arm<N>, q: &[f64; N]) -> [f64; N] {
    let mut turned = *q;
    if let Some(first) = turned.first_mut() {
        *first += FRAC_PI_2;
    }
    gravity_load(arm, &turned)
}

//! Resting poses of an arm under its control law.
//!
//! Joints that integrate stay at the setpoint. The others descend the potential of the arm and its springs,
//! `V = U + ½ kp (q - q*)² - c q`, to one of its minima. The search leaves a saddle, as a real arm does: its gradient
//! is zero, but the potential curves down in some direction.
//!
//! **Invariant:** for every arm and all gains the search ends in bounded time.

use std::f64::consts::FRAC_PI_2;

use super::control_loop::ControlLoop;
use super::matrix::{Matrix, largest};
use crate::math::arm::Arm;
use crate::math::dynamics::{gravity_load, potential_energy};
use crate::math::integrator::moved;
use crate::math::pid::INTEGRAL_LIMIT;

/// Most Newton steps of a search. From a nearby setpoint five are enough.
const MAX_NEWTON: usize = 200;

/// Most saddles in one search; a descent passes no more of them.
const MAX_SADDLES: usize = 8;

/// Initial trust radius \[rad\]: within half a radian the potential is close to a parabola.
const TRUSTED: f64 = 0.5;

/// A step shorter than this changes no angle \[rad\].
const SMALLEST_TRUSTED: f64 = 1e-18;

/// Most searches for the joints whose integral is at its limit.
const MAX_PASSES: u32 = 30;

/// Distance of the first step away from a saddle \[rad\]: large enough that the descent exceeds rounding.
const LEAVING: f64 = 1e-3;

/// A sag within rounding error \[rad\]: a few units in the last place of an angle of many turns.
const BALANCED: f64 = 1e-9;

/// Negative curvature within rounding error, relative to the largest curvature.
const FLAT: f64 = 1e-12;

/// A pose at which an arm rests under control.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Equilibrium<const N: usize> {
    /// Joint positions \[rad\].
    pub position: [f64; N],
    /// Integral of the position error \[rad s\]; zero where there is no integral gain.
    pub integral: [f64; N],
    /// Joints with an integral gain whose integral can carry the load within its limit.
    pub integrating: [bool; N],
    /// Whether the setpoint itself is an unstable equilibrium, for example upright with low gains. The arm may then
    /// fall to either side.
    pub balanced: bool,
}

/// The equilibrium below the setpoint, down the slope of the potential. It is the setpoint if every joint has an integral,
/// and a sagging pose otherwise. A free arm hangs. An integral that would exceed its limit counts as an effort at it.
pub fn equilibrium<const N: usize>(control: &ControlLoop<N>) -> Equilibrium<N> {
    let (gains, setpoint) = (&control.gains, &control.setpoint);
    if control.is_free() {
        let heavy = control.arm.gravity() > 0.0;
        return Equilibrium {
            position: if heavy { hanging() } else { setpoint.position },
            integral: [0.0; N],
            integrating: [false; N],
            balanced: false,
        };
    }
    let mut descent = Descent {
        control,
        integrating: control.integrating(),
        integral: [0.0; N],
    };
    let (mut sag, mut balanced, mut passes) = ([0.0; N], false, 0);
    loop {
        balanced |= descent.settle(&mut sag);
        let (load, before) = (descent.gradient(&sag), descent.integrating);
        for i in (0..N).filter(|&i| gains.ki[i] > 0.0) {
            let integral = &mut descent.integral[i];
            if before[i] {
                *integral = load[i] / gains.ki[i];
                let saturated = integral.abs() > INTEGRAL_LIMIT;
                *integral = integral.clamp(-INTEGRAL_LIMIT, INTEGRAL_LIMIT);
                descent.integrating[i] = !saturated;
            } else {
                // Back at the setpoint the integral leaves its limit.
                descent.integrating[i] = sag[i] == 0.0;
            }
        }
        passes += 1;
        if descent.integrating == before || passes == MAX_PASSES {
            return Equilibrium {
                position: descent.position(&sag),
                integral: descent.integral,
                integrating: before,
                balanced,
            };
        }
    }
}

/// The potential of the descent, as a function of the sag `y = q - q*` of the joints.
struct Descent<'a, const N: usize> {
    control: &'a ControlLoop<N>,
    integrating: [bool; N],
    /// Of a joint that does not integrate: zero, or the limit. Then the joint stays on its side of the setpoint.
    integral: [f64; N],
}

impl<const N: usize> Descent<'_, N> {
    fn position(&self, sag: &[f64; N]) -> [f64; N] {
        std::array::from_fn(|i| self.control.setpoint.position[i] + sag[i])
    }

    /// Constant effort `kd q̇*`, and that of an integral at its limit \[N m\].
    fn push(&self, i: usize) -> f64 {
        let (gains, rate) = (&self.control.gains, self.control.setpoint.velocity[i]);
        let saturated = f64::from(u8::from(!self.integrating[i]));
        gains.kd[i] * rate + saturated * gains.ki[i] * self.integral[i]
    }

    /// Joints at the setpoint, held by an integral. `gradient` is that at this sag.
    fn fixed(&self, sag: &[f64; N], gradient: &[f64; N]) -> [bool; N] {
        let is_back = |i: usize| sag[i] == 0.0 && self.integral[i] * gradient[i] < 0.0;
        std::array::from_fn(|i| self.integrating[i] || is_back(i))
    }

    /// `∂V/∂y`, joints that integrate included \[N m\].
    fn gradient(&self, sag: &[f64; N]) -> [f64; N] {
        let load = gravity_load(&self.control.arm, &self.position(sag));
        std::array::from_fn(|i| load[i] + self.control.gains.kp[i] * sag[i] - self.push(i))
    }

    fn potential(&self, sag: &[f64; N]) -> f64 {
        let spring = |i: usize| (0.5 * self.control.gains.kp[i] * sag[i] - self.push(i)) * sag[i];
        potential_energy(&self.control.arm, &self.position(sag)) + (0..N).map(spring).sum::<f64>()
    }

    /// The gradient of the joints that move; zero for the others.
    fn slopes(&self, sag: &[f64; N]) -> [f64; N] {
        let gradient = self.gradient(sag);
        let fixed = self.fixed(sag, &gradient);
        std::array::from_fn(|i| if fixed[i] { 0.0 } else { gradient[i] })
    }

    /// Descends to rest. Returns whether zero sag is an unstable equilibrium, from which an arm falls to either side.
    fn settle(&self, sag: &mut [f64; N]) -> bool {
        *sag = self.descend(*sag);
        let mut balanced = false;
        for saddle in 0..MAX_SADDLES {
            let Some(way) = self.way_down(sag) else {
                break;
            };
            balanced |= saddle == 0 && sag.iter().all(|sag| sag.abs() < BALANCED);
            let sides = [1.0, -1.0].map(|side| moved(sag, side * LEAVING, &way));
            let [one, other] = sides.map(|side| self.potential(&side));
            *sag = self.descend(sides[usize::from(other < one)]);
        }
        balanced
    }

    /// Descends to a point of zero gradient, by Newton steps within a trust radius. Where the potential curves down in
    /// some direction, all curvatures are increased, so that the step descends.
    ///
    /// Source: Nocedal and Wright, *Numerical Optimization* (2006), ch. 3.4 and 4.
    fn descend(&self, mut sag: [f64; N]) -> [f64; N] {
        let mut radius = TRUSTED;
        for _ in 0..MAX_NEWTON {
            let slope = longest(&self.slopes(&sag));
            if slope == 0.0 {
                break;
            }
            let stiffness = self.stiffness(&sag);
            let step = self.newton(&sag, &stiffness);
            let length = longest(&step);
            let part = (radius / length).min(1.0);
            let next = moved(&sag, part, &step);
            let next = std::array::from_fn(|i| {
                let is_beyond = !self.integrating[i] && self.integral[i] * next[i] > 0.0;
                if is_beyond { 0.0 } else { next[i] }
            });
            let height = self.potential(&sag);
            // Near the minimum the potential is constant within rounding, and only the gradient shows progress.
            let rounding = 1e-13 * (height.abs() + size(&stiffness));
            let drop = height - self.potential(&next);
            if drop > rounding || (drop >= -rounding && longest(&self.slopes(&next)) < slope) {
                sag = next;
                radius = if part < 1.0 { 2.0 * radius } else { radius };
            } else if radius > SMALLEST_TRUSTED {
                radius = 0.25 * radius.min(length);
            } else {
                // Rounding prevents further progress, or no equilibrium exists.
                break;
            }
        }
        sag
    }

    /// The direction of the largest negative curvature, if there is one.
    fn way_down(&self, sag: &[f64; N]) -> Option<[f64; N]> {
        let stiffness = self.stiffness(sag);
        let curvature = least_curvature(&stiffness);
        if curvature >= -FLAT * size(&stiffness) {
            return None;
        }
        // Slightly off the eigenvalue, where the matrix would be singular.
        let shifted = stiffness.plus_diagonal(-1.000_001 * curvature);
        shifted.most_shortened()?.try_into().ok()
    }

    /// `∂²V/∂y²` \[N m/rad\] of the joints that move; the others are decoupled, with 1 on the diagonal.
    fn stiffness(&self, sag: &[f64; N]) -> Matrix {
        let gradient = gravity_gradient(&self.control.arm, &self.position(sag));
        let fixed = self.fixed(sag, &self.gradient(sag));
        Matrix::from_fn(N, |i, j| {
            let same = f64::from(u8::from(i == j));
            if fixed[i] || fixed[j] {
                same
            } else {
                gradient[i.max(j)] + same * self.control.gains.kp[i]
            }
        })
    }

    fn newton(&self, sag: &[f64; N], stiffness: &Matrix) -> [f64; N] {
        let pull = self.slopes(sag).map(|slope| -slope);
        // Without curvature only the trust radius limits the step.
        let added = (-2.0 * least_curvature(stiffness)).max(1e-15 * size(stiffness));
        let step = stiffness.clone().plus_diagonal(added).solve(&pull);
        step.and_then(|step| step.try_into().ok())
            .unwrap_or([0.0; N])
    }
}

/// The pose of the hanging arm \[rad\].
pub(crate) fn hanging<const N: usize>() -> [f64; N] {
    std::array::from_fn(|joint| if joint == 0 { -FRAC_PI_2 } else { 0.0 })
}

/// The smallest eigenvalue of a symmetric matrix.
fn least_curvature(matrix: &Matrix) -> f64 {
    let modes = matrix.eigenvalues().into_iter();
    modes.map(|mode| mode.re).fold(f64::INFINITY, f64::min)
}

/// The largest magnitude of an entry.
fn longest<const N: usize>(way: &[f64; N]) -> f64 {
    way.iter().fold(0.0, |max, entry| max.max(entry.abs()))
}

/// The largest magnitude on the diagonal of a matrix.
fn size(matrix: &Matrix) -> f64 {
    largest((0..matrix.size()).map(|i| matrix[(i, i)].abs()))
}

/// `∂G_k/∂q_j` is entry `max(k, j)` of this \[N m/rad\]. Turning any joint up to `k` turns all links beyond `k` by the
/// same angle. The derivative is therefore the load of the arm turned by a quarter of a turn.
///
/// An entry within the rounding error of the angles is zero: a horizontal arm has no stiffness, and the sign of a
/// residue would make it grow or not.
pub(crate) fn gravity_gradient<const N: usize>(arm: &Arm<N>, q: &[f64; N]) -> [f64; N] {
    let gradient = gravity_load(arm, &moved(q, -1.0, &hanging()));
    let largest = gravity_load(arm, &[0.0; N]);
    let turned: f64 = q.iter().map(|angle| angle.abs()).sum();
    let rounding = 4.0 * f64::EPSILON * (1.0 + turned);
    std::array::from_fn(|k| match gradient[k] {
        entry if entry.abs() <= rounding * largest[k] => 0.0,
        entry => entry,
    })
}

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

/// The equilibrium that the arm reaches from the setpoint. It is the setpoint itself if every joint has an integral,
/// and the sagging pose otherwise. A free arm hangs. An integral that would have to exceed its limit counts as a
/// constant effort at the limit.
pub fn equilibrium<const N: usize>(control: &ControlLoop<N>) -> Equilibrium<N> {
    let (gains, setpoint) = (&control.gains, &control.setpoint);
    if control.is_free() {
        let is_heavy = control.arm.gravity() > 0.0;
        return Equilibrium {
            position: if is_heavy {
                hanging()
            } else {
                setpoint.position
            },
            integral: [0.0; N],
            integrating: [false; N],
            balanced: false,
        };
    }
    let mut descent = Descent {
        control,
        integrating: control.integrating(),
        push: std::array::from_fn(|i| gains.kd[i] * setpoint.velocity[i]),
    };
    let mut integral = [0.0; N];
    let mut balanced = false;
    // Every pass but the last finds a saturated integral and removes its joint from the integrating ones, so there are
    // at most N + 1.
    loop {
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
            return Equilibrium {
                position: descent.position(&sag),
                integral,
                integrating: descent.integrating,
                balanced,
            };
        }
    }
}

/// The potential of the descent, as a function of the sag `y = q - q*` of the joints.
struct Descent<'a, const N: usize> {
    control: &'a ControlLoop<N>,
    integrating: [bool; N],
    /// Constant effort `kd q̇*`, and that of integrals at their limit \[N m\].
    push: [f64; N],
}

impl<const N: usize> Descent<'_, N> {
    fn position(&self, sag: &[f64; N]) -> [f64; N] {
        std::array::from_fn(|i| self.control.setpoint.position[i] + sag[i])
    }

    /// `∂V/∂y`, joints that integrate included \[N m\].
    fn gradient(&self, sag: &[f64; N]) -> [f64; N] {
        let load = gravity_load(&self.control.arm, &self.position(sag));
        std::array::from_fn(|i| load[i] + self.control.gains.kp[i] * sag[i] - self.push[i])
    }

    fn potential(&self, sag: &[f64; N]) -> f64 {
        let spring: f64 = (0..N)
            .map(|i| (0.5 * self.control.gains.kp[i] * sag[i] - self.push[i]) * sag[i])
            .sum();
        potential_energy(&self.control.arm, &self.position(sag)) + spring
    }

    /// The gradient of the joints that move; zero for the others.
    fn slopes(&self, sag: &[f64; N]) -> [f64; N] {
        let mut slopes = self.gradient(sag);
        for i in (0..N).filter(|&i| self.integrating[i]) {
            slopes[i] = 0.0;
        }
        slopes
    }

    /// Descends from zero sag to a pose in which the arm rests. Also returns whether zero sag is an unstable
    /// equilibrium, from which an arm falls to either side.
    fn settle(&self) -> ([f64; N], bool) {
        let mut sag = self.descend([0.0; N]);
        let mut balanced = false;
        for saddle in 0..MAX_SADDLES {
            let Some(way) = self.way_down(&sag) else {
                break;
            };
            let still = sag.iter().all(|sag| sag.abs() < BALANCED);
            balanced |= saddle == 0 && still;
            let sides = [1.0, -1.0].map(|side| moved(&sag, side * LEAVING, &way));
            let [one, other] = sides.map(|side| self.potential(&side));
            sag = self.descend(sides[usize::from(other < one)]);
        }
        (sag, balanced)
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
        Matrix::from_fn(N, |i, j| {
            match (i == j, self.integrating[i] || self.integrating[j]) {
                (true, true) => 1.0,
                (false, true) => 0.0,
                (_, false) => {
                    gradient[i.max(j)]
                        + if i == j {
                            self.control.gains.kp[i]
                        } else {
                            0.0
                        }
                }
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
pub(crate) fn gravity_gradient<const N: usize>(arm: &Arm<N>, q: &[f64; N]) -> [f64; N] {
    gravity_load(arm, &moved(q, -1.0, &hanging()))
}

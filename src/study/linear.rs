//! The closed loop near its equilibrium, as a linear system.
//!
//! The arm under the control law rests where `kp (q* - q) + kd q̇* + ki I = G(q)` holds at every joint. Of a small
//! deviation `(x, v)` from there, velocity products are of second order, and what remains is
//!
//! `v̇ = -S x + M⁻¹ u`,  `S = M⁻¹ ∂G/∂q`,  `u = -kp x - kd v + ki s`,  `ṡ = -x`
//!
//! | symbol | name | unit |
//! | --- | --- | --- |
//! | S | what gravity gives back per angle | 1/s² |
//! | M⁻¹ | inverse of the mass matrix | 1/(kg m²) |
//! | s | deviation of the integral, of the joints that have one | rad s |
//!
//! M⁻¹ and S are columns of forward dynamics without gravity, so they are as exact as the arm's own kernel, where a
//! dense inverse of M would lose ten digits to a heavy outer link.
//!
//! **Invariant:** whatever the arm and the gains, a linearisation is made in bounded time.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N of arrays that have N elements, or over the joints of a matrix of their number"
)]

use std::f64::consts::FRAC_PI_2;

use super::matrix::Matrix;
use crate::math::arm::Arm;
use crate::math::dynamics::{forward_dynamics, gravity_load, potential_energy};
use crate::math::pid::{Gains, INTEGRAL_LIMIT, Setpoint};

/// Newton steps before an equilibrium is given up. From a setpoint nearby five do.
const MAX_NEWTON: usize = 200;

/// Where an arm rests under control.
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
}

/// Gains that are all zero: an arm left to itself.
#[must_use]
pub const fn no_control<const N: usize>() -> Gains<N> {
    Gains {
        kp: [0.0; N],
        ki: [0.0; N],
        kd: [0.0; N],
    }
}

/// Whether the gains are all zero, so that on or off is the same.
#[must_use]
#[allow(
    clippy::float_cmp,
    reason = "a gain that is exactly zero is a gain that is not there"
)]
pub fn is_free<const N: usize>(gains: &Gains<N>) -> bool {
    let Gains { kp, ki, kd } = gains;
    kp.iter().chain(ki).chain(kd).all(|&gain| gain == 0.0)
}

/// The equilibrium that the arm settles at from the setpoint: the setpoint itself where every joint has an integral, the
/// sagging pose otherwise, the hanging one for an arm left to itself.
///
/// Joints that integrate stay at the setpoint; the others go downhill on the potential `V = U + ½ kp (q - q*)² - c q` by
/// Newton steps, so that what is found is a pose that the arm would rest in. An integral that would have to exceed its
/// limit is taken as a constant effort at the limit.
#[must_use]
pub fn equilibrium<const N: usize>(
    arm: &Arm<N>,
    gains: &Gains<N>,
    setpoint: &Setpoint<N>,
) -> Equilibrium<N> {
    if is_free(gains) {
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
        };
    }
    let mut descent = Descent {
        arm,
        gains,
        setpoint,
        integrating: gains.ki.map(|ki| ki > 0.0),
        push: std::array::from_fn(|i| gains.kd[i] * setpoint.velocity[i]),
    };
    let mut integral = [0.0; N];
    // Every pass but the last takes an integral that saturates out of the joints that still integrate.
    for _ in 0..=N {
        let sag = descent.settle();
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
            };
        }
    }
    Equilibrium {
        position: setpoint.position,
        integral,
        integrating: [false; N],
        residual: f64::INFINITY,
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

    /// Downhill from no sag to where the slope ends: Newton steps, shortened by a diagonal term as long as they would
    /// not lead down.
    fn settle(&self) -> [f64; N] {
        let mut sag = [0.0; N];
        let mut damping = 0.0;
        for _ in 0..MAX_NEWTON {
            let slope = self.slope(&sag);
            if slope == 0.0 {
                break;
            }
            let stiffness = self.stiffness(&sag);
            let largest = (0..N).fold(0.0, |max: f64, i| max.max(stiffness[(i, i)].abs()));
            let next = self.newton(&sag, stiffness, damping * largest);
            let height = self.potential(&sag);
            // Near the bottom the potential is flat to rounding, and the slope alone shows progress.
            let rounding = 1e-13 * (height.abs() + largest);
            let better = next.filter(|next| {
                let drop = height - self.potential(next);
                drop > rounding || (drop >= -rounding && self.slope(next) < slope)
            });
            match better {
                Some(next) => {
                    sag = next;
                    damping = if damping < 1e-3 { 0.0 } else { 0.1 * damping };
                }
                // As near as rounding lets it come, or nowhere to rest at all.
                None if damping > 1e12 => break,
                None => damping = if damping == 0.0 { 1e-3 } else { 10.0 * damping },
            }
        }
        sag
    }

    /// `∂²V/∂y²` \[N m/rad\].
    fn stiffness(&self, sag: &[f64; N]) -> Matrix {
        let gradient = gravity_gradient(self.arm, &self.position(sag));
        Matrix::from_fn(N, |i, j| {
            gradient[i.max(j)] + if i == j { self.gains.kp[i] } else { 0.0 }
        })
    }

    fn newton(&self, sag: &[f64; N], mut stiffness: Matrix, damping: f64) -> Option<[f64; N]> {
        let mut downhill = self.gradient(sag).map(|slope| -slope);
        for i in 0..N {
            stiffness[(i, i)] += damping;
        }
        for i in (0..N).filter(|&i| self.integrating[i]) {
            downhill[i] = 0.0;
            for j in 0..N {
                stiffness[(i, j)] = 0.0;
                stiffness[(j, i)] = 0.0;
            }
            stiffness[(i, i)] = 1.0;
        }
        let step = stiffness.solve(&downhill)?;
        Some(std::array::from_fn(|i| sag[i] + step[i]))
    }
}

/// `∂G_k/∂q_j` is entry `max(k, j)` of this \[N m/rad\]: turning any joint up to `k` turns all links beyond `k` alike,
/// and turning the whole arm by a quarter makes that derivative out of the load itself.
pub(super) fn gravity_gradient<const N: usize>(arm: &Arm<N>, q: &[f64; N]) -> [f64; N] {
    let mut turned = *q;
    if let Some(first) = turned.first_mut() {
        *first += FRAC_PI_2;
    }
    gravity_load(arm, &turned)
}

/// The arm and its control law, linear in the deviation from a pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Linear {
    /// `S = M⁻¹ ∂G/∂q` \[1/s²\].
    pub gravity: Matrix,
    /// `M⁻¹` \[1/(kg m²)\].
    pub inverse_mass: Matrix,
    /// Proportional gains \[N m/rad\].
    pub kp: Vec<f64>,
    /// Derivative gains \[N m s/rad\].
    pub kd: Vec<f64>,
    /// Integral gains \[N m/(rad s)\] with their joints, of those that integrate.
    pub integrals: Vec<(usize, f64)>,
}

impl Linear {
    /// The loop at `position`, as if it were an equilibrium in which `integrating` says whose integral moves.
    #[must_use]
    pub fn at<const N: usize>(
        arm: &Arm<N>,
        gains: &Gains<N>,
        position: &[f64; N],
        integrating: &[bool; N],
    ) -> Self {
        let weightless = Arm::new(*arm.lengths(), *arm.masses(), 0.0).unwrap_or(*arm);
        let solve = |effort: [f64; N]| forward_dynamics(&weightless, position, &[0.0; N], &effort);
        let gradient = gravity_gradient(arm, position);
        let mut gravity = Matrix::zeros(N);
        let mut inverse_mass = Matrix::zeros(N);
        for j in 0..N {
            let heavy = solve(std::array::from_fn(|k| gradient[k.max(j)]));
            let unit = solve(std::array::from_fn(|k| f64::from(u8::from(k == j))));
            for i in 0..N {
                gravity[(i, j)] = heavy[i];
                inverse_mass[(i, j)] = unit[i];
            }
        }
        Self {
            gravity,
            inverse_mass,
            kp: gains.kp.to_vec(),
            kd: gains.kd.to_vec(),
            integrals: (0..N)
                .filter(|&i| integrating[i])
                .map(|i| (i, gains.ki[i]))
                .collect(),
        }
    }

    /// The loop at the equilibrium that belongs to a setpoint.
    #[must_use]
    pub fn at_setpoint<const N: usize>(
        arm: &Arm<N>,
        gains: &Gains<N>,
        setpoint: &Setpoint<N>,
    ) -> Self {
        let rest = equilibrium(arm, gains, setpoint);
        Self::at(arm, gains, &rest.position, &rest.integrating)
    }

    /// One joint of unit inertia: `v̇ = -stiffness x + u`, `u = -kp x - kd v + ki s`.
    #[must_use]
    pub fn oscillator(stiffness: f64, kp: f64, ki: f64, kd: f64) -> Self {
        Self {
            gravity: Matrix::from_fn(1, |_, _| stiffness),
            inverse_mass: Matrix::from_fn(1, |_, _| 1.0),
            kp: vec![kp],
            kd: vec![kd],
            integrals: if ki > 0.0 { vec![(0, ki)] } else { vec![] },
        }
    }

    /// The same loop without gravity.
    #[must_use]
    pub fn weightless(mut self) -> Self {
        self.gravity = Matrix::zeros(self.gravity.size());
        self
    }

    /// Number of joints.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.gravity.size()
    }

    /// Number of states: positions, velocities, integrals that move.
    #[must_use]
    pub fn states(&self) -> usize {
        2 * self.joints() + self.integrals.len()
    }

    /// The matrix `A` of `ẋ = A x` with control that follows the state at every instant; `x` holds positions, velocities,
    /// integrals.
    #[must_use]
    pub fn flow(&self) -> Matrix {
        let n = self.joints();
        let mut flow = Matrix::zeros(self.states());
        for i in 0..n {
            flow[(i, n + i)] = 1.0;
            for j in 0..n {
                let inverse = self.inverse_mass[(i, j)];
                flow[(n + i, j)] = -(self.gravity[(i, j)] + inverse * self.kp[j]);
                flow[(n + i, n + j)] = -inverse * self.kd[j];
            }
            for (k, &(joint, ki)) in self.integrals.iter().enumerate() {
                flow[(n + i, 2 * n + k)] = self.inverse_mass[(i, joint)] * ki;
            }
        }
        for (k, &(joint, _)) in self.integrals.iter().enumerate() {
            flow[(2 * n + k, joint)] = -1.0;
        }
        flow
    }

    /// The matrix of the arm alone under efforts that stay what they are: `x` holds positions, velocities, efforts \[N m\].
    #[must_use]
    pub fn plant(&self) -> Matrix {
        let n = self.joints();
        let mut plant = Matrix::zeros(3 * n);
        for i in 0..n {
            plant[(i, n + i)] = 1.0;
            for j in 0..n {
                plant[(n + i, j)] = -self.gravity[(i, j)];
                plant[(n + i, 2 * n + j)] = self.inverse_mass[(i, j)];
            }
        }
        plant
    }
}

//! The closed loop near its equilibrium, as a linear system.
//!
//! The arm under the control law rests where `kp (q* - q) + kd q̇* + ki I = G(q)` holds at every joint. For a small
//! deviation `(x, v)` from the equilibrium, velocity products are of second order. The linear part is
//!
//! `v̇ = -S x + M⁻¹ (u - b v)`,  `S = M⁻¹ ∂G/∂q`,  `u = -kp x - kd v + ki s`,  `ṡ = -x`
//!
//! | symbol | name | unit |
//! | --- | --- | --- |
//! | S | restoring acceleration of gravity per angle | 1/s² |
//! | M⁻¹ | inverse of the mass matrix | 1/(kg m²) |
//! | b | viscous friction | N m s/rad |
//! | s | deviation of the integral, of the joints that have one | rad s |
//!
//! M⁻¹ and S are columns of forward dynamics without gravity, so they are as accurate as the arm's own kernel. A dense
//! inverse of M would lose ten digits if the outer link is heavy.
//!
//! **Invariant:** for every arm and all gains the linearisation takes bounded time.

use super::control_loop::ControlLoop;
pub(crate) use super::equilibrium::gravity_gradient;
pub use super::equilibrium::{Equilibrium, equilibrium};
use super::matrix::Matrix;
use crate::math::dynamics::forward_dynamics;
use crate::math::sensors::VelocitySource;

/// The arm and its control law, linear in the deviation from a pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Linear {
    /// `S = M⁻¹ ∂G/∂q` \[1/s²\].
    pub gravity: Matrix,
    /// `M⁻¹` \[1/(kg m²)\].
    pub inverse_mass: Matrix,
    /// Viscous friction \[N m s/rad\].
    pub viscous: Vec<f64>,
    /// Proportional gains \[N m/rad\].
    pub kp: Vec<f64>,
    /// Derivative gains \[N m s/rad\].
    pub kd: Vec<f64>,
    /// Integral gains \[N m/(rad s)\] with their joints, of those that integrate.
    pub integrals: Vec<(usize, f64)>,
    /// Whether the velocities of the law are differences of positions over one control period.
    pub differences: bool,
}

impl Linear {
    /// The loop at `position`, as if it were an equilibrium. `integrating` marks the joints whose integral is active.
    pub fn at<const N: usize>(
        control: &ControlLoop<N>,
        position: &[f64; N],
        integrating: &[bool; N],
    ) -> Self {
        let ControlLoop { arm, gains, .. } = control;
        let weightless = arm.weightless();
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
            viscous: arm.viscous().to_vec(),
            kp: gains.kp.to_vec(),
            kd: gains.kd.to_vec(),
            integrals: (0..N)
                .filter(|&i| integrating[i])
                .map(|i| (i, gains.ki[i]))
                .collect(),
            differences: control.sensors.velocity == VelocitySource::Difference,
        }
    }

    /// The loop at the equilibrium that belongs to a setpoint.
    pub fn at_setpoint<const N: usize>(control: &ControlLoop<N>) -> Self {
        let rest = equilibrium(control);
        Self::at(control, &rest.position, &rest.integrating)
    }

    /// The loop at any pose, with every integral active.
    pub fn at_pose<const N: usize>(control: &ControlLoop<N>, position: &[f64; N]) -> Self {
        Self::at(control, position, &control.integrating())
    }

    /// One joint of unit inertia: `v̇ = -stiffness x + u`, `u = -kp x - kd v + ki s`.
    pub fn oscillator(stiffness: f64, kp: f64, ki: f64, kd: f64) -> Self {
        Self {
            gravity: Matrix::from_fn(1, |_, _| stiffness),
            inverse_mass: Matrix::from_fn(1, |_, _| 1.0),
            viscous: vec![0.0],
            kp: vec![kp],
            kd: vec![kd],
            integrals: if ki > 0.0 { vec![(0, ki)] } else { vec![] },
            differences: false,
        }
    }

    /// Whether the law of a loop acts on older values than the state at the start of its period.
    pub fn is_late<const N: usize>(control: &ControlLoop<N>) -> bool {
        control.period.delay > 0 || control.sensors.velocity == VelocitySource::Difference
    }

    /// The loop without gravity.
    #[must_use]
    pub fn weightless(mut self) -> Self {
        self.gravity = Matrix::zeros(self.gravity.size());
        self
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.gravity.size()
    }

    /// Number of states: positions, velocities, active integrals.
    pub fn states(&self) -> usize {
        2 * self.joints() + self.integrals.len()
    }

    /// The matrix `A` of `ẋ = A x` with the law in continuous time; `x` holds positions, velocities, integrals.
    pub fn flow(&self) -> Matrix {
        self.closed(&self.plant(), 0.0)
    }

    /// The closed loop of the sampled law and an arm under constant efforts. The law runs once per period `T` \[s\]:
    /// `s ↦ s - T x`, then `u = -kp x - kd v + ki s`. States are as in [`Linear::flow`].
    pub(super) fn closed(&self, arm: &Matrix, period: f64) -> Matrix {
        let n = self.joints();
        let mut closed = Matrix::zeros(self.states());
        for row in 0..2 * n {
            for j in 0..n {
                let effort = arm[(row, 2 * n + j)];
                closed[(row, j)] = arm[(row, j)] - effort * self.kp[j];
                closed[(row, n + j)] = arm[(row, n + j)] - effort * self.kd[j];
            }
            for (k, &(joint, ki)) in self.integrals.iter().enumerate() {
                let effort = arm[(row, 2 * n + joint)] * ki;
                closed[(row, 2 * n + k)] = effort;
                closed[(row, joint)] -= effort * period;
            }
        }
        for (k, &(joint, _)) in self.integrals.iter().enumerate() {
            closed[(2 * n + k, joint)] = -1.0;
        }
        closed
    }

    /// The same if an effort acts `delay` periods late, or if velocities are differences. The states are positions,
    /// velocities, efforts on their way with the next one first, active integrals and, for differences, the positions of a
    /// period before.
    pub(super) fn closed_late(&self, arm: &Matrix, period: f64, delay: u8) -> Matrix {
        let n = self.joints();
        let integrals = (2 + usize::from(delay)) * n;
        let before = integrals + self.integrals.len();
        let size = before + if self.differences { n } else { 0 };
        // The effort of joint j divided by the period, by the states.
        let mut law = Matrix::zeros(size);
        for j in 0..n {
            law[(j, j)] = -self.kp[j] / period;
            let damping = -self.kd[j] / period;
            if self.differences {
                law[(j, j)] += damping / period;
                law[(j, before + j)] = -damping / period;
            } else {
                law[(j, n + j)] = damping;
            }
        }
        for (k, &(joint, ki)) in self.integrals.iter().enumerate() {
            law[(joint, joint)] -= ki;
            law[(joint, integrals + k)] = ki / period;
        }
        let mut closed = fed_back(arm, &law, delay, period);
        for (k, &(joint, _)) in self.integrals.iter().enumerate() {
            closed[(integrals + k, joint)] = -1.0;
        }
        if self.differences {
            for j in 0..n {
                closed[(before + j, j)] = 1.0 / period;
                closed[(before + j, before + j)] = -1.0 / period;
            }
        }
        closed
    }

    /// The matrix of the arm alone under constant efforts: `x` holds positions, velocities, efforts \[N m\].
    pub fn plant(&self) -> Matrix {
        let n = self.joints();
        let mut plant = Matrix::zeros(3 * n);
        for i in 0..n {
            plant[(i, n + i)] = 1.0;
            for j in 0..n {
                plant[(n + i, j)] = -self.gravity[(i, j)];
                plant[(n + i, n + j)] -= self.inverse_mass[(i, j)] * self.viscous[j];
                plant[(n + i, 2 * n + j)] = self.inverse_mass[(i, j)];
            }
        }
        plant
    }
}

/// The rows of positions, velocities and efforts on their way, of a loop with a `law`: row `j` is the effort of joint `j`
/// divided by the period, by the states. All other rows are zero. `arm` is the matrix of a period under constant efforts.
pub(super) fn fed_back(arm: &Matrix, law: &Matrix, delay: u8, period: f64) -> Matrix {
    let (n, size) = (arm.size() / 3, law.size());
    let queued = (2 + usize::from(delay)) * n;
    let mut closed = Matrix::zeros(size);
    for row in 0..2 * n {
        for column in 0..2 * n {
            closed[(row, column)] = arm[(row, column)];
        }
        for j in 0..n {
            let effect = arm[(row, 2 * n + j)];
            if delay > 0 {
                closed[(row, 2 * n + j)] = effect;
            } else {
                for column in 0..size {
                    closed[(row, column)] += effect * period * law[(j, column)];
                }
            }
        }
    }
    for row in 2 * n..queued {
        closed[(row, row)] = -1.0 / period;
        if row + n < queued {
            closed[(row, row + n)] = 1.0 / period;
        } else {
            for column in 0..size {
                closed[(row, column)] += law[(row + n - queued, column)];
            }
        }
    }
    closed
}

//! Taylor series of the arm's motion, coefficient by coefficient, in double-double arithmetic.
//!
//! Every unknown is a power series in time. With `s' = c φ'` and `c' = -s φ'` sine and cosine cost one recurrence each,
//! products of series are convolutions, and the equations of motion give one linear system per coefficient, always with
//! the same matrix. The step is chosen from the last two coefficients, so that what is cut off stays below a tolerance.
//!
//! Source: Jorba and Zou, *A software package for the numerical integration of ODEs by means of high-order Taylor
//! methods*, Experimental Mathematics 14 (2005).
//!
//! **Invariant:** a step never leaves out more than its tolerance by its own estimate; whoever wants proof compares two
//! settings.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N, and over the coefficients computed so far, as they do in the recurrences"
)]

use super::double_double::DoubleDouble as Real;
use super::lagrangian::{Factors, Lagrangian, differences, link_efforts, sums};
use crate::math::arm::Arm;
use crate::math::count::length_in_f64;

/// How far a series is taken, and how much it may leave out.
#[derive(Debug, Clone, Copy)]
pub(super) struct Setting {
    /// Order of the highest coefficient.
    pub(super) order: usize,
    /// Size of the last terms that a step may have.
    pub(super) tolerance: f64,
}

/// A state with 106 bits: joint angles \[rad\], rates \[rad/s\] and, under control, integrals \[rad s\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Exact<const N: usize> {
    pub(super) position: [Real; N],
    pub(super) velocity: [Real; N],
    pub(super) integral: [Real; N],
}

/// The drive of the joints for the length of a step.
#[derive(Debug, Clone, Copy)]
pub(super) enum JointDrive<const N: usize> {
    /// Efforts that do not change \[N m\].
    Constant([Real; N]),
    /// `kp (q* - q) + ki ∫(q* - q) + kd (q̇* - q̇)` at every instant.
    Law {
        kp: [Real; N],
        ki: [Real; N],
        kd: [Real; N],
        position: [Real; N],
        velocity: [Real; N],
    },
}

/// Coefficients of one series per link or joint.
type Coefficients<const N: usize> = Vec<[Real; N]>;

/// The link angles of one step of a motion, as a series in the time from its beginning.
#[derive(Debug, Clone)]
pub(super) struct AngleSeries<const N: usize> {
    /// When it begins \[s\].
    pub(super) begins: Real,
    pub(super) angle: Coefficients<N>,
}

/// The series of one motion. Kept between steps, so that a step allocates nothing.
#[derive(Debug, Clone)]
pub(super) struct Taylor<const N: usize> {
    lagrangian: Lagrangian<N>,
    setting: Setting,
    angle: Coefficients<N>,
    rate: Coefficients<N>,
    acceleration: Coefficients<N>,
    squared_rate: Coefficients<N>,
    integral: Coefficients<N>,
    sin: Coefficients<N>,
    cos: Coefficients<N>,
    /// `cos(φ_i - φ_j)` and `sin(φ_i - φ_j)`.
    along: Vec<[[Real; N]; N]>,
    across: Vec<[[Real; N]; N]>,
}

impl<const N: usize> Taylor<N> {
    pub(super) fn new(arm: &Arm<N>, setting: Setting) -> Self {
        let zeros = || vec![[Real::ZERO; N]; setting.order + 2];
        let tables = || vec![[[Real::ZERO; N]; N]; setting.order + 2];
        Self {
            lagrangian: Lagrangian::new(arm),
            setting,
            angle: zeros(),
            rate: zeros(),
            acceleration: zeros(),
            squared_rate: zeros(),
            integral: zeros(),
            sin: zeros(),
            cos: zeros(),
            along: tables(),
            across: tables(),
        }
    }

    /// Moves `state` and `drive` on by `time` \[s\], in as many steps as the tolerance asks for.
    pub(super) fn advance(&mut self, state: &mut Exact<N>, drive: &JointDrive<N>, time: f64) {
        self.go(state, drive, time, |_, _| ());
    }

    /// As [`Taylor::advance`], and keeps the series of every step.
    pub(super) fn path(
        &mut self,
        state: &mut Exact<N>,
        drive: &JointDrive<N>,
        time: f64,
    ) -> Vec<AngleSeries<N>> {
        let mut pieces = Vec::new();
        self.go(state, drive, time, |taylor, rest| {
            pieces.push(AngleSeries {
                begins: Real::from(time) - rest,
                angle: taylor.angle[..=taylor.setting.order].to_vec(),
            });
        });
        pieces
    }

    fn go(
        &mut self,
        state: &mut Exact<N>,
        drive: &JointDrive<N>,
        time: f64,
        mut keep: impl FnMut(&Self, Real),
    ) {
        let mut rest = Real::from(time);
        while rest.to_f64() > 0.0 {
            self.expand(state, drive);
            keep(self, rest);
            let allowed = self.allowed_step();
            let last = allowed >= rest.to_f64();
            let step = if last { rest } else { Real::from(allowed) };
            *state = Exact {
                position: differences(&evaluate(&self.angle, self.setting.order, step)),
                velocity: differences(&evaluate(&self.rate, self.setting.order, step)),
                integral: evaluate(&self.integral, self.setting.order, step),
            };
            if last {
                break;
            }
            rest = rest - step;
        }
    }

    /// The series about `state`.
    fn expand(&mut self, state: &Exact<N>, drive: &JointDrive<N>) {
        self.angle[0] = sums(&state.position);
        self.rate[0] = sums(&state.velocity);
        self.integral[0] = state.integral;
        self.trigonometry(0);
        let factors = self.factors();
        for k in 0..=self.setting.order {
            if k > 0 {
                self.trigonometry(k);
            }
            let effort = link_efforts(&self.effort(drive, k));
            let right = std::array::from_fn(|i| self.right_side(i, k, effort[i]));
            self.acceleration[k] = factors.solve(right);
            let next = Real::ONE / Real::from(length_in_f64(k + 1));
            for i in 0..N {
                self.rate[k + 1][i] = self.acceleration[k][i] * next;
                self.angle[k + 1][i] = self.rate[k][i] * next;
            }
            self.integral[k + 1] = self.error(drive, k).map(|error| error * next);
        }
    }

    /// The mass matrix at the start of the step, which every coefficient is solved with.
    fn factors(&self) -> Factors<N> {
        let coupling = &self.lagrangian.coupling;
        Factors::of(std::array::from_fn(|i| {
            std::array::from_fn(|j| coupling[i][j] * self.along[0][i][j])
        }))
    }

    /// Coefficient `k` of sine and cosine of every angle, of their differences, and of the squared rates.
    fn trigonometry(&mut self, k: usize) {
        for i in 0..N {
            if k == 0 {
                (self.sin[0][i], self.cos[0][i]) = self.angle[0][i].sin_cos();
            } else {
                let (mut sin, mut cos) = (Real::ZERO, Real::ZERO);
                for j in 1..=k {
                    let slope = Real::from(length_in_f64(j)) * self.angle[j][i];
                    sin += slope * self.cos[k - j][i];
                    cos += slope * self.sin[k - j][i];
                }
                let per_k = Real::ONE / Real::from(length_in_f64(k));
                self.sin[k][i] = sin * per_k;
                self.cos[k][i] = -(cos * per_k);
            }
            self.squared_rate[k][i] = (0..=k).fold(Real::ZERO, |sum, m| {
                sum + self.rate[m][i] * self.rate[k - m][i]
            });
        }
        for i in 0..N {
            self.along[k][i][i] = if k == 0 { Real::ONE } else { Real::ZERO };
            for j in 0..i {
                let (mut along, mut across) = (Real::ZERO, Real::ZERO);
                for m in 0..=k {
                    let (sin_i, cos_i) = (self.sin[m][i], self.cos[m][i]);
                    let (sin_j, cos_j) = (self.sin[k - m][j], self.cos[k - m][j]);
                    along += cos_i * cos_j + sin_i * sin_j;
                    across += sin_i * cos_j - cos_i * sin_j;
                }
                self.along[k][i][j] = along;
                self.along[k][j][i] = along;
                self.across[k][i][j] = across;
                self.across[k][j][i] = -across;
            }
        }
    }

    /// Coefficient `k` of what the accelerations of link `i`'s equation have to balance.
    fn right_side(&self, i: usize, k: usize, effort: Real) -> Real {
        let mut right = effort - self.lagrangian.weight[i] * self.cos[k][i];
        for j in (0..N).filter(|&j| j != i) {
            let mut sum = Real::ZERO;
            for m in 0..=k {
                sum += self.across[m][i][j] * self.squared_rate[k - m][j];
            }
            for m in 1..=k {
                sum += self.along[m][i][j] * self.acceleration[k - m][j];
            }
            right += -(self.lagrangian.coupling[i][j] * sum);
        }
        right
    }

    /// Coefficient `k` of the joint efforts.
    fn effort(&self, drive: &JointDrive<N>, k: usize) -> [Real; N] {
        match drive {
            JointDrive::Constant(_) if k > 0 => [Real::ZERO; N],
            JointDrive::Constant(effort) => *effort,
            JointDrive::Law {
                kp,
                ki,
                kd,
                velocity,
                ..
            } => {
                let error = self.error(drive, k);
                let rate = differences(&self.rate[k]);
                std::array::from_fn(|i| {
                    let wanted = coefficient(velocity[i], k);
                    kp[i] * error[i] + ki[i] * self.integral[k][i] + kd[i] * (wanted - rate[i])
                })
            }
        }
    }

    /// Coefficient `k` of the position error; zeros where nothing is asked for.
    fn error(&self, drive: &JointDrive<N>, k: usize) -> [Real; N] {
        let JointDrive::Law { position, .. } = drive else {
            return [Real::ZERO; N];
        };
        let angle = differences(&self.angle[k]);
        std::array::from_fn(|i| coefficient(position[i], k) - angle[i])
    }

    /// The longest step whose last two terms stay below the tolerance, relative to the state where that is above 1.
    fn allowed_step(&self) -> f64 {
        let largest = |coefficients: &[Real; N]| {
            coefficients
                .iter()
                .map(|value| value.abs().to_f64())
                .fold(0.0, f64::max)
        };
        let scale = largest(&self.angle[0]).max(largest(&self.rate[0])).max(1.0);
        let allowed = |order: usize| {
            let size = largest(&self.angle[order])
                .max(largest(&self.rate[order]))
                .max(largest(&self.integral[order]));
            (self.setting.tolerance * scale / size).powf(1.0 / length_in_f64(order))
        };
        // A motion whose series ends (at rest, or coasting alone) would allow an endless step.
        const LONGEST: f64 = 1.0;
        allowed(self.setting.order)
            .min(allowed(self.setting.order - 1))
            .min(LONGEST)
    }
}

/// Coefficient `k` of a series that stays at `value`.
fn coefficient(value: Real, k: usize) -> Real {
    if k == 0 { value } else { Real::ZERO }
}

pub(super) fn evaluate<const N: usize>(
    series: &[[Real; N]],
    order: usize,
    step: Real,
) -> [Real; N] {
    let mut value = series[order];
    for coefficient in series[..order].iter().rev() {
        value = std::array::from_fn(|i| value[i] * step + coefficient[i]);
    }
    value
}

//! Taylor series of the arm's motion in double-double arithmetic, under constant efforts or under the law at every
//! instant. The step is chosen from the last two coefficients, so that what is cut off stays below a tolerance.
//!
//! The series is the study's (`study::taylor::series`, after Jorba and Zou), begun with the acceleration of the
//! Lagrangian in twice the digits.
//!
//! **Invariant:** a step never leaves out more than its tolerance by its own estimate; a proof needs a comparison of
//! two settings.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N, and over the coefficients computed so far, as they do in the recurrences"
)]

use super::double_double::DoubleDouble as Real;
use super::lagrangian::{Lagrangian, link_efforts};
use crate::math::arm::Arm;
use crate::math::count::length_in_f64;
use crate::study::taylor::series::{PowerSeries, differences, sums};

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

/// One step of a motion, as a series in the time from its beginning.
#[derive(Debug, Clone)]
pub(super) struct TaylorStep<const N: usize> {
    /// When it begins \[s\], and where the joints are then \[rad\].
    pub(super) begins: Real,
    pub(super) position: [Real; N],
    /// Coefficients of the joint angles, from that of order 1 on.
    pub(super) angle: Coefficients<N>,
}

/// The series of one motion. Kept between steps.
#[derive(Debug, Clone)]
pub(super) struct Taylor<const N: usize> {
    arm: Arm<N>,
    lagrangian: Lagrangian<N>,
    setting: Setting,
    series: PowerSeries<Real, N>,
    integral: Coefficients<N>,
}

impl<const N: usize> Taylor<N> {
    pub(super) fn new(arm: &Arm<N>, setting: Setting) -> Self {
        Self {
            arm: *arm,
            lagrangian: Lagrangian::new(arm),
            setting,
            series: PowerSeries::new(),
            integral: vec![[Real::ZERO; N]; setting.order + 1],
        }
    }

    /// Moves `state` and `drive` on by `time` \[s\], in as many steps as the tolerance asks for.
    pub(super) fn advance(&mut self, state: &mut Exact<N>, drive: &JointDrive<N>, time: f64) {
        self.go(state, drive, time, |_, _, _| ());
    }

    /// As [`Taylor::advance`], and keeps the series of every step.
    pub(super) fn path(
        &mut self,
        state: &mut Exact<N>,
        drive: &JointDrive<N>,
        time: f64,
    ) -> Vec<TaylorStep<N>> {
        let mut pieces = Vec::new();
        self.go(state, drive, time, |taylor, state, rest| {
            let angle = &taylor.series.angle[1..=taylor.setting.order];
            pieces.push(TaylorStep {
                begins: Real::from(time) - rest,
                position: state.position,
                angle: angle.iter().map(differences).collect(),
            });
        });
        pieces
    }

    fn go(
        &mut self,
        state: &mut Exact<N>,
        drive: &JointDrive<N>,
        time: f64,
        mut keep: impl FnMut(&Self, &Exact<N>, Real),
    ) {
        let mut rest = Real::from(time);
        while rest.to_f64() > 0.0 {
            self.expand(state, drive);
            keep(self, state, rest);
            let allowed = self.allowed_step(state);
            let last = allowed >= rest.to_f64();
            let step = if last { rest } else { Real::from(allowed) };
            let (dq, dv) = self.series.change(step);
            *state = Exact {
                position: std::array::from_fn(|i| state.position[i] + dq[i]),
                velocity: std::array::from_fn(|i| state.velocity[i] + dv[i]),
                integral: evaluate(&self.integral, step),
            };
            if last {
                break;
            }
            rest = rest - step;
        }
    }

    /// The series about `state`.
    fn expand(&mut self, state: &Exact<N>, drive: &JointDrive<N>) {
        let Exact {
            position, velocity, ..
        } = state;
        self.integral[0] = state.integral;
        let effort = self.effort(drive, 0, position, velocity);
        let acceleration = self.lagrangian.acceleration(position, velocity, &effort);
        let directions = position.map(Real::sin_cos);
        let directions = (directions.map(|one| one.0), directions.map(|one| one.1));
        self.series
            .begin(&self.arm, &directions, velocity, &acceleration);
        self.integral[1] = error(drive, 0, position);
        for k in 1..self.setting.order {
            let angle = differences(&self.series.angle[k]);
            let rate = differences(&self.series.rate[k]);
            let effort = link_efforts(&self.effort(drive, k, &angle, &rate));
            self.series.extend(&effort);
            let next = Real::ONE / Real::from(length_in_f64(k + 1));
            self.integral[k + 1] = error(drive, k, &angle).map(|error| error * next);
        }
    }

    /// Coefficient `k` of the joint efforts, by those of the joints' angles and rates.
    fn effort(
        &self,
        drive: &JointDrive<N>,
        k: usize,
        angle: &[Real; N],
        rate: &[Real; N],
    ) -> [Real; N] {
        match drive {
            JointDrive::Constant(effort) => effort.map(|effort| coefficient(effort, k)),
            JointDrive::Law {
                kp,
                ki,
                kd,
                velocity,
                ..
            } => {
                let error = error(drive, k, angle);
                std::array::from_fn(|i| {
                    let wanted = coefficient(velocity[i], k);
                    kp[i] * error[i] + ki[i] * self.integral[k][i] + kd[i] * (wanted - rate[i])
                })
            }
        }
    }

    /// The longest step whose last two terms stay below the tolerance, relative to the state where that is above 1.
    fn allowed_step(&self, state: &Exact<N>) -> f64 {
        let largest = |coefficients: &[Real; N]| {
            coefficients
                .iter()
                .map(|value| value.abs().to_f64())
                .fold(0.0, f64::max)
        };
        let PowerSeries { angle, rate, .. } = &self.series;
        let scale = largest(&sums(&state.position))
            .max(largest(&rate[0]))
            .max(1.0);
        let allowed = |order: usize| {
            let size = largest(&angle[order])
                .max(largest(&rate[order]))
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

/// Coefficient `k` of the position error; zeros where nothing is asked for.
fn error<const N: usize>(drive: &JointDrive<N>, k: usize, angle: &[Real; N]) -> [Real; N] {
    let JointDrive::Law { position, .. } = drive else {
        return [Real::ZERO; N];
    };
    std::array::from_fn(|i| coefficient(position[i], k) - angle[i])
}

/// The sum of a series after a time \[s\].
pub(super) fn evaluate<const N: usize>(series: &[[Real; N]], time: Real) -> [Real; N] {
    let sum = |sum: [Real; N], coefficient: &[Real; N]| {
        std::array::from_fn(|i| sum[i] * time + coefficient[i])
    };
    series.iter().rev().fold([Real::ZERO; N], sum)
}

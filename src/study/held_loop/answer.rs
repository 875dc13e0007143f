//! The limits of a held loop, the mode that sets them, and the changes that would make a period stable.
//!
//! **Invariant:** a value is `None` where nothing was found, and the number of evaluations is bounded.

use std::f64::consts::TAU;

use libm::{atan2, hypot};

use super::HeldLoop;
use crate::math::shown::Shown;
use crate::study::critical::{fastest, shape};
use crate::study::matrix::{Complex, Matrix};
use crate::study::paused::pause;
use crate::study::stability::{NEUTRAL, bisect_in_pieces, first_unstable_until};

/// The critical mode is examined at this multiple of the limit.
const JUST_BEYOND: f64 = 1.01;

/// Most steps in a period that are tried for the largest timestep.
const MOST_STEPS: u32 = 64;

/// Factors between the values of kd, and of the inertia, that an inverse question tries, and their number.
const KD_FACTOR: f64 = 1.25;
const KD_TRIALS: u32 = 80;
const INERTIA_FACTOR: f64 = 2.0;
const INERTIA_TRIALS: u32 = 34;

/// The mode that grows first.
#[derive(Debug, Clone, PartialEq)]
pub struct CriticalMode {
    /// Factor by which it grows in a period 1 % beyond the limit.
    pub growth_per_period: f64,
    /// Its frequency \[Hz\]: half of the periods per second if it reverses at every one.
    pub frequency: f64,
    /// The joint that moves most, counted from 0.
    pub joint: usize,
    /// The motion of each joint relative to that of the one that moves most; negative if it moves against it.
    pub mode: Vec<f64>,
    /// Whether it reverses at every period.
    pub reverses: bool,
}

/// The loop at a given control period.
#[derive(Debug, Clone, PartialEq)]
pub struct AtPeriod {
    /// The period \[s\].
    pub period: f64,
    /// Whether no mode grows.
    pub is_stable: bool,
    /// Factor by which the fastest growing mode grows in a period, or the slowest decaying one decays.
    pub growth_per_period: f64,
    /// The largest timestep \[s\] of at most one period at which no mode grows. Zero: none was found.
    pub timestep_limit: Option<f64>,
    /// Largest factor by which `kd` may be multiplied.
    pub kd_factor: Option<f64>,
    /// Least inertia \[kg m²\] that, added to each joint, makes the period stable.
    pub armature: Option<f64>,
}

/// The limits of a held loop.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldLimit {
    /// The largest period \[s\] up to which no mode grows, with the given number of steps in each. Zero if a mode grows at
    /// every period, `None` if no limit was found.
    pub period_limit: Option<f64>,
    /// The mode that grows just beyond.
    pub critical: Option<CriticalMode>,
    /// The inertia \[kg m²\] that each joint moves while the others are free.
    pub effective_inertia: Vec<f64>,
    /// The loop at the given period.
    pub at: Option<AtPeriod>,
    /// The result in words.
    pub explanation: String,
}

/// All limits. A piece of the computation has one evaluation of the eigenvalues.
pub async fn held_limit(held: HeldLoop, period: Option<f64>) -> HeldLimit {
    let modes = held.modes();
    pause().await;
    let growth = |period| held.growth(period);
    let period_limit = first_unstable_until(&modes, modes.long(held.steps), growth).await;
    let beyond = period_limit.map(|limit| {
        if limit > 0.0 {
            JUST_BEYOND * limit
        } else {
            modes.tiny()
        }
    });
    let critical = beyond.and_then(|period| held.critical(period));
    pause().await;
    let mut at = None;
    let mut needed = None;
    if let Some(period) = period {
        let found = held.at(period).await;
        let reverses = critical
            .as_ref()
            .filter(|it| it.reverses && !found.is_stable);
        if let Some(mode) = reverses {
            needed = held.least_armature(&[mode.joint], period).await;
        }
        at = Some(found);
    }
    HeldLimit {
        explanation: held.explanation(period_limit, critical.as_ref(), at.as_ref(), needed),
        effective_inertia: (0..held.joints())
            .map(|j| held.effective_inertia(j))
            .collect(),
        period_limit,
        critical,
        at,
    }
}

impl HeldLoop {
    fn is_stable(&self, period: f64) -> bool {
        self.growth(period) <= NEUTRAL
    }

    fn critical(&self, period: f64) -> Option<CriticalMode> {
        let generator = self.generator(period);
        let mu = fastest(&generator, 1.0)?;
        let (re, im) = (1.0 + mu.re, mu.im);
        let shape = shape(&generator, mu)?;
        let position = |j: usize| {
            let sum = |part: fn(&Complex) -> f64| {
                let along = (0..self.joints()).zip(&shape);
                along.map(|(k, it)| self.axes[(j, k)] * part(it)).sum()
            };
            let (re, im) = (sum(|it| it.re), sum(|it| it.im));
            Complex { re, im }
        };
        let shape: Vec<Complex> = (0..self.joints()).map(position).collect();
        let size = |j: &usize| shape[*j].modulus();
        let joint = (0..shape.len()).max_by(|i, j| size(i).total_cmp(&size(j)))?;
        let most = shape[joint];
        let relative = |it: &Complex| {
            let along = it.re * most.re + it.im * most.im;
            (it.modulus() / most.modulus()).copysign(along)
        };
        let found = CriticalMode {
            growth_per_period: hypot(re, im).max(1.0),
            frequency: atan2(im.abs(), re) / (TAU * period),
            joint,
            mode: shape.iter().map(relative).collect(),
            reverses: im == 0.0 && re < 0.0,
        };
        let is_finite = found.growth_per_period.is_finite()
            && found.frequency.is_finite()
            && found.mode.iter().all(|it| it.is_finite());
        is_finite.then_some(found)
    }

    async fn at(&self, period: f64) -> AtPeriod {
        let fastest = fastest(&self.generator(period), 1.0);
        let growth_per_period = fastest.map_or(1.0, |mu| hypot(1.0 + mu.re, mu.im));
        let is_stable = self.is_stable(period);
        let mut steps = 1;
        let mut timestep_limit = None;
        while self.between != super::Between::Exact && timestep_limit.is_none() {
            pause().await;
            if self.with_steps(steps).is_stable(period) {
                timestep_limit = Some(period / f64::from(steps));
            } else if steps == MOST_STEPS {
                timestep_limit = Some(0.0);
            }
            steps += 1;
        }
        let every: Vec<usize> = (0..self.joints()).collect();
        AtPeriod {
            period,
            is_stable,
            growth_per_period,
            timestep_limit,
            kd_factor: self.largest_kd(period).await,
            armature: self.least_armature(&every, period).await,
        }
    }

    /// The largest factor of `kd` at which the period is stable, downwards from one at which it certainly is not.
    async fn largest_kd(&self, period: f64) -> Option<f64> {
        let largest = self.scaled.kd.spectral_radius();
        if !largest.is_normal() {
            return None;
        }
        // A damping rate of 100 per period, even if the robot's own damping is implicit.
        let own = 1.0 + self.scaled.damping.spectral_radius() * period;
        let mut factor = 100.0 * own / (largest * period);
        for _ in 0..KD_TRIALS {
            let next = factor / KD_FACTOR;
            pause().await;
            if self.with_damping_gain(next).is_stable(period) {
                let holds = |factor| self.with_damping_gain(factor).is_stable(period);
                return Some(bisect_in_pieces((next, factor), 60, holds).await);
            }
            factor = next;
        }
        None
    }

    /// The least inertia \[kg m²\] that, added to each of these joints, makes the period stable.
    async fn least_armature(&self, joints: &[usize], period: f64) -> Option<f64> {
        if self.is_stable(period) {
            return Some(0.0);
        }
        let needs = |inertia: f64| {
            let held = self.with_armature(joints, inertia);
            !held.is_some_and(|held| held.is_stable(period))
        };
        let own = joints.iter().map(|&j| self.effective_inertia(j));
        let least = own.fold(f64::INFINITY, f64::min);
        let (mut too_little, mut inertia) = (1e-6 * least, 1e-4 * least);
        for _ in 0..INERTIA_TRIALS {
            pause().await;
            if !needs(inertia) {
                let boundary = bisect_in_pieces((too_little, inertia), 60, needs).await;
                // The search returns the last value that is too little.
                return Some(boundary * (1.0 + 1e-12));
            }
            (too_little, inertia) = (inertia, INERTIA_FACTOR * inertia);
        }
        None
    }

    /// The result in words and numbers.
    fn explanation(
        &self,
        limit: Option<f64>,
        critical: Option<&CriticalMode>,
        at: Option<&AtPeriod>,
        needed: Option<f64>,
    ) -> String {
        let mut told = match limit {
            None => "no mode grows at any period that was tried".to_owned(),
            Some(0.0) => "a mode grows at every period".to_owned(),
            Some(limit) => format!("no mode grows up to a period of {} s", Shown(limit)),
        };
        let mut add = |text: String| told.push_str(&text);
        if let Some(mode) = critical {
            let joint = mode.joint;
            let own = |matrix: &Matrix| matrix[(joint, joint)];
            let (kp, kd) = (own(&self.joints.kp), Shown(own(&self.joints.kd)));
            let has = self.effective_inertia(joint);
            add(if mode.reverses {
                format!(
                    "; then joint[{joint}] reverses at every period: kd {kd} N m s/rad on an effective inertia of {} kg m^2",
                    Shown(has)
                )
            } else if limit == Some(0.0) {
                format!("; that of joint[{joint}] fastest")
            } else {
                format!(
                    "; then joint[{joint}] oscillates at {} Hz: kp {} N m/rad, held, acts like a damping of {} N m s/rad, \
                     beside kd {kd} N m s/rad",
                    Shown(mode.frequency),
                    Shown(kp),
                    Shown(-kp * self.lag() * limit.unwrap_or_default()),
                )
            });
            if let Some((at, more)) = at.zip(needed) {
                add(format!(
                    "; joint[{joint}]: kd {kd} N m s/rad needs an effective inertia of at least {} kg m^2 at {} s",
                    Shown(has + more),
                    Shown(at.period)
                ));
            }
        }
        if let Some(at) = at {
            let ways = [
                at.kd_factor.map(|it| format!("kd times {}", Shown(it))),
                at.armature
                    .map(|it| format!("{} kg m^2 more at each joint", Shown(it))),
            ];
            let ways: Vec<String> = ways.into_iter().flatten().collect();
            add(match (at.is_stable, ways.is_empty()) {
                (true, _) => format!("; stable at {} s", Shown(at.period)),
                (false, true) => format!("; unstable at {} s", Shown(at.period)),
                _ => format!(
                    "; stable at {} s with {}",
                    Shown(at.period),
                    ways.join(", or ")
                ),
            });
        }
        told
    }
}

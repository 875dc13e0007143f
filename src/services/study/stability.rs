//! `/study/stability`: the largest stable timesteps of a control loop.
//!
//! The present gains count, even if the controller is off. Gains of zero examine the free arm. The motion is the
//! motion that begins at `q` and `qd`, by default the present arm's.
//!
//! **Invariant:** a limit is missing if no unstable timestep was found, and 0 if no stable one was found.

use bytes::Bytes;

use super::{Changed, Computed, Present, StudyWork};
use crate::math::arm::ArmError;
use crate::protocol::op::fields::{Fields, Rejections};
use crate::services::Address;
use crate::study::clocks::{ClockLimits, clock_limits};
use crate::study::motion::{FREE_SECONDS, Motion};
use crate::study::stability::{Limits, search_limits};

// ---- question -------------------------------------------------------------------------------------------------------

request! {
    whole
    /// Predicts the largest stable timesteps of a control loop.
    #[derive(Debug, Clone, PartialEq, Default)]
    pub struct PredictStability<N> -> Result<Box<Predicted<N>>, ArmError>, |fields| {
        /// Changes of the present loop, and the state from which the motion begins.
        changed: Changed<N> = Changed::read(&mut fields),
    }

    fn write(answer: Result<Box<Predicted<N>>, ArmError>, to: &Address) -> Bytes {
        let answer = answer.map_err(|why| format!("params {why}"));
        to.outcome(answer.as_ref().map(|predicted| {
            let Predicted {
                limits,
                clocks,
                motion,
                ..
            } = &**predicted;
            let critical = limits.critical.map(|critical| {
                object! {
                    growth_per_step: critical.growth_per_step,
                    frequency: critical.frequency,
                    joint: critical.joint,
                }
            });
            object! {
                control_period_limit: clocks.period,
                timestep_limit: clocks.timestep,
                timestep_limit_held: limits.held,
                timestep_limit_continuous: limits.continuous,
                equilibrium: limits.equilibrium.as_slice(),
                equilibrium_kind: limits.rest.name(),
                minimum_over_poses_held: limits.minimum_held,
                minimum_over_poses_continuous: limits.minimum_continuous,
                minimum_over_poses_bound: limits.bound,
                bound_is_proven: limits.bound_is_proven,
                certified: limits.certified,
                worst_pose: limits.worst_pose.as_ref().map(<[f64; N]>::as_slice),
                critical: critical,
                timestep_limit_motion: Some(motion.timestep).filter(|it| it.is_finite()),
                motion_speed: motion.speed,
                advised_timestep: limits.advised_for(motion),
                advised_duration: predicted.is_free.then_some(FREE_SECONDS),
            }
        }))
    }
}

/// A prediction.
pub struct Predicted<const N: usize> {
    /// The largest stable timesteps.
    pub limits: Limits<N>,
    /// The limits of control period and timestep.
    pub clocks: ClockLimits,
    /// The coming motion, and its largest timestep.
    pub motion: Motion,
    /// Whether the arm is free.
    pub is_free: bool,
}

// ---- work -----------------------------------------------------------------------------------------------------------

impl<const N: usize> Computed<N> for PredictStability<N> {
    type Work = StudyWork<Self::Answer>;

    fn work(self, present: Present<N>) -> Self::Work {
        StudyWork::new::<N>(async move {
            let control = self.changed.applied_to(&present.control)?;
            let start = self.changed.state(&present.state);
            Ok(Box::new(Predicted {
                motion: Motion::ahead(&control, &start),
                clocks: clock_limits(&control),
                is_free: control.is_free(),
                limits: search_limits(control).await,
            }))
        })
    }
}

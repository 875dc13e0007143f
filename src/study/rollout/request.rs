//! The request for a rollout, and the reasons to reject it.
//!
//! **Invariant:** an accepted request has a bounded number of steps and samples, and only finite numbers.

use crate::math::arm::State;
use crate::math::count::{in_f64, steps_in, whole};
use crate::math::pid::Gains;
use crate::math::shown::{Shown, shown_against};
use crate::study::control_loop::ControlLoop;

/// Most steps of one run: a few seconds of one core, or up to two minutes with a reference under control.
pub const MAX_STEPS: u64 = 10_000_000;

/// Most samples of one run, some 30 MB of JSON.
pub const MAX_SAMPLES: u64 = 100_000;

/// The request for a run: its loop, its start, its length and its samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RolloutRequest<const N: usize> {
    /// The loop of the run.
    pub control: ControlLoop<N>,
    /// The arm's state at the start.
    pub start: State<N>,
    /// Duration \[s\]; the run has the nearest number of steps.
    pub duration: f64,
    /// The number of samples, with start and end; fewer if the run has fewer steps.
    pub samples: u64,
    /// Whether to compute a reference too.
    pub reference: bool,
}

/// Why a request is rejected. The field names are those of the request.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RolloutError {
    /// A number that is NaN or infinite, a negative gain, or a time that is not positive.
    #[error("{field} must be {bound}, got {}", Shown(*.value))]
    OutOfBounds {
        /// `q0`, `qdot0`, `duration`, `timestep`, `kp`, `ki`, `kd` or `setpoint`.
        field: &'static str,
        /// `finite`, `at least 0` or `greater than 0`.
        bound: &'static str,
        /// The given value.
        value: f64,
    },
    /// Less than one step.
    #[error(
        "duration must be at least the timestep {}, got {}",
        shown_against(*.timestep, *.duration),
        shown_against(*.duration, *.timestep)
    )]
    TooShort {
        /// The given time \[s\].
        duration: f64,
        /// The given time \[s\].
        timestep: f64,
    },
    /// More steps than [`MAX_STEPS`].
    #[error(
        "duration / timestep must be at most {MAX_STEPS:e} steps, got {}",
        shown_against(*.steps, in_f64(MAX_STEPS))
    )]
    TooManySteps {
        /// The given value.
        steps: f64,
    },
    /// Fewer than 2 samples, or more than [`MAX_SAMPLES`].
    #[error("samples must be between 2 and {MAX_SAMPLES}, got {samples}")]
    Samples {
        /// The given value.
        samples: u64,
    },
}

impl<const N: usize> RolloutRequest<N> {
    /// The number of steps that is nearest to the duration.
    ///
    /// # Errors
    /// The first value that is out of bounds.
    pub fn steps(&self) -> Result<u64, RolloutError> {
        let ControlLoop {
            gains: Gains { kp, ki, kd },
            setpoint,
            timestep,
            ..
        } = self.control;
        let fields: [(&'static str, &[f64]); 9] = [
            ("q0", &self.start.position),
            ("qdot0", &self.start.velocity),
            ("duration", &[self.duration]),
            ("timestep", &[timestep]),
            ("kp", &kp),
            ("ki", &ki),
            ("kd", &kd),
            ("setpoint", &setpoint.position),
            ("setpoint", &setpoint.velocity),
        ];
        for (field, values) in fields {
            let is_gain = field.starts_with('k');
            let is_time = field == "duration" || field == "timestep";
            for &value in values {
                let bound = match value {
                    value if !value.is_finite() => "finite",
                    value if is_gain && value < 0.0 => "at least 0",
                    value if is_time && value <= 0.0 => "greater than 0",
                    _ => continue,
                };
                return Err(RolloutError::OutOfBounds {
                    field,
                    bound,
                    value,
                });
            }
        }
        let duration = self.duration;
        let steps = steps_in(duration, timestep);
        if steps < 1.0 {
            return Err(RolloutError::TooShort { duration, timestep });
        }
        let steps = steps.round();
        if steps > in_f64(MAX_STEPS) {
            return Err(RolloutError::TooManySteps { steps });
        }
        if !(2..=MAX_SAMPLES).contains(&self.samples) {
            let samples = self.samples;
            return Err(RolloutError::Samples { samples });
        }
        Ok(whole(steps))
    }
}

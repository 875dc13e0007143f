//! What an offline run is asked for, and why it is refused.
//!
//! **Invariant:** a plan that passes has a bounded number of steps and samples, and no number that is not finite.

use crate::math::arm::{Arm, State};
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};

/// Most steps of one run: some seconds of one core, with a reference under control up to a minute.
pub const MAX_STEPS: u64 = 10_000_000;

/// Most samples of one run, some 30 MB of JSON.
pub const MAX_SAMPLES: u64 = 100_000;

/// What to run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan<const N: usize> {
    /// The arm.
    pub arm: Arm<N>,
    /// Where it starts.
    pub start: State<N>,
    /// How long \[s\]; the run ends with the last whole step within it.
    pub duration: f64,
    /// Length of a step \[s\].
    pub timestep: f64,
    /// The method.
    pub method: Method,
    /// Gains of the controller; `None`: no control.
    pub gains: Option<Gains<N>>,
    /// What the controller is to hold.
    pub setpoint: Setpoint<N>,
    /// How many samples, start and end among them, if there are as many steps.
    pub samples: u64,
    /// Whether to run the reference too.
    pub reference: bool,
}

/// Why a run is refused. The field names are those of the request.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RolloutError {
    /// A number that is NaN or infinite.
    #[error("{field} must be finite, got {value}")]
    NotFinite {
        /// `q0`, `qdot0`, `duration`, `timestep`, `kp`, `ki`, `kd` or `setpoint`.
        field: &'static str,
        /// What was given.
        value: f64,
    },
    /// A duration or a timestep that is zero or negative.
    #[error("{field} must be greater than 0, got {value}")]
    NotPositive {
        /// `duration` or `timestep`.
        field: &'static str,
        /// What was given \[s\].
        value: f64,
    },
    /// A gain that is negative.
    #[error("{field} must be at least 0, got {value}")]
    Negative {
        /// `kp`, `ki` or `kd`.
        field: &'static str,
        /// What was given.
        value: f64,
    },
    /// Not one whole step.
    #[error("duration must be at least the timestep {timestep}, got {duration}")]
    TooShort {
        /// What was given \[s\].
        duration: f64,
        /// What was given \[s\].
        timestep: f64,
    },
    /// More steps than [`MAX_STEPS`].
    #[error("duration / timestep must be at most {MAX_STEPS} steps, got {steps}")]
    TooManySteps {
        /// What was given.
        steps: f64,
    },
    /// Fewer samples than start and end, or more than [`MAX_SAMPLES`].
    #[error("samples must be between 2 and {MAX_SAMPLES}, got {samples}")]
    Samples {
        /// What was given.
        samples: u64,
    },
}

impl<const N: usize> Plan<N> {
    /// How many whole steps the duration holds. A quotient that falls short of a whole number by rounding counts as that.
    ///
    /// # Errors
    /// The first value that is out of bounds.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "the quotient is checked to lie between 1 and MAX_STEPS"
    )]
    pub(super) fn check(&self) -> Result<u64, RolloutError> {
        let [kp, ki, kd] = self
            .gains
            .map_or([[0.0; N]; 3], |gains| [gains.kp, gains.ki, gains.kd]);
        let fields: [(&'static str, &[f64]); 9] = [
            ("q0", &self.start.position),
            ("qdot0", &self.start.velocity),
            ("duration", &[self.duration]),
            ("timestep", &[self.timestep]),
            ("kp", &kp),
            ("ki", &ki),
            ("kd", &kd),
            ("setpoint", &self.setpoint.position),
            ("setpoint", &self.setpoint.velocity),
        ];
        for (field, values) in fields {
            if let Some(&value) = values.iter().find(|value| !value.is_finite()) {
                return Err(RolloutError::NotFinite { field, value });
            }
            if field.starts_with('k')
                && let Some(&value) = values.iter().find(|&&value| value < 0.0)
            {
                return Err(RolloutError::Negative { field, value });
            }
        }
        let (duration, timestep) = (self.duration, self.timestep);
        for (field, value) in [("duration", duration), ("timestep", timestep)] {
            if value <= 0.0 {
                return Err(RolloutError::NotPositive { field, value });
            }
        }
        let steps = (duration / timestep * (1.0 + 4.0 * f64::EPSILON)).floor();
        if steps < 1.0 {
            return Err(RolloutError::TooShort { duration, timestep });
        }
        if steps > MAX_STEPS as f64 {
            return Err(RolloutError::TooManySteps { steps });
        }
        if !(2..=MAX_SAMPLES).contains(&self.samples) {
            let samples = self.samples;
            return Err(RolloutError::Samples { samples });
        }
        Ok(steps as u64)
    }
}

//! What the controller measures of the joints: positions by encoders with whole steps, and velocities that are exact or
//! differences of the measured positions.
//!
//! | measured | value |
//! | --- | --- |
//! | position | the whole multiple of the encoder's step that is nearest to `q`; `q` with a step of 0 |
//! | velocity, `exact` | `q̇` |
//! | velocity, `difference` | `(p - p') / T`, with the measured positions of this run of the law and of the one before, `T` earlier |
//!
//! The first difference is zero, as that of a counter that has just been switched on.
//!
//! Source: Belanger, *Estimation of angular velocity and acceleration from shaft encoder measurements* (1992).
//!
//! **Invariant:** sensors without steps and with exact velocities measure the state itself, bit for bit.

#![allow(
    clippy::indexing_slicing,
    reason = "every index comes from `array::from_fn` over arrays of the same constant length"
)]

use super::arm::State;

/// Most control periods by which an effort may be late.
pub const MAX_DELAY: u8 = 16;

/// How a velocity is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum VelocitySource {
    /// It is that of the joint.
    #[default]
    Exact,
    /// It is the difference of two measured positions, divided by the control period.
    Difference,
}

impl VelocitySource {
    /// Both, the default first.
    pub const ALL: [Self; 2] = [Self::Exact, Self::Difference];

    /// The name that requests and messages use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Difference => "difference",
        }
    }
}

/// The sensors of the joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensors<const N: usize> {
    /// The step of each encoder \[rad\], not negative; 0 for an exact position.
    pub encoder_step: [f64; N],
    /// How the velocities are measured.
    pub velocity: VelocitySource,
}

/// Exact ones.
impl<const N: usize> Default for Sensors<N> {
    fn default() -> Self {
        Self {
            encoder_step: [0.0; N],
            velocity: VelocitySource::Exact,
        }
    }
}

impl<const N: usize> Sensors<N> {
    /// Whether they measure the state itself.
    #[must_use]
    pub fn are_exact(&self) -> bool {
        self.velocity == VelocitySource::Exact && self.encoder_step.iter().all(|step| *step <= 0.0)
    }

    /// The measured values of `state`, `period` \[s\] after the measurement `before`.
    #[must_use]
    pub fn measured(&self, state: &State<N>, before: Option<&State<N>>, period: f64) -> State<N> {
        let mut position = state.position;
        for (position, step) in position.iter_mut().zip(&self.encoder_step) {
            if *step > 0.0 {
                let counted = (*position / step).round() * step;
                if counted.is_finite() {
                    *position = counted;
                }
            }
        }
        let velocity = match (self.velocity, before) {
            (VelocitySource::Exact, _) => state.velocity,
            (VelocitySource::Difference, None) => [0.0; N],
            (VelocitySource::Difference, Some(before)) => {
                std::array::from_fn(|i| (position[i] - before.position[i]) / period)
            }
        };
        State { position, velocity }
    }
}

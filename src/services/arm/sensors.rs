//! `/pid_controller/set_sensors`: what the controller measures, and how late its efforts are.
//!
//! **Invariant:** setting the present values does not change the arm.

use bytes::Bytes;

use crate::math::sensors::{MAX_DELAY, Sensors, VelocitySource};
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::{Address, Echo};

request! {
    /// Sets the sensors of the controller.
    pub struct SetSensors<N> -> Echo<SensorsInForce<N>>, |fields| {
        /// The step of each encoder \[rad\], at least 0; 0 for an exact position.
        encoder_step: Option<[f64; N]> = fields.array("encoder_step", Bound::NonNegative),
        /// How the velocities are measured.
        velocity: Option<VelocitySource> =
            fields.choice("velocity", &VelocitySource::ALL, VelocitySource::name),
        /// The number of control periods after which an effort is applied, up to [`MAX_DELAY`].
        delay: Option<u8> = fields
            .count("delay", 0..=u64::from(MAX_DELAY))
            .and_then(|delay| u8::try_from(delay).ok()),
    }

    fn write(Echo { values, rejected }: Echo<SensorsInForce<N>>, to: &Address) -> Bytes {
        let values = object! {
            encoder_step: values.sensors.encoder_step.as_slice(),
            velocity: values.sensors.velocity.name(),
            delay: values.delay,
        };
        to.response(&values, &rejected.status())
    }
}

/// The present sensors, and the delay of the efforts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorsInForce<const N: usize> {
    /// The sensors.
    pub sensors: Sensors<N>,
    /// The delay \[control periods\].
    pub delay: u8,
}

impl<const N: usize> SetSensors<N> {
    /// `present` with these changes.
    #[must_use]
    pub fn applied_to(&self, present: &SensorsInForce<N>) -> SensorsInForce<N> {
        let SensorsInForce { sensors, delay } = *present;
        SensorsInForce {
            sensors: Sensors {
                encoder_step: self.encoder_step.unwrap_or(sensors.encoder_step),
                velocity: self.velocity.unwrap_or(sensors.velocity),
            },
            delay: self.delay.unwrap_or(delay),
        }
    }
}

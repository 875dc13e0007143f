//! `/pid_controller/*`: gains, control period, limits of the motors, sensors, on and off.
//!
//! **Invariant:** values that are not given do not change. Setting the present values does not change the arm, except that
//! a switch ends a commanded effort, and the older `delay` shortens a delay of more than 1.

use crate::math::limits::{AntiWindup, Limits};
use crate::math::pid::Gains;
use crate::math::sensors::{MAX_DELAY, Sensors, VelocitySource};
use crate::math::simulation::ControlPeriod;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::Echo;

request! {
    /// Sets the controller's gains, each at least 0.
    pub struct SetGains<N> -> Echo<Gains<N>>, |fields| {
        /// \[N m/rad\].
        kp: Option<[f64; N]> = fields.array("kp", Bound::NonNegative),
        /// \[N m/(rad s)\].
        ki: Option<[f64; N]> = fields.array("ki", Bound::NonNegative),
        /// \[N m s/rad\].
        kd: Option<[f64; N]> = fields.array("kd", Bound::NonNegative),
    }

    |values| {
        kp: values.kp.as_slice(),
        ki: values.ki.as_slice(),
        kd: values.kd.as_slice(),
    }
}

impl<const N: usize> SetGains<N> {
    /// `gains` with these changes.
    #[must_use]
    pub fn applied_to(&self, gains: &Gains<N>) -> Gains<N> {
        Gains {
            kp: self.kp.unwrap_or(gains.kp),
            ki: self.ki.unwrap_or(gains.ki),
            kd: self.kd.unwrap_or(gains.kd),
        }
    }
}

request! {
    /// Sets the time between two runs of the control law.
    pub struct SetPeriod -> Echo<PeriodInForce>, |fields| {
        /// That time \[s\], not negative; 0 for every step.
        period: Option<f64> = fields.number("period", Bound::NonNegative),
        /// An older name of the delay of [`SetSensors`]: `false` is 0 periods and `true` is 1. The answer is `true` at
        /// any delay.
        delay: Option<bool> = fields.boolean("delay"),
    }

    |values| {
        period: values.period.period,
        effective_period: values.effective,
        delay: values.period.delay > 0,
    }
}

/// The present control period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PeriodInForce {
    /// The requested time, and the delay.
    pub period: ControlPeriod,
    /// The effective period, a whole number of timesteps \[s\].
    pub effective: f64,
}

request! {
    /// Sets the largest efforts that the motors apply, and what the integral does meanwhile.
    pub struct SetLimits<N> -> Echo<Limits<N>>, |fields| {
        /// The largest effort of each joint \[N m\], at least 0; 0 is a joint without a motor. `Some(None)` ends the
        /// limit.
        effort: Option<Option<[f64; N]>> = fields.array_or_null("effort", Bound::NonNegative),
        /// The form of anti-windup.
        anti_windup: Option<AntiWindup> = fields.choice("anti_windup", &AntiWindup::ALL, AntiWindup::name),
        /// The tracking time of the back calculation \[s\], greater than 0.
        tracking_time: Option<f64> = fields.number("tracking_time", Bound::Positive),
    }

    |values| {
        effort: values.effort.as_ref().map(<[f64; N]>::as_slice),
        anti_windup: values.anti_windup.name(),
        tracking_time: values.tracking_time,
    }
}

impl<const N: usize> SetLimits<N> {
    /// `limits` with these changes.
    #[must_use]
    pub fn applied_to(&self, limits: &Limits<N>) -> Limits<N> {
        Limits {
            effort: self.effort.unwrap_or(limits.effort),
            anti_windup: self.anti_windup.unwrap_or(limits.anti_windup),
            tracking_time: self.tracking_time.unwrap_or(limits.tracking_time),
        }
    }
}

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

    |values| {
        encoder_step: values.sensors.encoder_step.as_slice(),
        velocity: values.sensors.velocity.name(),
        delay: values.delay,
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

request! {
    /// Switches the controller on or off. The answer is whether it is on.
    pub struct Enable -> Echo<bool>, |fields| {
        /// True to switch it on.
        enabled: Option<bool> = fields.boolean("data"),
    }

    |data| { data: *data }
}

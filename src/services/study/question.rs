//! The arm, its loop and its state in a question.
//!
//! **Invariant:** all questions have the same names and defaults. A missing value is the live arm's.

use crate::math::arm::{ArmError, State};
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};
use crate::math::sensors::MAX_DELAY;
use crate::math::simulation::ControlPeriod;
use crate::protocol::op::fields::{Bound, Fields};
use crate::protocol::wire::json;
use crate::services::arm::{SensorsInForce, SetGains, SetLimits, SetParams, SetSensors};
use crate::study::control_loop::ControlLoop;

/// The arm's settings at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Present<const N: usize> {
    /// The loop with the present gains, even if the controller is off.
    pub control: ControlLoop<N>,
    /// The arm's positions and velocities.
    pub state: State<N>,
}

impl<const N: usize> Present<N> {
    /// The present loop with another control period \[s\].
    pub(super) fn with_period(&self, period: f64) -> ControlLoop<N> {
        let delay = self.control.period.delay;
        let period = ControlPeriod { period, delay };
        ControlLoop {
            period,
            ..self.control
        }
    }
}

/// Changes of the arm, its loop and its state, as far as a service has these fields.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Changed<const N: usize> {
    /// The method that takes the steps.
    pub method: Option<Method>,
    /// Length of a step \[s\], greater than 0.
    pub timestep: Option<f64>,
    /// Parameters of the arm.
    pub params: Option<SetParams<N>>,
    /// Viscous friction of the joints \[N m s/rad\].
    pub viscous: Option<[f64; N]>,
    /// Gains.
    pub gains: Option<SetGains<N>>,
    /// The setpoint \[rad\], at rest.
    pub setpoint: Option<[f64; N]>,
    /// The time between two runs of the control law \[s\], not negative; 0 for every step.
    pub control_period: Option<f64>,
    /// The delay \[control periods\], unless the sensors have one.
    pub delay: Option<u8>,
    /// Limits of the motors.
    pub limits: Option<SetLimits<N>>,
    /// Sensors.
    pub sensors: Option<SetSensors<N>>,
    /// Initial positions \[rad\].
    pub q: Option<[f64; N]>,
    /// Initial velocities \[rad/s\].
    pub qd: Option<[f64; N]>,
}

impl<const N: usize> Changed<N> {
    pub(super) fn read(fields: &mut Fields<'_>) -> Self {
        let method =
            |fields: &mut Fields<'_>, name| fields.choice(name, &Method::ALL, Method::name);
        let positive = |fields: &mut Fields<'_>, name| fields.number(name, Bound::Positive);
        let not_negative = |fields: &mut Fields<'_>, name| fields.number(name, Bound::NonNegative);
        let per_joint = |fields: &mut Fields<'_>, name| fields.array(name, Bound::Finite);
        // `q0` and `qdot0` are older names.
        let [q, qd] = [["q0", "q"], ["qdot0", "qd"]].map(|names| {
            let [older, newer] = names.map(|name| known(fields, name, per_joint));
            newer.or(older)
        });
        Self {
            method: known(fields, "integrator", method),
            timestep: known(fields, "timestep", positive),
            params: known(fields, "params", |fields, name| {
                fields.object(name, SetParams::from_fields)
            }),
            viscous: known(fields, "viscous", |fields, name| {
                fields.array(name, Bound::NonNegative)
            }),
            gains: known(fields, "gains", |fields, name| {
                fields.object(name, SetGains::from_fields)
            }),
            setpoint: known(fields, "setpoint", per_joint),
            control_period: known(fields, "control_period", not_negative),
            delay: known(fields, "delay", delay),
            limits: known(fields, "limits", |fields, name| {
                fields.object(name, SetLimits::from_fields)
            }),
            sensors: known(fields, "sensors", |fields, name| {
                fields.object(name, SetSensors::from_fields)
            }),
            q,
            qd,
        }
    }

    /// `present` with these changes. Changed gains are those of `present`.
    pub(super) fn applied_to(&self, present: &ControlLoop<N>) -> Result<ControlLoop<N>, ArmError> {
        self.with_gains(present, present.gains, &present.gains)
    }

    /// `present` with these changes. Without gains it has the `missing` ones, and a missing member of gains is that of
    /// `base`.
    pub(super) fn with_gains(
        &self,
        present: &ControlLoop<N>,
        missing: Gains<N>,
        base: &Gains<N>,
    ) -> Result<ControlLoop<N>, ArmError> {
        let ControlLoop { arm, limits, .. } = *present;
        let params = self.params.as_ref();
        let arm = params.map_or(Ok(arm), |params| params.applied_to(&arm))?;
        let sensors = SensorsInForce {
            sensors: present.sensors,
            delay: self.delay.unwrap_or(present.period.delay),
        };
        let changed = self.sensors.as_ref();
        let SensorsInForce { sensors, delay } =
            changed.map_or(sensors, |changed| changed.applied_to(&sensors));
        let changed = self.limits.as_ref();
        let gains = self.gains.as_ref();
        Ok(ControlLoop {
            arm: match self.viscous {
                Some(viscous) => arm.with_friction(viscous)?,
                None => arm,
            },
            gains: gains.map_or(missing, |gains| gains.applied_to(base)),
            setpoint: self.setpoint.map_or(present.setpoint, Setpoint::at),
            method: self.method.unwrap_or(present.method),
            timestep: self.timestep.unwrap_or(present.timestep),
            period: ControlPeriod {
                period: self.control_period.unwrap_or(present.period.period),
                delay,
            },
            limits: changed.map_or(limits, |changed| changed.applied_to(&limits)),
            sensors,
        })
    }

    /// The state. Given positions without velocities are at rest; otherwise the present arm's count.
    pub(super) fn state(&self, present: &State<N>) -> State<N> {
        let missing = self.q.map_or(present.velocity, |_| [0.0; N]);
        State {
            position: self.q.unwrap_or(present.position),
            velocity: self.qd.unwrap_or(missing),
        }
    }
}

/// Reads a field, if the service has it.
fn known<'a, T>(
    fields: &mut Fields<'a>,
    name: &'static str,
    read: impl FnOnce(&mut Fields<'a>, &'static str) -> Option<T>,
) -> Option<T> {
    if fields.has(name) {
        read(fields, name)
    } else {
        None
    }
}

/// The number of control periods after which an effort acts, or `false` for 0 and `true` for 1.
fn delay(fields: &mut Fields<'_>, name: &'static str) -> Option<u8> {
    let raw = fields.raw(name)?;
    let delay = json::boolean(raw).map(u64::from).or(json::integer(raw));
    let delay = delay.and_then(|delay| u8::try_from(delay).ok());
    let delay = delay.filter(|delay| *delay <= MAX_DELAY);
    if delay.is_none() {
        let expected = format_args!("must be an integer from 0 to {MAX_DELAY}, or a boolean");
        fields.refuse(name, &expected);
    }
    delay
}

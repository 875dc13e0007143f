//! The motors and the sensors of a robot as arguments: effort limits with their anti-windup, encoders, and the delay.
//!
//! **Invariant:** a missing argument is that of a new arm, without limits and with exact sensors.

use pendularm::math::limits::{AntiWindup, Limits};
use pendularm::math::sensors::{MAX_DELAY, Sensors, VelocitySource};
use pendularm::math::simulation::ControlPeriod;
use pendularm::study::control_loop::ControlLoop;
use pyo3::PyTypeInfo;
use pyo3::exceptions::PyDeprecationWarning;
use pyo3::prelude::{FromPyObject, PyAnyMethods, PyErr, PyResult};

use crate::arrays::joints_or;
use crate::fields::{self, Bound, Name, Object, Real, Whole};

/// Arguments that `Simulation` and the functions of the study share.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Robot<'py> {
    pub(crate) effort_limit: Option<Object<'py>>,
    pub(crate) anti_windup: Name,
    pub(crate) tracking_time: Real,
    pub(crate) encoder_step: Option<Object<'py>>,
    pub(crate) velocity_source: Name,
    pub(crate) control_period: Real,
    pub(crate) control_delay: Option<Object<'py>>,
}

impl Robot<'_> {
    /// Limits, sensors and control period of a new arm with these arguments.
    pub(crate) fn read<const N: usize>(self) -> PyResult<(Limits<N>, Sensors<N>, ControlPeriod)> {
        let none = [f64::INFINITY; N];
        let limit = joints_or(
            "effort_limit",
            self.effort_limit.as_ref(),
            Bound::Limit,
            none,
        )?;
        let step = self.encoder_step.as_ref();
        let limits = Limits {
            effort: limited(limit),
            anti_windup: anti_windup(self.anti_windup)?,
            tracking_time: tracking_time(self.tracking_time)?,
        };
        let sensors = Sensors {
            encoder_step: joints_or("encoder_step", step, Bound::NotNegative, [0.0; N])?,
            velocity: velocity_source(self.velocity_source)?,
        };
        let period = ControlPeriod {
            period: fields::number("control_period", self.control_period, Bound::NotNegative)?,
            delay: self.control_delay.as_ref().map_or(Ok(0), delay)?,
        };
        Ok((limits, sensors, period))
    }

    /// The loop with these arguments.
    pub(crate) fn of<const N: usize>(self, control: ControlLoop<N>) -> PyResult<ControlLoop<N>> {
        let (limits, sensors, period) = self.read()?;
        Ok(ControlLoop {
            limits,
            sensors,
            period,
            ..control
        })
    }
}

/// The limit of the kernel. Without a finite one there is none.
pub(crate) fn limited<const N: usize>(limit: [f64; N]) -> Option<[f64; N]> {
    limit.iter().any(|one| one.is_finite()).then_some(limit)
}

/// A form of anti-windup by its name.
pub(crate) fn anti_windup(name: Name) -> PyResult<AntiWindup> {
    name.choice("anti_windup", &AntiWindup::ALL, AntiWindup::name)
}

/// The tracking time [s].
pub(crate) fn tracking_time(time: Real) -> PyResult<f64> {
    fields::number("tracking_time", time, Bound::Positive)
}

/// A source of velocities by its name.
pub(crate) fn velocity_source(name: Name) -> PyResult<VelocitySource> {
    let all = &VelocitySource::ALL;
    name.choice("velocity_source", all, VelocitySource::name)
}

/// A number of control periods. True and False, Python's or NumPy's, are older names of 1 and 0.
pub(crate) fn delay(value: &Object<'_>) -> PyResult<u8> {
    if let Ok(flag) = value.extract::<bool>() {
        let warning = PyDeprecationWarning::type_object(value.py());
        let text = c"control_delay is a number of control periods: 1 for True and 0 for False";
        PyErr::warn(value.py(), &warning, text, 1)?;
        return Ok(flag.into());
    }
    let most = usize::from(MAX_DELAY);
    let rule = format!("control_delay must be a whole number from 0 to {most}");
    let Ok(given) = value.extract::<Whole>();
    let delay = given.within(0..=most, rule)?;
    Ok(u8::try_from(delay).unwrap_or(MAX_DELAY))
}

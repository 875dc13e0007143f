//! `/study/*` and `/arm_sim/integration_step`: predictions and offline runs, without effect on the live arm.
//!
//! A missing value is the arm's at the start of the computation. The arm does not change.
//!
//! **Invariant:** a computation is done in pieces, each of a fraction of a millisecond.

mod advice;
mod held_limit;
mod integration;
mod method;
mod rollout;
mod stability;

use std::time::Duration;

pub use self::advice::{PlanRun, PlannedRun, SuggestGains, Suggested};
pub use self::held_limit::FindHeldLimit;
pub use self::integration::{Integrating, IntegrationStep, NotIntegrated};
pub use self::method::{AnalyseMethod, Analysed, Beside};
pub use self::rollout::{Ran, RolloutWork, RunAnswer, RunOffline};
pub use self::stability::{PredictStability, Predicted};
use super::Ask;
use super::arm::{SensorsInForce, SetLimits, SetParams, SetSensors};
use crate::math::arm::State;
use crate::math::arm::{Arm, ArmError};
use crate::math::sensors::MAX_DELAY;
use crate::math::simulation::ControlPeriod;
use crate::protocol::op::fields::{Bound, Fields};
use crate::protocol::wire::json;
use crate::study::control_loop::ControlLoop;
use crate::study::paused::Paused;
use crate::study::stability::most_bytes;

/// Bytes of the longest number with its comma, and of the number itself while the answer is computed.
pub(crate) const NUMBER_BYTES: usize = 25 + 8;

/// The computation of a call, done in pieces.
pub trait Work<T>: Send {
    /// The most bytes of the answer and its computation together. It is called before the computation begins.
    fn most_bytes(&self) -> usize;

    /// Computes one piece, a fraction of a slice. Returns the answer after the last one. `clock` measures the run
    /// time; only differences count.
    fn advance(&mut self, clock: fn() -> Duration) -> Option<T>;
}

/// A question whose answer is computed.
pub trait Computed<const N: usize>: Ask {
    /// The computation.
    type Work: Work<Self::Answer> + 'static;

    /// The computation of this request for the `present` arm.
    #[must_use]
    fn work(self, present: Present<N>) -> Self::Work;
}

/// Why a computation has no result.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Refused<E> {
    /// The arm is not valid.
    #[error("params {0}")]
    Params(#[from] ArmError),
    /// The reason of the study.
    #[error(transparent)]
    Study(E),
}

/// A computation of the study, which needs no clock.
pub struct StudyWork<T> {
    most_bytes: usize,
    computation: Paused<T>,
}

impl<T> StudyWork<T> {
    /// A computation for an arm of `N` links that searches over its poses.
    fn new<const N: usize>(computation: impl Future<Output = T> + Send + 'static) -> Self {
        Self {
            most_bytes: most_bytes::<N>(),
            computation: Paused::new(computation),
        }
    }
}

impl<T> Work<T> for StudyWork<T> {
    fn most_bytes(&self) -> usize {
        self.most_bytes
    }

    fn advance(&mut self, _: fn() -> Duration) -> Option<T> {
        self.computation.advance()
    }
}

/// The arm's settings at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Present<const N: usize> {
    /// The loop with the present gains, even if the controller is off.
    pub control: ControlLoop<N>,
    /// The arm's positions and velocities.
    pub state: State<N>,
}

/// The present control period, with another length \[s\] if it is given.
fn with_period(present: ControlPeriod, period: Option<f64>) -> ControlPeriod {
    ControlPeriod {
        period: period.unwrap_or(present.period),
        ..present
    }
}

/// Friction, limits, sensors and delay of a question, in place of the arm's.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RobotSettings<const N: usize> {
    /// Viscous friction of the joints \[N m s/rad\].
    pub viscous: Option<[f64; N]>,
    /// Changed limits of the motors.
    pub limits: Option<SetLimits<N>>,
    /// Changed sensors.
    pub sensors: Option<SetSensors<N>>,
    /// The delay \[control periods\], unless the sensors have one.
    pub delay: Option<u8>,
}

impl<const N: usize> RobotSettings<N> {
    fn read(fields: &mut Fields<'_>) -> Self {
        Self {
            viscous: fields.array("viscous", Bound::NonNegative),
            limits: fields.object("limits", SetLimits::from_fields),
            sensors: fields.object("sensors", SetSensors::from_fields),
            delay: delay(fields),
        }
    }

    /// `control` with these settings.
    fn applied_to(&self, control: ControlLoop<N>) -> Result<ControlLoop<N>, ArmError> {
        let ControlLoop { arm, limits, .. } = control;
        let present = SensorsInForce {
            sensors: control.sensors,
            delay: self.delay.unwrap_or(control.period.delay),
        };
        let asked = self.sensors.as_ref();
        let SensorsInForce { sensors, delay } =
            asked.map_or(present, |asked| asked.applied_to(&present));
        let asked = self.limits.as_ref();
        Ok(ControlLoop {
            arm: match self.viscous {
                Some(viscous) => arm.with_friction(viscous)?,
                None => arm,
            },
            limits: asked.map_or(limits, |asked| asked.applied_to(&limits)),
            sensors,
            period: ControlPeriod {
                delay,
                ..control.period
            },
            ..control
        })
    }
}

/// The number of control periods after which an effort acts, or `false` for 0 and `true` for 1.
fn delay(fields: &mut Fields<'_>) -> Option<u8> {
    let raw = fields.raw("delay")?;
    let delay = json::boolean(raw).map(u64::from).or(json::integer(raw));
    let delay = delay.and_then(|delay| u8::try_from(delay).ok());
    let delay = delay.filter(|delay| *delay <= MAX_DELAY);
    if delay.is_none() {
        let expected = format_args!("must be an integer from 0 to {MAX_DELAY}, or a boolean");
        fields.refuse("delay", &expected);
    }
    delay
}

/// Joint values under one of two names; the second one is older.
fn joints<const N: usize>(
    fields: &mut Fields<'_>,
    [name, older]: [&'static str; 2],
) -> Option<[f64; N]> {
    let of_older = fields.array(older, Bound::Finite);
    fields.array(name, Bound::Finite).or(of_older)
}

/// The state of a request. Given positions without velocities are at rest; otherwise the present arm's count.
fn state_of<const N: usize>(
    position: Option<[f64; N]>,
    velocity: Option<[f64; N]>,
    present: &State<N>,
) -> State<N> {
    let missing = position.map_or(present.velocity, |_| [0.0; N]);
    State {
        position: position.unwrap_or(present.position),
        velocity: velocity.unwrap_or(missing),
    }
}

/// The present arm, with the given parameters in place of its own.
fn arm_of<const N: usize>(
    params: Option<&SetParams<N>>,
    present: Arm<N>,
) -> Result<Arm<N>, ArmError> {
    params.map_or(Ok(present), |params| params.applied_to(&present))
}

//! `/arm_sim/*`: the arm's parameters, method and timestep, state and time, and disturbances.
//!
//! **Invariant:** values that are not given do not change. Setting the present values does not change the arm, not even the
//! fraction of a step. The arm is replaced as a whole, or not at all.

use bytes::Bytes;
use serde_json::json;

use crate::math::arm::{Arm, ArmError, State};
use crate::math::integrator::Method;
use crate::protocol::catalog::Service;
use crate::protocol::messages::Stamp;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::{Address, Ask, Echo};

/// The reason for a refusal after a divergence.
pub(crate) const DIVERGED: &str =
    "is refused: the simulation has diverged; /arm_sim/reset clears this";

request! {
    /// Sets the arm's parameters.
    pub struct SetParams<N> -> Echo<Arm<N>>, |fields| {
        /// \[m/s²\], at least 0.
        gravity: Option<f64> = fields.number("gravity", Bound::NonNegative),
        /// \[kg\], greater than 0.
        masses: Option<[f64; N]> = fields.array("masses", Bound::Positive),
        /// \[m\], greater than 0.
        lengths: Option<[f64; N]> = fields.array("lengths", Bound::Positive),
    }

    |values| {
        gravity: values.gravity(),
        masses: values.masses().as_slice(),
        lengths: values.lengths().as_slice(),
    }
}

impl<const N: usize> SetParams<N> {
    /// `arm` with these changes.
    ///
    /// # Errors
    /// If such an arm is not valid.
    pub fn applied_to(&self, arm: &Arm<N>) -> Result<Arm<N>, ArmError> {
        Arm::new(
            self.lengths.unwrap_or(*arm.lengths()),
            self.masses.unwrap_or(*arm.masses()),
            self.gravity.unwrap_or(arm.gravity()),
        )?
        .with_friction(*arm.viscous())
    }
}

request! {
    /// Sets the friction of each joint.
    pub struct SetFriction<N> -> Echo<[f64; N]>, |fields| {
        /// \[N m s/rad\], at least 0.
        viscous: Option<[f64; N]> = fields.array("viscous", Bound::NonNegative),
    }

    |values| {
        viscous: values.as_slice(),
    }
}

request! {
    /// Sets method and timestep.
    pub struct SetIntegrator -> Echo<Integrator>, |fields| {
        /// The method that takes the steps.
        method: Option<Method> = fields.choice("method", &Method::ALL, Method::name),
        /// Length of a step \[s\], greater than 0.
        timestep: Option<f64> = fields.number("timestep", Bound::Positive),
    }

    |values| {
        method: values.method.name(),
        timestep: values.timestep,
    }
}

/// The present method and timestep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Integrator {
    /// The method that takes the steps.
    pub method: Method,
    /// Length of a step \[s\].
    pub timestep: f64,
}

request! {
    /// Sets positions and velocities, running or paused, and ends a divergence.
    pub struct SetState<N> -> Echo<State<N>>, |fields| {
        /// Joint positions \[rad\].
        position: Option<[f64; N]> = fields.array("position", Bound::Finite),
        /// Joint velocities \[rad/s\].
        velocity: Option<[f64; N]> = fields.array("velocity", Bound::Finite),
    }

    |state| {
        position: state.position.as_slice(),
        velocity: state.velocity.as_slice(),
    }
}

request! {
    /// Returns the arm to its starting pose at time 0, unless the request was rejected. It has no fields, so it is
    /// rejected as a whole.
    pub struct Reset<N> -> Echo<State<N>>, |fields| {}

    |state| {
        position: state.position.as_slice(),
        velocity: state.velocity.as_slice(),
    }
}

request! {
    /// Freezes or resumes simulation time. The answer is whether it is frozen.
    pub struct Pause -> Echo<bool>, |fields| {
        /// True to freeze it.
        paused: Option<bool> = fields.boolean("data"),
    }

    |data| { data: *data }
}

request! {
    /// Adds an effort to that of every step for some time, from the next one on. Refused if a field was rejected, or if
    /// the simulation has diverged.
    pub struct Disturb<N> -> Result<Push<N>, Rejections>, |fields| {
        /// \[N m\].
        effort: Option<[f64; N]> = fields.array("effort", Bound::Finite),
        /// Simulation time \[s\], greater than 0.
        duration: Option<f64> = fields.number("duration", Bound::Positive),
    }

    fn write(answer: Result<Push<N>, Rejections>, to: &Address) -> Bytes {
        to.outcome(answer.as_ref().map(|push| {
            object! {
                effort: push.effort.as_slice(),
                duration: push.duration,
            }
        }))
    }
}

/// A disturbance that has begun.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Push<const N: usize> {
    /// \[N m\].
    pub effort: [f64; N],
    /// Simulation time \[s\].
    pub duration: f64,
}

/// Asks for the simulation time \[s\].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GetTime;

impl Ask for GetTime {
    type Answer = f64;

    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        Fields::read(arguments, service)?;
        Ok(Self)
    }

    fn write(time: f64, to: &Address) -> Bytes {
        let Stamp { sec, nanosec } = Stamp::from_seconds(time);
        // ROS 1 has other names for the same; some clients know only those.
        let time = json!({"sec": sec, "nanosec": nanosec, "secs": sec, "nsecs": nanosec});
        to.response(&json!({"time": time}), "")
    }
}

//! `/arm_sim/*`: the arm's parameters, method and timestep, state and time, disturbances, and single steps of a paused arm.
//! Also efforts on `/effort_controller/commands`.
//!
//! Steps are taken [`STEPS_IN_A_ROW`] at a time, and requests for more take turns. The effect is that of separate
//! requests, so other requests take effect in between.
//!
//! **Invariant:** values that are not given do not change. Setting the present values does not change the arm, not even the
//! fraction of a step. The arm is replaced as a whole, or not at all.

use bytes::Bytes;
use serde_json::json;

use crate::math::arm::{Arm, ArmError, State};
use crate::math::integrator::Method;
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::{Empty, Stamp};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::protocol::wire::json::Payload;
use crate::services::{Address, Ask, Echo};

/// The reason for a refusal after a divergence.
pub(crate) const DIVERGED: &str =
    "is refused: the simulation has diverged; /arm_sim/reset clears this";

/// Most steps in one request: the budget of one wake-up, and ten seconds at the default timestep.
pub const MAX_STEPS: u64 = 10_000;

/// Steps per turn: about 0.2 ms of work, so neither the tick nor another client's call waits long.
pub const STEPS_IN_A_ROW: u64 = 1000;

/// Names of the joints, base first.
const JOINT_NAMES: [&str; 3] = ["joint1", "joint2", "joint3"];

/// The names of an arm's joints, base first.
#[must_use]
pub fn joint_names<const N: usize>() -> [&'static str; N] {
    std::array::from_fn(|i| JOINT_NAMES.get(i).copied().unwrap_or_default())
}

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

request! {
    /// Takes steps while paused. Refused if a field was rejected, or if the arm cannot be stepped.
    pub struct Step<N> -> Result<Stepped<N>, Rejections>, |fields| {
        /// The number of steps, 1 to [`MAX_STEPS`].
        steps: Option<u64> = fields.count("steps", 1..=MAX_STEPS),
        /// The effort in these steps \[N m\], in place of the controller's; `None` for the controller's.
        effort: Option<[f64; N]> = fields.array("effort", Bound::Finite),
    }

    fn write(answer: Result<Stepped<N>, Rejections>, to: &Address) -> Bytes {
        match answer {
            Ok(stepped) => {
                let status = match stepped.end {
                    StepsEnd::AllTaken => "",
                    StepsEnd::Diverged => "steps ended early: the simulation has diverged",
                    StepsEnd::Resumed => "steps ended early: the arm has been resumed",
                };
                let values = object! {
                    steps: stepped.steps,
                    time: stepped.time,
                    position: stepped.state.position.as_slice(),
                    velocity: stepped.state.velocity.as_slice(),
                    effort: stepped.effort.as_slice(),
                };
                to.response(&values, status)
            }
            Err(rejected) => to.response(&Empty {}, &rejected.status()),
        }
    }
}

/// The taken steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stepped<const N: usize> {
    /// The number of steps.
    pub steps: u64,
    /// Simulation time after them \[s\].
    pub time: f64,
    /// Positions and velocities after them.
    pub state: State<N>,
    /// Effort of the last step \[N m\].
    pub effort: [f64; N],
    /// Why they ended.
    pub end: StepsEnd,
}

/// Why the steps of a request ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepsEnd {
    /// All steps were taken.
    AllTaken,
    /// The simulation has diverged.
    Diverged,
    /// The arm has been resumed.
    Resumed,
}

/// Reads the efforts \[N m\] of a `std_msgs/msg/Float64MultiArray`. Its layout is ignored.
///
/// # Errors
/// If the message does not hold one for each joint.
pub fn read_effort<const N: usize>(msg: &Payload) -> Result<[f64; N], Rejections> {
    let mut fields = Fields::of_message(msg, Topic::EffortCommands)?;
    let effort = fields.array("data", Bound::Finite);
    effort.ok_or_else(|| fields.finish())
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

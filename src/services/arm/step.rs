//! `/arm_sim/step`: single steps of a paused arm.
//!
//! Steps are taken [`STEPS_IN_A_ROW`] at a time, and requests for more take turns. The effect is that of separate
//! requests, so other requests take effect in between.
//!
//! **Invariant:** a refused request changes nothing. An accepted one is completed, unless the arm diverges, is resumed,
//! or the runtime ends.

use bytes::Bytes;

use crate::math::arm::State;
use crate::protocol::messages::Empty;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::Address;

/// Most steps in one request: the budget of one wake-up, and ten seconds at the default timestep.
pub const MAX_STEPS: u64 = 10_000;

/// Steps per turn: about 0.2 ms of work, so neither the tick nor another client's call waits long.
pub const STEPS_IN_A_ROW: u64 = 1000;

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

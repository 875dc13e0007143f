//! `/arm_sim/step`: single steps of a paused arm.
//!
//! Steps are taken [`STEPS_IN_A_ROW`] at a time, and requests for more take turns. It is as if each had asked for
//! single steps, one after the other, so other requests take effect in between.
//!
//! **Invariant:** a request that is refused at first changes nothing. One that is accepted is done as a whole, unless a
//! divergence, a resume or the end of the runtime comes in between.

use bytes::Bytes;
use serde::Serialize;

use crate::math::arm::State;
use crate::protocol::messages::Empty;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::field_by_field::FieldByField;
use crate::services::{Address, Answered, Ask};

/// Steps in one request: the budget of one wake-up, and ten seconds of the default timestep.
pub const MAX_STEPS: u64 = 10_000;

/// Steps in a row: some 0.2 ms of work, so that neither the tick nor anybody's call waits for the steps of others.
pub const STEPS_IN_A_ROW: u64 = 1000;

/// Takes steps while paused. Refused if something was rejected, or the arm can't be stepped.
#[derive(Debug, Clone, PartialEq)]
pub struct Step<const N: usize> {
    /// How many, 1 to [`MAX_STEPS`].
    pub steps: Option<u64>,
    /// The effort that is applied in them \[N m\], while the controller is paused; none for the controller's.
    pub effort: Option<[f64; N]>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

/// Steps that were taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stepped<const N: usize> {
    /// How many.
    pub steps: u64,
    /// Simulation time after them \[s\].
    pub time: f64,
    /// Positions and velocities after them.
    pub state: State<N>,
    /// Effort of the last step \[N m\].
    pub effort: [f64; N],
    /// Why there were no more.
    pub end: StepsEnd,
}

/// The end of the steps of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepsEnd {
    /// There are no more.
    AllTaken,
    /// The simulation has diverged.
    Diverged,
    /// The arm has been resumed.
    Resumed,
}

impl<const N: usize> Ask for Step<N> {
    type Answer = Result<Stepped<N>, Rejections>;
}

impl<const N: usize> FieldByField for Step<N> {
    fn of(fields: &mut Fields<'_>) -> Self {
        Self {
            steps: fields.count("steps", MAX_STEPS),
            effort: fields.array("effort", Bound::Finite),
            rejected: Rejections::default(),
        }
    }

    fn rejected(&mut self) -> &mut Rejections {
        &mut self.rejected
    }
}

impl<const N: usize> Answered for Step<N> {
    fn write(answer: Result<Stepped<N>, Rejections>, to: &Address) -> Bytes {
        #[derive(Serialize)]
        struct Values<'a> {
            steps: u64,
            time: f64,
            position: &'a [f64],
            velocity: &'a [f64],
            effort: &'a [f64],
        }
        match answer {
            Ok(stepped) => {
                let status = match stepped.end {
                    StepsEnd::AllTaken => "",
                    StepsEnd::Diverged => "steps ended early: the simulation has diverged",
                    StepsEnd::Resumed => "steps ended early: the arm has been resumed",
                };
                let values = Values {
                    steps: stepped.steps,
                    time: stepped.time,
                    position: &stepped.state.position,
                    velocity: &stepped.state.velocity,
                    effort: &stepped.effort,
                };
                to.response(&values, status)
            }
            Err(rejected) => to.response(&Empty {}, &rejected.status()),
        }
    }
}

//! Steps that somebody has asked for, and how they ended.
//!
//! **Invariant:** a request keeps its way back until it is answered.

use crate::actors::node::Reply;
use crate::math::arm::State;
use crate::protocol::op::fields::Rejections;

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

/// Steps that somebody has asked for and that are not all taken.
pub(crate) struct Steps<const N: usize> {
    pub(crate) asked: u64,
    pub(crate) taken: u64,
    /// The effort that is applied instead of the controller's \[N m\], if there is one.
    pub(crate) effort: Option<[f64; N]>,
    pub(crate) reply: Reply<Result<Stepped<N>, Rejections>>,
}

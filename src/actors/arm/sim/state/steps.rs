//! Steps that somebody has asked for, and how they ended.
//!
//! **Invariant:** a request keeps its way back until it is answered.

use crate::actors::node::Reply;
use crate::protocol::op::fields::Rejections;

/// Steps that were taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stepped {
    /// How many.
    pub steps: u64,
    /// Simulation time after them \[s\].
    pub time: f64,
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
pub(crate) struct Steps {
    pub(crate) asked: u64,
    pub(crate) taken: u64,
    pub(crate) reply: Reply<Result<Stepped, Rejections>>,
}

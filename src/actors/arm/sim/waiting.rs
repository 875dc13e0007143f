//! Steps that wait for their turn.
//!
//! **Invariant:** a request keeps its way back until it is answered.

use crate::actors::node::Reply;
use crate::live::StepsAsked;
use crate::protocol::op::fields::Rejections;
use crate::services::arm::Stepped;

/// Steps that somebody has asked for and that are not all taken, with the way back.
pub(super) struct Steps<const N: usize> {
    pub(super) asked: StepsAsked<N>,
    pub(super) reply: Reply<Result<Stepped<N>, Rejections>>,
}

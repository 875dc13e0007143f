//! Steps that wait for their turn.
//!
//! **Invariant:** a request keeps its reply until it is answered.

use crate::actors::node::Reply;
use crate::live::StepsAsked;
use crate::protocol::op::fields::Rejections;
use crate::services::arm::Stepped;

/// Requested steps that are not all taken, with the reply.
pub(super) struct Steps<const N: usize> {
    pub(super) asked: StepsAsked<N>,
    pub(super) reply: Reply<Result<Stepped<N>, Rejections>>,
}

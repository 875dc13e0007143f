//! The answer to a request whose fields are taken one by one.
//!
//! **Invariant:** what is echoed are the values as they are after the request.

use crate::protocol::op::fields::Rejections;

/// The answer to a request whose fields are taken one by one.
#[derive(Debug, Clone, PartialEq)]
pub struct Echo<T> {
    /// The values as they are now.
    pub values: T,
    /// Fields of the request that were not taken.
    pub rejected: Rejections,
}

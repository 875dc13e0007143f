//! The services: the typed requests, their readers, and the writers of their answers. Both the runtime and the
//! page without a server use these functions.
//!
//! **Invariant:** these are plain values, without actors, sockets or clocks.

mod address;
pub mod arm;
pub mod field_by_field;
pub mod goals;
pub mod study;
pub mod trial;

use bytes::Bytes;

pub use self::address::Address;
use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::Rejections;

/// Why no node or client serves a call.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NoService {
    /// The runtime has no service of that name, and no client provides it.
    #[error("no provider for service {0}")]
    NoProvider(String),
    /// The service is in the catalog, but no node serves it here.
    #[error("{0} is not served by this runtime")]
    NotServed(String),
}

/// A question that a node answers.
pub trait Ask: Send + 'static {
    /// The answer. It is a `Result` if the request may be refused.
    type Answer: Send + 'static;
}

/// A question that clients can send as a service call.
pub trait Callable: Ask + Sized {
    /// Reads it.
    ///
    /// # Errors
    /// If it is rejected before it reaches the node: all rejected fields, by name.
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections>;
}

/// A question whose answer is written as a response.
pub trait Answered: Callable {
    /// Writes the response.
    fn write(answer: Self::Answer, to: &Address) -> Bytes;
}

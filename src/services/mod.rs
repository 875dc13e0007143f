//! The services: their questions, how a request is read, and how its answer is written. Both the runtime and the
//! page without a server read and write by these functions.
//!
//! **Invariant:** plain values: nothing here knows an actor, a socket or a clock.

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

/// Why a call finds nobody that answers it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NoService {
    /// No service of the runtime's has that name, and no client provides it.
    #[error("no provider for service {0}")]
    NoProvider(String),
    /// The service is listed and has no node here.
    #[error("{0} is not served by this runtime")]
    NotServed(String),
}

/// A question that a node answers.
pub trait Ask: Send + 'static {
    /// The answer. A question that may be refused has a `Result` here.
    type Answer: Send + 'static;
}

/// A question that clients can ask by calling a service.
pub trait Callable: Ask + Sized {
    /// Reads it.
    ///
    /// # Errors
    /// If it does not get as far as the node; all that is wrong with it, by name.
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections>;
}

/// A question whose answer is written as a response.
pub trait Answered: Callable {
    /// Writes the response.
    fn write(answer: Self::Answer, to: &Address) -> Bytes;
}

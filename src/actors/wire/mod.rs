//! Between the registry and the nodes: a client's call is read here and becomes a question, and a node's answer is
//! written here and becomes the call's one response.
//!
//! A question that clients can ask says how it is read and how its answer is written ([`Callable`]); the table of
//! routes ([`Nodes`]) says which node is asked. All that goes wrong on the way is in here, once: bad arguments, a
//! question that was dropped, and how an error is written.
//!
//! **Invariant:** a node sees no JSON. Arguments are read before a node gets the call. Its answer is written
//! afterwards, by the registry or by the thread that has a long answer.

pub mod action_client;
mod caller;
mod routes;

pub use self::caller::{Caller, ServiceCall, TopicMessage};
pub use self::routes::{Nodes, Route};
pub use crate::services::{Address, Answered, Callable};

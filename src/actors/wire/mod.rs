//! Translation between the registry and the nodes: a client's call is read here as a question, and a node's answer
//! is written here as the call's one response.
//!
//! A question that clients can send defines its reader and the writer of its answer ([`Callable`]). The table of
//! routes ([`Nodes`]) defines the node. All errors on the way are handled here: invalid arguments, a dropped
//! question, and the form of an error.
//!
//! **Invariant:** a node sees no JSON. Arguments are read before a node gets the call. Its answer is written
//! afterwards, by the registry or by the thread that has a long answer.

pub mod action_client;
mod caller;
mod routes;

pub use self::caller::{Caller, ServiceCall, TopicMessage};
pub use self::routes::{Nodes, Route};
pub use crate::services::{Address, Answered, Callable};

//! The messages of the nodes: questions with one answer, messages on topics, interest, goals. And the way of a client's
//! call or goal to its node and back.
//!
//! A service is a question, [`Ask`], with its reader and the writer of its answer. A node serves it by a handler for
//! [`Call`] of that question. The asker, a client or another node, is behind the [`Reply`]. The table of routes
//! ([`Nodes`]) has the node of each service. All errors on the way are handled here: invalid arguments, a dropped
//! question, and the form of an error.
//!
//! **Invariant:** every [`Call`] is answered exactly once. A node parses no JSON.

mod callers;
mod completion;
mod goals;
mod questions;
mod registry;
mod routes;

pub use self::callers::{Caller, ServiceCall, TopicMessage, Unserved};
pub use self::completion::{Completion, Working};
pub use self::goals::{ActionClient, ActionRequest, CancelSent, ForwardGoal, SentGoal};
pub use self::questions::{Call, Reply, ShutDown, ask};
pub use self::registry::{
    Barrier, ClientLink, FinishAll, FrameKind, Interest, Publish, RefuseCalls, Respond, SetTap,
    TakeCensus, Tap, Tapped,
};
pub use self::routes::{Attach, Nodes, Route};
pub use crate::services::{Address, Ask};

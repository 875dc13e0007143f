//! The nodes: one actix actor each, joined by typed messages. They ask `math`, and route messages.
//! Operations of clients are read, and answers written, beside them.
//!
//! ```text
//!              accepts                 Request, Disconnect              Call of a question, SetSetpoint, Interest
//!  listener ───────────▶ connection ──────────────────▶ registry ─ wire ────────────────────────────────▶ nodes
//!                            ▲           ToClient           │ ▲            Publish, Respond
//!                            └──────────────────────────────┘ └──────────────────────────────────────── nodes
//! ```
//!
//! There is a connection for each client, and one of everything else. The nodes are `arm_sim` on a thread of its own,
//! `ik`, `ik_action`, `ik_trial`, `follow`, `rosapi`, `parameters`, `rosout`, `tf_web` and `recorder`. The pool of
//! workers does the work of `integration` and `study`.
//!
//! A service is a question, [`node::Ask`]. Its [`node::Call`] comes from a client, read as the question's file says,
//! or from another node; the [`node::Reply`] knows the way back.
//!
//! The documentation of each message gives its meaning and its sender. The drawing in `ARCHITECTURE.md` has all of
//! them.
//!
//! **Invariant:** every message of a node to a client passes through the registry's one mailbox. So a client sees a
//! node's answers and messages in the order in which the node produced them.

pub mod arm;
pub mod compute;
pub mod gateway;
pub mod node;
pub mod panics;
#[cfg(feature = "record")]
pub mod recorder;
pub mod resources;
pub mod ros;
pub mod runtime;
pub mod signals;
pub mod wire;

/// Names one client connection for as long as the process lives; never reused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ConnectionId(pub u64);

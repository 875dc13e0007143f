//! The nodes: one actix actor each, connected by typed messages. They call `math` and route
//! messages. Other modules read clients' operations and write answers.
//!
//! ```text
//!              accepts                 Request, Disconnect              Call of a question, SetSetpoint, Interest
//!  listener ───────────▶ connection ──────────────────▶ registry ───────────────────────────────────────▶ nodes
//!                            ▲           ToClient           │ ▲            Publish, Respond
//!                            └──────────────────────────────┘ └──────────────────────────────────────── nodes
//! ```
//!
//! The listener is a task for each socket. There is a connection for each client, and one of every other actor. The
//! nodes are `arm_sim` on its own thread, `ik_action`, `ik_trial`, `joint_trajectory_controller` (`follow`), `study`,
//! `rosapi`, `rosout`, `tf2_web_republisher` (`tf_web`) and `recorder`. `study` computes on a pool of workers.
//!
//! A service is a question, [`node::Ask`]. Its [`node::Call`] comes from a client, through the question's reader, or
//! from another node. The [`node::Reply`] is the way back.
//!
//! The registry keeps its tables in `graph`, which has no actors.
//!
//! The documentation of each message gives its meaning and its sender. The drawing in `ARCHITECTURE.md` has all of
//! them.
//!
//! **Invariant:** every message of a node to a client passes through the registry's one mailbox. So a client sees a
//! node's answers and messages in the order in which the node produced them.

pub mod arm;
pub mod compute;
pub mod gateway;
pub mod graph;
pub mod node;
pub mod panics;
#[cfg(feature = "record")]
pub mod recorder;
pub mod resources;
pub mod ros;
pub mod runtime;
pub mod start;

/// Identifies one client connection during the life of the process. It is never reused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct ConnectionId(pub u64);

//! The graph, as in ROS: the topics, services and actions of clients, and the calls and goals that wait for them. Also the
//! forms of messages that subscribers requested, and the refusals of ops. The registry keeps the tables.
//!
//! **Invariant:** nothing here sends a message or waits. A table never has more entries than its clients' limits allow.

pub mod forms;
pub mod forwarded;
pub mod providers;
pub(super) mod refusal;
pub mod registrations;
pub mod subscribers;
pub mod topics;

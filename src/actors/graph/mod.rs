//! The graph, as in ROS: who publishes, subscribes and serves what, and the forms of messages that subscribers requested.
//! The registry keeps these tables.
//!
//! **Invariant:** nothing here sends a message or waits. A table never has more entries than its clients' limits allow.

pub mod forms;
pub mod forwarded;
pub mod providers;
pub(super) mod refusal;
pub mod registrations;
pub mod topics;

//! The catalog: every node, topic, service and action of the runtime, with its name, type, direction, owner and fields.
//!
//! The registry, the tables of docs/protocol.md and the tests are checked against it. No other file has names such
//! as `/joint_states`. Fields are in documented order, which is also the order of a positional `args` array.
//!
//! **Invariant:** each entry is one row of one table. A served entry is listed: the compiler checks this, because a
//! table is an enum. A listed entry is served: `tests/actors/refusals/` checks this.

mod actions;
mod entry;
mod node;
mod parts;
pub mod rosapi;
mod services;
mod table;
mod topics;
pub mod types;

pub use actions::Action;
#[cfg(feature = "record")]
pub(crate) use entry::fields;
pub use entry::{Direction, Field};
pub(crate) use entry::{field, message};
pub use node::Node;
pub use rosapi::Rosapi;
pub use services::Service;
pub(in crate::protocol) use table::table;
pub use topics::Topic;

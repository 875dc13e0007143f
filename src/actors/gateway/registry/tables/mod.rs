//! The registry's tables: plain values, which know neither clients' sockets nor the nodes.
//!
//! **Invariant:** a table sends nothing and decides nothing for a client; `ops/` does, with all of them at once.

pub(crate) mod action_servers;
pub(crate) mod census;
pub(crate) mod kept;
mod numbers;
pub(crate) mod pending_cleanup;
pub(crate) mod services;
pub(crate) mod tap;
pub(crate) mod topics;

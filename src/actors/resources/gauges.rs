//! Counters that one node writes and another reads: the gateway's part of `/diagnostics`, and a counter
//! that shows that no unneeded work is done. The pools for long frames and answers are here too.
//!
//! The arm publishes `/diagnostics` from its own thread. A request to the registry once a second would make the arm
//! wait for the gateway, so the arm reads these shared counters.
//!
//! **Invariant:** the counters are statistics. No decision depends on them.

use std::sync::atomic::{AtomicU64, Ordering};

use super::memory::Memory;

/// Numbers about the runtime, shared by reference.
#[derive(Debug, Default)]
pub struct Gauges {
    connections: AtomicU64,
    messages_dropped: AtomicU64,
    error_estimates: AtomicU64,
    memory: Memory,
}

impl Gauges {
    /// Counters at zero, with these pools.
    #[must_use]
    pub fn with(memory: Memory) -> Self {
        Self {
            memory,
            ..Self::default()
        }
    }

    /// The pools for long frames and long answers.
    #[must_use]
    pub fn memory(&self) -> &Memory {
        &self.memory
    }

    /// Clients connected now.
    #[must_use]
    pub fn connections(&self) -> u64 {
        self.connections.load(Ordering::Relaxed)
    }

    /// Topic messages dropped by outboxes since the start.
    #[must_use]
    pub fn messages_dropped(&self) -> u64 {
        self.messages_dropped.load(Ordering::Relaxed)
    }

    /// Estimates of the arm's local error since the start. Without a subscriber there are none.
    #[must_use]
    pub fn error_estimates(&self) -> u64 {
        self.error_estimates.load(Ordering::Relaxed)
    }

    /// Counts one estimate.
    pub fn add_estimate(&self) {
        self.error_estimates.fetch_add(1, Ordering::Relaxed);
    }

    /// Sets the number of clients connected.
    pub fn set_connections(&self, connections: u64) {
        self.connections.store(connections, Ordering::Relaxed);
    }

    /// Adds newly dropped topic messages.
    pub fn add_dropped(&self, messages: u64) {
        self.messages_dropped.fetch_add(messages, Ordering::Relaxed);
    }
}

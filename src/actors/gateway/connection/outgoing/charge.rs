//! The memory that a client is charged for what waits for it, and the count of what was dropped.
//!
//! **Invariant:** after [`Charge::update`] the client's account and its backlog say what waits. Responses are in the
//! account already, each by itself.

use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::unencoded::Unencoded;
use crate::actors::resources::budget::Account;
use crate::actors::resources::gauges::Gauges;
use crate::protocol::outbox::Outbox;

/// The account of one client, and how it stood when it was last brought up to date.
pub(super) struct Charge {
    pub(super) account: Arc<Account>,
    /// Bytes of responses in the outbox, for the registry to look at.
    pub(super) backlog: Arc<AtomicUsize>,
    gauges: Arc<Gauges>,
    counted: Cell<ChargedSizes>,
}

/// The sizes that were counted last.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
struct ChargedSizes {
    /// Topic messages that waited, and their bytes.
    topics: (usize, usize),
    /// Bytes of the topic messages that were being written.
    writing: usize,
    /// Bytes of responses.
    responses: usize,
}

impl Charge {
    pub(super) fn new(gauges: Arc<Gauges>, account: Arc<Account>) -> Self {
        Self {
            account,
            backlog: Arc::default(),
            gauges,
            counted: Cell::default(),
        }
    }

    /// Charges the client for what waits now.
    pub(super) fn update(&self, outbox: &Outbox, unencoded: &Unencoded) {
        let (count, bytes) = unencoded.size();
        let topics = (outbox.topic_count() + count, outbox.topic_bytes() + bytes);
        let now = ChargedSizes {
            topics,
            writing: outbox.writing_cost(),
            responses: outbox.response_cost(),
        };
        // Other threads read these counters. Mostly nothing waits, neither before nor after: then no store is made,
        // which would cost a cache miss.
        if self.counted.replace(now) != now {
            self.backlog.store(now.responses, Ordering::Relaxed);
            self.account.queue(topics.0, topics.1, now.writing);
        }
    }

    /// Charges the client for nothing that waits: a share may outlive the connection, and keep its account.
    pub(super) fn clear(&self) {
        self.account.queue(0, 0, 0);
    }

    /// Counts so many topic messages as dropped.
    pub(super) fn count_dropped(&self, dropped: u64) {
        if dropped > 0 {
            self.gauges.add_dropped(dropped);
        }
    }
}

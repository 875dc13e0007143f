//! The writer's turn, where it has to wait for one, and the publishers that wait for it.
//!
//! **Invariant:** a message's publisher waits until the message has been offered to the socket, which is not before
//! the writer has left its queue.

use std::cell::{Cell, RefCell};

use crate::actors::gateway::messages::Underway;
use crate::actors::gateway::turns::WritersQueue;

/// Whether the writer waits, in which queue it does so, and which publishers wait for it.
#[derive(Default)]
pub(super) struct WritersTurn {
    /// The writer waits in its queue.
    in_queue: Cell<bool>,
    /// Messages whose publishers wait until they have been offered to the socket.
    underway: RefCell<Vec<Underway>>,
    /// Some of what waits has been encoded: such messages come from clients, and go to many at one moment.
    is_encoded: Cell<bool>,
}

impl WritersTurn {
    /// Keeps a message's publisher waiting.
    pub(super) fn hold(&self, underway: Option<Underway>) {
        self.underway.borrow_mut().extend(underway);
    }

    /// Some of what waits has been encoded.
    pub(super) fn note_encoded(&self) {
        self.is_encoded.set(true);
    }

    /// The queue in which the writer waits, where it has to.
    pub(super) fn queue(&self) -> WritersQueue {
        if self.underway.borrow().is_empty() && !self.is_encoded.get() {
            WritersQueue::Unpaced
        } else {
            WritersQueue::Paced
        }
    }

    /// The writer waits from now on; false if it did already.
    pub(super) fn begin(&self) -> bool {
        !self.in_queue.replace(true)
    }

    /// Whether the writer waits.
    pub(super) fn is_waiting(&self) -> bool {
        self.in_queue.get()
    }

    /// It is the writer's turn.
    pub(super) fn end(&self) {
        self.in_queue.set(false);
    }

    /// Nothing is left to be written.
    pub(super) fn note_empty(&self) {
        self.is_encoded.set(false);
    }

    /// The writer has done what it can: publishers go on, unless it waits.
    pub(super) fn let_publishers_go_on(&self) {
        if !self.in_queue.get() {
            self.underway.borrow_mut().clear();
        }
    }
}

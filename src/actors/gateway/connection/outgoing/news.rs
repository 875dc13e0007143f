//! News for the one task that waits for something to do: the writer, or whoever ends the connection.
//!
//! **Invariant:** news that come while nobody waits are not lost: the next who waits goes on at once.

use std::cell::{Cell, RefCell};
use std::future::poll_fn;
use std::task::{Poll, Waker};

/// Whether there are news, and whom they wake.
pub(super) struct News {
    are_there: Cell<bool>,
    listener: RefCell<Waker>,
}

impl News {
    pub(super) fn new() -> Self {
        Self {
            are_there: Cell::new(false),
            listener: RefCell::new(Waker::noop().clone()),
        }
    }

    /// Has the waiting task look again.
    pub(super) fn announce(&self) {
        self.are_there.set(true);
        self.listener.borrow().wake_by_ref();
    }

    /// Waits until `holds` does, or until there are news.
    pub(super) async fn wait(&self, holds: impl Fn() -> bool) {
        poll_fn(|cx| {
            if holds() || self.are_there.take() {
                return Poll::Ready(());
            }
            self.listener.borrow_mut().clone_from(cx.waker());
            Poll::Pending
        })
        .await;
    }
}

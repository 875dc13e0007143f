//! The turns of connections that have more to do than one poll may.
//!
//! A light call passes the connection, the registry, a node, and the same actors back. If each of these messages waited
//! behind all busy connections, a crowd would delay every call. So only a few busy connections at a time are in the run
//! queue. The others wait here, in order.
//!
//! A client with one long message needs some ten turns. It does not wait behind clients that are busy all the time:
//! these have a queue of their own.
//!
//! **Invariant:** every waiting connection is woken once all before it in its queue have had their turns.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::task::{Context, Waker};

use tokio::task::yield_now;

/// Waiting connections of each queue that are woken in one pass of the run queue.
const TURNS_PER_PASS: usize = 8;
/// Turns in a row after which a connection counts as always busy.
const BRIEF: u32 = 16;

/// The waiting connections of a thread.
#[derive(Default)]
struct Waiting {
    /// Connections that were idle some turns ago.
    brief: VecDeque<Waker>,
    /// Connections that are busy all the time.
    constant: VecDeque<Waker>,
}

impl Waiting {
    fn is_empty(&self) -> bool {
        self.brief.is_empty() && self.constant.is_empty()
    }

    /// Takes the connections of the next pass out of both queues.
    fn take_next(&mut self) -> Vec<Waker> {
        let mut next = Vec::with_capacity(2 * TURNS_PER_PASS);
        for queue in [&mut self.brief, &mut self.constant] {
            next.extend(queue.drain(..queue.len().min(TURNS_PER_PASS)));
        }
        next
    }
}

thread_local! {
    static WAITING: RefCell<Waiting> = RefCell::default();
}

/// The turns of one task of a connection.
#[derive(Default)]
pub(super) struct Turns {
    /// Turns since the task last had nothing to do.
    in_a_row: u32,
}

impl Turns {
    /// Ends the turn of the task, which has more to do. The task is woken for its next turn.
    pub(super) fn end(&mut self, cx: &mut Context<'_>) {
        self.in_a_row = self.in_a_row.saturating_add(1);
        let was_empty = WAITING.with_borrow_mut(|waiting| {
            let was_empty = waiting.is_empty();
            let is_brief = self.in_a_row <= BRIEF;
            let queue = if is_brief {
                &mut waiting.brief
            } else {
                &mut waiting.constant
            };
            queue.push_back(cx.waker().clone());
            was_empty
        });
        if was_empty {
            actix_rt::spawn(give_turns());
        }
    }

    /// Notes that the task has nothing to do.
    pub(super) const fn rest(&mut self) {
        self.in_a_row = 0;
    }
}

/// Wakes waiting connections until none is left.
async fn give_turns() {
    /// Empties the queues if the system ends before its connections.
    struct Emptied;
    impl Drop for Emptied {
        fn drop(&mut self) {
            // At the end of the thread the queues may be gone before the system.
            let _ = WAITING.try_with(RefCell::take);
        }
    }
    let _emptied = Emptied;
    loop {
        yield_now().await;
        let (next, is_last) =
            WAITING.with_borrow_mut(|waiting| (waiting.take_next(), waiting.is_empty()));
        next.into_iter().for_each(Waker::wake);
        if is_last {
            return;
        }
    }
}

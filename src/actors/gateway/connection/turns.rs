//! The turns of connections that have more to do than one poll may.
//!
//! A light call passes the connection, the registry, a node, and the same actors back. If each of these messages waited
//! behind all busy connections, a crowd would delay every call. So only a few busy connections at a time are in the run
//! queue. The others wait here, in order.
//!
//! **Invariant:** every waiting connection is woken once all before it have had their turns.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::task::{Context, Waker};

use tokio::task::yield_now;

/// Waiting connections that are woken in one pass of the run queue.
const TURNS_PER_PASS: usize = 32;

thread_local! {
    /// The connections of this thread's run queue that wait for their next turns.
    static WAITING: RefCell<VecDeque<Waker>> = const { RefCell::new(VecDeque::new()) };
}

/// Ends the turn of a task that has more to do. The task is woken for its next turn.
pub(super) fn yield_turn(cx: &mut Context<'_>) {
    let waiting = WAITING.with_borrow_mut(|waiting| {
        waiting.push_back(cx.waker().clone());
        waiting.len()
    });
    if waiting == 1 {
        actix_rt::spawn(give_turns());
    }
}

/// Wakes waiting connections until none is left.
async fn give_turns() {
    /// Empties the queue if the system ends before its connections.
    struct Emptied;
    impl Drop for Emptied {
        fn drop(&mut self) {
            WAITING.take();
        }
    }
    let _emptied = Emptied;
    loop {
        yield_now().await;
        let (next, is_last) = WAITING.with_borrow_mut(|waiting| {
            let count = waiting.len().min(TURNS_PER_PASS);
            let next: Vec<Waker> = waiting.drain(..count).collect();
            (next, waiting.is_empty())
        });
        next.into_iter().for_each(Waker::wake);
        if is_last {
            return;
        }
    }
}

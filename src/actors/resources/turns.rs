//! The end of a task's turn, and a timer for the futures of an actor.

use std::pin::{Pin, pin};
use std::task::{Context, Poll};

use tokio::task::yield_now;
use tokio::time::{Instant, Sleep, sleep_until};

/// Ends the turn of a task that has more to do. It is polled again after every other task that is ready, and after the
/// sockets.
pub fn end_turn<T>(cx: &mut Context<'_>) -> Poll<T> {
    let _ = pin!(yield_now()).poll(cx);
    Poll::Pending
}

/// A timer whose deadline may change.
#[derive(Default)]
pub struct Timer(Option<Pin<Box<Sleep>>>);

impl Timer {
    /// Ready once `due` has passed. Without a deadline it is never ready.
    pub fn poll(&mut self, due: Option<Instant>, cx: &mut Context<'_>) -> Poll<()> {
        let Some(due) = due else {
            return Poll::Pending;
        };
        let timer = self.0.get_or_insert_with(|| Box::pin(sleep_until(due)));
        if timer.deadline() != due {
            timer.as_mut().reset(due);
        }
        timer.as_mut().poll(cx)
    }
}

//! Long computations, each written as one async function and done a piece at a time.
//!
//! A worker, or the page, does a piece of one computation and then of another. A piece ends where the function awaits
//! `pause`. It waits for no event, so no executor is needed: one poll is one piece.
//!
//! **Invariant:** the result of a computation in pieces is bit-identical to that without pauses.

use std::future::poll_fn;
use std::pin::{Pin, pin};
use std::task::{Context, Poll, Waker};

/// A computation in progress, with the result `T`.
pub struct Paused<T>(Option<Pin<Box<dyn Future<Output = T> + Send>>>);

impl<T> Paused<T> {
    /// A computation that has not begun.
    pub fn new(computation: impl Future<Output = T> + Send + 'static) -> Self {
        Self(Some(Box::pin(computation)))
    }

    /// Does the next piece, which takes about 1 ms of one core at most (optimised build). Returns the result after the
    /// last piece, and `None` after that.
    pub fn advance(&mut self) -> Option<T> {
        let answer = poll(self.0.as_mut()?.as_mut());
        if answer.is_some() {
            self.0 = None;
        }
        answer
    }
}

/// Does all pieces of a computation.
pub fn at_once<T>(computation: impl Future<Output = T>) -> T {
    let mut computation = pin!(computation);
    loop {
        if let Some(answer) = poll(computation.as_mut()) {
            return answer;
        }
    }
}

fn poll<T>(computation: Pin<&mut (impl Future<Output = T> + ?Sized)>) -> Option<T> {
    match computation.poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(answer) => Some(answer),
        Poll::Pending => None,
    }
}

/// Ends a piece of the computation that awaits it.
pub(super) async fn pause() {
    let mut has_paused = false;
    poll_fn(|_| {
        if std::mem::replace(&mut has_paused, true) {
            Poll::Ready(())
        } else {
            Poll::Pending
        }
    })
    .await;
}

/// Evaluations of the dynamics per piece: some hundred microseconds. A piece may exceed it by one step.
const WORK_PER_PIECE: u64 = 2000;

/// The evaluations of the dynamics in the present piece. It serves computations that do little else.
#[derive(Debug, Default)]
pub(super) struct PieceWork(u64);

impl PieceWork {
    /// Counts `evaluations`, and ends the piece at [`WORK_PER_PIECE`]. A turn without evaluations counts as one, so that
    /// a loop of such turns is divided too.
    pub(super) async fn spend(&mut self, evaluations: u64) {
        self.0 = self.0.saturating_add(evaluations.max(1));
        if self.0 >= WORK_PER_PIECE {
            self.0 = 0;
            pause().await;
        }
    }
}

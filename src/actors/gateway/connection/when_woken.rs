//! A part of a task that has its own waker.
//!
//! A connection's actor is polled for every message that its client hears. Its course waits for the end of all that,
//! and does not look each time whether it has come.
//!
//! **Invariant:** who is woken is polled, and who is not costs a look at a flag.

use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll, Wake, Waker};

/// A future that is polled when something has woken it, however often the task is that it is a part of.
pub(super) struct WhenWoken<F> {
    part: F,
    waker: Option<Arc<PartWaker>>,
}

/// Wakes the task, and says for which part.
struct PartWaker {
    is_woken: AtomicBool,
    task: Waker,
}

impl Wake for PartWaker {
    fn wake(self: Arc<Self>) {
        self.wake_by_ref();
    }

    fn wake_by_ref(self: &Arc<Self>) {
        self.is_woken.store(true, Ordering::Release);
        self.task.wake_by_ref();
    }
}

impl<F: Future + Unpin> WhenWoken<F> {
    pub(super) const fn new(part: F) -> Self {
        Self { part, waker: None }
    }
}

impl<F: Future + Unpin> Future for WhenWoken<F> {
    type Output = F::Output;

    fn poll(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<F::Output> {
        let current = self.waker.take();
        let waker = current
            .filter(|waker| waker.task.will_wake(cx.waker()))
            .unwrap_or_else(|| {
                Arc::new(PartWaker {
                    is_woken: AtomicBool::new(true),
                    task: cx.waker().clone(),
                })
            });
        let is_woken =
            waker.is_woken.load(Ordering::Relaxed) && waker.is_woken.swap(false, Ordering::Acquire);
        let waker = self.waker.insert(waker);
        if !is_woken {
            return Poll::Pending;
        }
        let waker = Waker::from(Arc::clone(waker));
        Pin::new(&mut self.part).poll(&mut Context::from_waker(&waker))
    }
}

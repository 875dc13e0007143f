//! A part of a task that has its own waker.
//!
//! A connection's actor is polled for every message that its client hears, and the client's session is a part of it.
//! The session mostly waits, so it is polled only when something that it waits for has woken it.
//!
//! **Invariant:** a part that was woken is polled; any other costs a look at a flag.

use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll, Wake, Waker};

/// A future that is polled only when something has woken it, however often its task is polled.
pub(super) struct OwnWaker<F> {
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

impl<F: Future + Unpin> OwnWaker<F> {
    pub(super) const fn new(part: F) -> Self {
        Self { part, waker: None }
    }
}

impl<F: Future + Unpin> Future for OwnWaker<F> {
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

#[cfg(test)]
mod tests {
    use std::cell::{Cell, RefCell};
    use std::future::poll_fn;

    use super::*;

    #[test]
    fn it_is_polled_at_first_and_when_it_was_woken() {
        let (polls, own) = (Cell::new(0), RefCell::new(None));
        let mut part = OwnWaker::new(poll_fn(|cx| {
            polls.set(polls.get() + 1);
            own.replace(Some(cx.waker().clone()));
            if polls.get() < 3 {
                Poll::Pending
            } else {
                Poll::Ready(())
            }
        }));
        // A clone is kept: in an unoptimised program the original may not count as the same as its clones.
        let task = Waker::noop().clone();
        let mut poll = || {
            Pin::new(&mut part)
                .poll(&mut Context::from_waker(&task))
                .is_ready()
        };
        let wake = || own.borrow().iter().for_each(Waker::wake_by_ref);
        assert!(!poll() && !poll() && !poll());
        assert_eq!(polls.get(), 1);
        wake();
        wake();
        assert!(!poll() && !poll());
        assert_eq!(polls.get(), 2);
        wake();
        assert!(poll());
        assert_eq!(polls.get(), 3);
    }

    #[test]
    fn it_is_polled_again_by_another_task() {
        let polls = Cell::new(0);
        let mut part = OwnWaker::new(poll_fn(|_| {
            polls.set(polls.get() + 1);
            Poll::<()>::Pending
        }));
        let task = Waker::from(Arc::new(PartWaker {
            is_woken: AtomicBool::new(false),
            task: Waker::noop().clone(),
        }));
        for waker in [Waker::noop(), &task, &task] {
            let _ = Pin::new(&mut part).poll(&mut Context::from_waker(waker));
        }
        assert_eq!(polls.get(), 2);
    }
}

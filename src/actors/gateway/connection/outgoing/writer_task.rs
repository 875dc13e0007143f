//! The writer as a part of the connection's actor: a future, and the waker with which it is polled.
//!
//! **Invariant:** a panic of the writer ends this client and nothing else.

use std::cell::RefCell;
use std::pin::Pin;
use std::task::{Context, Poll, Waker};

use crate::actors::panics::contain;

/// The writer at its work, until the connection ends.
type WriterFuture = Pin<Box<dyn Future<Output = ()>>>;

/// The writer, while the client is spoken with.
pub(super) struct WriterTask {
    writer: RefCell<Option<WriterFuture>>,
    /// Wakes the actor, which polls the writer.
    actor: RefCell<Waker>,
}

impl WriterTask {
    pub(super) fn new() -> Self {
        Self {
            writer: RefCell::default(),
            actor: RefCell::new(Waker::noop().clone()),
        }
    }

    /// Makes this the writer.
    pub(super) fn begin(&self, writer: impl Future<Output = ()> + 'static) {
        self.writer.replace(Some(Box::pin(writer)));
    }

    /// Takes the writer away.
    pub(super) fn end(&self) {
        self.writer.take();
    }

    /// Polls the writer for the actor, which has just been polled itself.
    pub(super) fn poll(&self, cx: &mut Context<'_>) {
        self.actor.borrow_mut().clone_from(cx.waker());
        self.go_on(cx);
    }

    /// Polls the writer without the actor; the actor is still the one that is woken.
    pub(super) fn poll_in_turn(&self) {
        let actor = self.actor.borrow();
        self.go_on(&mut Context::from_waker(&actor));
    }

    fn go_on(&self, cx: &mut Context<'_>) {
        let mut writer = self.writer.borrow_mut();
        if let Some(writing) = writer.as_mut() {
            let polled = contain(|| writing.as_mut().poll(cx));
            if let Err(panic) = &polled {
                tracing::error!(%panic, "a client's writer failed; its connection ends");
            }
            if !matches!(polled, Ok(Poll::Pending)) {
                *writer = None;
            }
        }
    }
}

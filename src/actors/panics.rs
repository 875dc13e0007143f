//! The end of a panic: it ends one client or computation, or the process.
//!
//! No input is known to cause one. Should one happen all the same: in what serves one client it ends that client, in a
//! computation that computation. Anywhere else, in a node or the registry, others would wait for ever. There the
//! process ends at once, with one line that names the place, so that its supervisor can start it again.
//!
//! **Invariant:** a panic is contained by the caller of [`contain`], or it is the last thing that the process does.

use std::cell::{Cell, RefCell};
use std::fmt::Write as _;
use std::future::Future;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, set_hook};
use std::pin::Pin;
use std::task::{Context, Poll};

/// Longest part of a panic's message that is reported.
const MAX_WORDS: usize = 200;

thread_local! {
    /// How many calls of `contain` are under way on this thread.
    static CONTAINED: Cell<usize> = const { Cell::new(0) };
    /// The last panic on this thread that was contained.
    static LAST: RefCell<String> = const { RefCell::new(String::new()) };
}

/// A panic that was contained; reads as where it happened and its own words.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Contained(String);

/// From now on a panic that nothing contains is passed to `end`, on the thread where it happened; `end` should not
/// return.
pub fn end_with(end: impl Fn(&str) + Send + Sync + 'static) {
    set_hook(Box::new(move |info| {
        let what = describe(info);
        if CONTAINED.get() == 0 {
            end(&what);
        } else {
            LAST.with_borrow_mut(|last| *last = what);
        }
    }));
}

/// Does `work`, and survives its panic. The subject of the panic must not be used afterwards.
///
/// # Errors
/// The panic.
pub fn contain<T>(work: impl FnOnce() -> T) -> Result<T, Contained> {
    CONTAINED.set(CONTAINED.get() + 1);
    let outcome = catch_unwind(AssertUnwindSafe(work));
    CONTAINED.set(CONTAINED.get() - 1);
    outcome.map_err(|_| Contained(LAST.with_borrow_mut(std::mem::take)))
}

/// The same for a task: each of its turns is contained.
#[must_use]
pub fn contained<F: Future>(task: F) -> Contain<F> {
    Contain(Box::pin(task))
}

/// See [`contained`].
pub struct Contain<F>(Pin<Box<F>>);

impl<F: Future> Future for Contain<F> {
    type Output = Result<F::Output, Contained>;

    fn poll(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Self::Output> {
        match contain(|| self.0.as_mut().poll(cx)) {
            Ok(Poll::Pending) => Poll::Pending,
            Ok(Poll::Ready(output)) => Poll::Ready(Ok(output)),
            Err(panic) => Poll::Ready(Err(panic)),
        }
    }
}

/// One line: where, and the panic's own words, escaped and cut.
fn describe(info: &PanicHookInfo<'_>) -> String {
    let mut line = String::from("panicked");
    // Writing to a `String` cannot fail.
    if let Some(place) = info.location() {
        let _ = write!(line, " at {place}");
    }
    let payload = info.payload();
    let text = payload.downcast_ref::<String>().map(String::as_str);
    if let Some(words) = text.or_else(|| payload.downcast_ref::<&str>().copied()) {
        let words: String = words.chars().take(MAX_WORDS).collect();
        let _ = write!(line, ": {words:?}");
    }
    line
}

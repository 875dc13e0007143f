//! Containment of panics: a panic ends one client or computation, or the process.
//!
//! No input is known to cause a panic. A panic while serving one client ends that client, and a panic in a computation
//! ends that computation. Anywhere else, in a node or the registry, clients would wait without end. There the process
//! ends at once, with one line that names the location, so a supervisor can restart it.
//!
//! **Invariant:** a caller of [`contain`] contains a panic, or the process ends.

use std::cell::{Cell, RefCell};
use std::fmt::Write as _;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, set_hook};

/// Longest part of a panic's message that is reported.
const MAX_WORDS: usize = 200;

thread_local! {
    /// The number of active calls of `contain` on this thread.
    static CONTAINED: Cell<usize> = const { Cell::new(0) };
    /// The last contained panic on this thread.
    static LAST: RefCell<String> = const { RefCell::new(String::new()) };
}

/// A contained panic. Its text has the location and the message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Contained(String);

/// From now on a panic that is not contained is passed to `end`, on its thread. `end` should not return.
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

/// Runs `work` and catches its panic. Values that `work` has changed must not be used after a panic.
///
/// # Errors
/// The panic.
pub fn contain<T>(work: impl FnOnce() -> T) -> Result<T, Contained> {
    let outcome = CONTAINED.with(|active| {
        active.set(active.get() + 1);
        let outcome = catch_unwind(AssertUnwindSafe(work));
        active.set(active.get() - 1);
        outcome
    });
    outcome.map_err(|_| Contained(LAST.with_borrow_mut(std::mem::take)))
}

/// One line: the location and the panic's message, escaped and shortened.
fn describe(info: &PanicHookInfo<'_>) -> String {
    let mut line = String::from("panicked");
    // Writing to a `String` cannot fail.
    if let Some(location) = info.location() {
        let _ = write!(line, " at {location}");
    }
    let payload = info.payload();
    let text = payload.downcast_ref::<String>().map(String::as_str);
    if let Some(words) = text.or_else(|| payload.downcast_ref::<&str>().copied()) {
        let words: String = words.chars().take(MAX_WORDS).collect();
        let _ = write!(line, ": {words:?}");
    }
    line
}

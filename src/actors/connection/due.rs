//! Topic messages on their way out: the connections that have some are written to in turn, a few at a time.
//!
//! A message to a thousand subscribers is a thousand writes. Done one task at a time each would cost two more wake-ups; done all in one go every
//! other client would wait behind them. So a connection that hears a message writes it there and then, as long as not much has been
//! written that way. Beyond that it goes on a list: a task takes a handful of connections from it, then lets others have a
//! turn. What a socket does not take at once is left to the connection's own writing task.
//!
//! **Invariant:** nothing is written here that something else queued for that client has to precede.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::io::IoSlice;
use std::rc::Rc;
use std::sync::Arc;

use bytes::Bytes;
use tokio::net::tcp::OwnedWriteHalf;
use tokio::sync::Notify;
use tokio::time::Instant;

use super::Shared;
use super::writer::{BATCH_BYTES, BATCH_FRAMES};
use crate::protocol::outbox::MAX_TOPIC_BYTES;

/// Connections on the list that are written to before others have a turn: a fraction of a millisecond.
const TURN: usize = 32;
/// Writes, the longer ones counting several times, that are done where the message is heard, until the list has been worked through
/// once: about a millisecond's.
const AT_ONCE: usize = 256;
/// Bytes of a message that count as another write.
const LONG: usize = 4096;

/// The connections of this thread that have something to be written.
struct Due {
    connections: RefCell<VecDeque<Rc<Shared>>>,
    /// Of [`AT_ONCE`], what is left.
    at_once: Cell<usize>,
    /// Whether there is a task at work.
    at_work: Cell<bool>,
    /// The list is empty again.
    done: Notify,
}

thread_local! {
    static DUE: Rc<Due> = Rc::new(Due {
        connections: RefCell::default(),
        at_once: Cell::new(AT_ONCE),
        at_work: Cell::new(false),
        done: Notify::new(),
    });
}

impl Shared {
    /// Topic messages for the client: they are written at once or soon, or wait in the outbox.
    pub(super) fn deliver(self: &Rc<Self>, topic: &Arc<str>, frame: Bytes) {
        let mut outbox = self.outbox.borrow_mut();
        let written = if outbox.is_idle() {
            self.write_at_once(&frame)
        } else {
            None
        };
        if written == Some(frame.len()) {
            return;
        }
        let throttled = outbox.is_throttled();
        // The time is looked at for throttling alone.
        let now = if throttled {
            Instant::now()
        } else {
            self.since
        };
        let before = outbox.dropped();
        // What has been begun is no longer to be dropped.
        let room = if written.is_some() {
            MAX_TOPIC_BYTES
        } else {
            self.topic_room(frame.len())
        };
        outbox.limit_topics(room);
        outbox.push(topic, frame, now.into_std());
        if outbox.dropped() > before {
            self.gauges.add_dropped(outbox.dropped() - before);
        }
        if let Some(written) = written {
            self.begin(outbox.taken(written));
        } else if throttled || self.stream.borrow().is_none() {
            self.outgoing.notify_one();
        } else {
            mark(self);
        }
    }

    /// Offers a message to the socket of a client for whom nothing else waits, if it is time for that; gives how much of it was taken.
    fn write_at_once(&self, frame: &Bytes) -> Option<usize> {
        let stream = self.stream.borrow();
        let stream = stream.as_ref()?;
        if !self.may_write() || frame.len() > BATCH_BYTES {
            return None;
        }
        let cost = 1 + frame.len() / LONG;
        let may = DUE.with(|due| {
            let left = due.at_once.get().checked_sub(cost);
            due.at_once.set(left.unwrap_or(0));
            left.is_some()
        });
        if !may {
            return None;
        }
        stream.borrow().try_write(frame).ok()
    }

    /// The writing task is not in the middle of a frame, and the client wants no write for each.
    fn may_write(&self) -> bool {
        !self.writing.get() && !self.unbatched.get()
    }

    /// The writing task goes on: with what is left of a frame that was begun, if there is such.
    fn begin(&self, rest: Option<Bytes>) {
        if rest.is_some() {
            self.writing.set(true);
            self.begun.replace(rest);
        }
        self.outgoing.notify_one();
    }
}

/// Puts a connection on the list, unless it is there already.
fn mark(shared: &Rc<Shared>) {
    if shared.due.replace(true) {
        return;
    }
    DUE.with(|due| {
        due.connections.borrow_mut().push_back(Rc::clone(shared));
        if !due.at_work.replace(true) {
            actix_rt::spawn(Work(Rc::clone(due)).run());
        }
    });
}

/// Waits until those on the list have had their turn: who publishes goes on then, so that no publisher outruns the writes that it causes.
pub(super) async fn done() {
    let due = DUE.with(Rc::clone);
    if !due.connections.borrow().is_empty() {
        due.done.notified().await;
    }
}

/// The task; where it ends before its time, with the runtime that it ran in, the next one may begin.
struct Work(Rc<Due>);

impl Drop for Work {
    fn drop(&mut self) {
        for connection in self.0.connections.take() {
            connection.due.set(false);
        }
        self.0.at_work.set(false);
        self.0.at_once.set(AT_ONCE);
        self.0.done.notify_waiters();
    }
}

impl Work {
    async fn run(self) {
        let due = &self.0;
        loop {
            let mut bytes = 0;
            for _ in 0..TURN {
                let Some(connection) = due.connections.borrow_mut().pop_front() else {
                    return;
                };
                connection.due.set(false);
                bytes += write(&connection);
                if bytes >= BATCH_BYTES {
                    break;
                }
            }
            if due.connections.borrow().is_empty() {
                return;
            }
            tokio::task::yield_now().await;
        }
    }
}

/// Writes what one client's socket takes of what may be written; gives the number of bytes.
fn write(shared: &Shared) -> usize {
    let stream = shared.stream.borrow();
    let mut outbox = shared.outbox.borrow_mut();
    let written = match (stream.as_ref(), outbox.ready()) {
        (Some(stream), Some(frames)) if shared.may_write() => try_write(&stream.borrow(), frames),
        _ => None,
    };
    let rest = written.and_then(|written| outbox.taken(written));
    if rest.is_some() || !outbox.is_empty() {
        shared.begin(rest);
    }
    written.unwrap_or(0)
}

/// Offers frames to a socket; `None` if it takes nothing now, or never again.
fn try_write<'a>(
    stream: &OwnedWriteHalf,
    mut frames: impl Iterator<Item = &'a Bytes>,
) -> Option<usize> {
    let first = frames.next()?;
    let Some(second) = frames.next() else {
        return stream.try_write(first).ok();
    };
    let mut slices = [IoSlice::new(&[]); BATCH_FRAMES];
    let mut count = 0;
    for (slice, frame) in slices
        .iter_mut()
        .zip([first, second].into_iter().chain(frames))
    {
        *slice = IoSlice::new(frame);
        count += 1;
    }
    stream.try_write_vectored(slices.get(..count)?).ok()
}

//! The outgoing side of one client: all that waits to be written to it, and the writer.
//!
//! The connection's handlers put things in and the [writer](super::conversation) takes them out. The writer is polled
//! after each message that the actor has handled, so it sees what they have put in. Another task that changes something
//! calls [`Outgoing::wake_writer`].
//!
//! **Invariant:** nothing that borrows a cell here waits while it does.

mod flow;
mod news;
mod patience;

use std::cell::{Cell, RefCell};
use std::pin::Pin;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::task::Context;

use bytes::Bytes;
use tokio::time::Instant;

use self::flow::{FRESH, FlowControl};
use self::news::News;
use self::patience::Patience;
use crate::actors::gateway::connection::unread::UnreadSource;
use crate::actors::gateway::limits::{STALL_LIMIT, WRITE_BYTES, WRITE_FRAMES};
use crate::actors::gateway::messages::{Deliver, DeliveryGuard, Throttle};
use crate::actors::panics::contained;
use crate::actors::resources::gauges::Gauges;
use crate::protocol::outbox::{MAX_AGE, Outbox};

/// The writer at its work, until the connection ends.
type WriterPart = Pin<Box<dyn Future<Output = ()>>>;

/// The outgoing side of one client; one thread, so plain cells do.
pub(super) struct Outgoing {
    outbox: RefCell<Outbox>,
    /// Whether each write has one frame only. Old clients, which end their frames with no newline, take what one read
    /// returns for one frame.
    singly: Cell<bool>,
    flow: RefCell<FlowControl>,
    gauges: Arc<Gauges>,
    /// Bytes of short responses in the outbox, for the registry to look at.
    backlog: Arc<AtomicUsize>,
    patience: Patience,
    news: News,
    /// Messages whose publishers wait until they have been offered to the socket.
    underway: RefCell<Vec<DeliveryGuard>>,
    writer: RefCell<Option<WriterPart>>,
}

impl Outgoing {
    /// Nothing waits.
    pub(super) fn new(gauges: Arc<Gauges>, unread: UnreadSource) -> Rc<Self> {
        Rc::new(Self {
            outbox: RefCell::new(Outbox::new()),
            singly: Cell::new(false),
            flow: RefCell::new(FlowControl::new(unread, Instant::now())),
            gauges,
            backlog: Arc::default(),
            patience: Patience::new(),
            news: News::new(),
            underway: RefCell::default(),
            writer: RefCell::default(),
        })
    }

    /// Bytes of responses in the outbox, for the registry to look at.
    pub(super) fn backlog(&self) -> Arc<AtomicUsize> {
        Arc::clone(&self.backlog)
    }

    // ---- putting in -------------------------------------------------------------------------------------------------

    /// Adds a topic message, or a series of them.
    pub(super) fn accept(&self, message: Deliver) {
        let Deliver {
            topic,
            frame,
            underway,
        } = message;
        self.underway.borrow_mut().extend(underway);
        let now = Instant::now().into_std();
        self.counting_dropped(|outbox| match &topic {
            Some(topic) => outbox.push(topic, frame, now),
            None => outbox.push_feedback(frame, now),
        });
        if self.outbox.borrow().is_throttled() {
            // A message may be held back, and the writer has to know until when.
            self.wake_writer();
        }
    }

    fn counting_dropped(&self, act: impl FnOnce(&mut Outbox)) {
        let mut outbox = self.outbox.borrow_mut();
        let before = outbox.dropped();
        act(&mut outbox);
        let dropped = outbox.dropped() - before;
        if dropped > 0 {
            self.gauges.add_dropped(dropped);
        }
    }

    /// Adds a response or a status. Discards held-back messages on `superseded` topics: they are older.
    pub(super) fn push_response(&self, frame: Bytes, superseded: &[&'static str]) {
        let mut outbox = self.outbox.borrow_mut();
        if outbox.response_bytes() == 0 {
            self.patience.note_first_response();
        }
        outbox.push_response(frame, superseded);
    }

    /// Sets how a topic is throttled, or forgets the topic.
    pub(super) fn configure(&self, topic: &Arc<str>, throttle: Option<Throttle>) {
        let mut outbox = self.outbox.borrow_mut();
        match throttle {
            Some(Throttle {
                interval,
                held_back,
                queue_length,
            }) => {
                outbox.set_throttle(topic, Some((interval, held_back)));
                outbox.set_queue_length(topic, queue_length);
            }
            None => outbox.forget(topic),
        }
        self.wake_writer();
    }

    /// Whether each frame is written by itself.
    pub(super) fn set_singly(&self, singly: bool) {
        self.singly.set(singly);
    }

    // ---- taking out -------------------------------------------------------------------------------------------------

    /// Moves what is written next into `frames`. Nothing is kept back from a client whose connection is finishing.
    pub(super) fn take(&self, frames: &mut Vec<Bytes>, is_finishing: bool) {
        let outbox = self.outbox.borrow();
        let (has_topics, is_throttled) = (outbox.has_topics(), outbox.is_throttled());
        if outbox.is_empty() && !is_throttled {
            return;
        }
        drop(outbox);
        let now = Instant::now();
        let room = if is_finishing {
            usize::MAX
        } else if has_topics || is_throttled {
            self.flow.borrow_mut().room(now)
        } else {
            0
        };
        let most = if self.singly.get() { 1 } else { WRITE_FRAMES };
        let is_far_behind = !is_finishing && self.flow.borrow().is_far_behind();
        let fresh = if is_far_behind { FRESH } else { MAX_AGE };
        self.counting_dropped(|outbox| {
            outbox.allow(room, fresh);
            outbox.take_frames(now.into_std(), most, WRITE_BYTES, frames);
        });
    }

    /// This many of the taken bytes have been written.
    pub(super) fn written(&self, bytes: usize) {
        self.flow.borrow_mut().note_written(bytes, Instant::now());
        let mut outbox = self.outbox.borrow_mut();
        outbox.written(bytes);
        if outbox.response_bytes() == 0 {
            self.patience.note_last_response();
        }
    }

    /// When a message that is held back may be due, if there is one.
    pub(super) fn next_release(&self) -> Option<Instant> {
        let outbox = self.outbox.borrow();
        let release = outbox.next_release().map(Instant::from_std);
        let waits = outbox.has_topics() && !outbox.has_responses();
        let look = self.flow.borrow().next_look().filter(|_| waits);
        release.into_iter().chain(look).min()
    }

    /// Whether there is something to be written now.
    pub(super) fn has_something(&self) -> bool {
        let outbox = self.outbox.borrow();
        let is_held = || {
            self.flow
                .borrow()
                .next_look()
                .is_some_and(|next| Instant::now() < next)
        };
        outbox.has_responses() || (outbox.has_topics() && !is_held())
    }

    /// Bytes of the responses that have not been written.
    pub(super) fn response_bytes(&self) -> usize {
        self.outbox.borrow().response_bytes()
    }

    /// The client has taken some of what is being written. Over TCP a write is over then.
    #[cfg(feature = "web")]
    pub(super) fn note_taken(&self) {
        self.patience.note_taken();
    }

    /// Whether the client has read nothing for too long though a long message waits.
    pub(super) fn is_stuck(&self) -> bool {
        self.flow.borrow().age() > STALL_LIMIT && self.outbox.borrow().has_long()
    }

    /// When a client that has taken nothing since `last_byte` is given up; none while neither a response nor a long
    /// message waits and it is not finishing.
    pub(super) fn patience(&self, last_byte: Instant, is_finishing: bool) -> Option<Instant> {
        let has_long = self.outbox.borrow().has_long();
        self.patience.end(last_byte, is_finishing, has_long)
    }

    // ---- news -------------------------------------------------------------------------------------------------------

    /// Has the writer look: there is something for it to do.
    pub(super) fn wake_writer(&self) {
        self.news.announce();
    }

    /// Waits until `holds` does, or until the writer is woken for another reason.
    pub(super) async fn news(&self, holds: impl Fn() -> bool) {
        self.news.wait(holds).await;
    }

    // ---- the writer -------------------------------------------------------------------------------------------------

    /// Makes this the writer, until the returned guard is dropped.
    pub(super) fn begin_writing(
        self: &Rc<Self>,
        writer: impl Future<Output = ()> + 'static,
    ) -> HasWriter {
        let writer = Box::pin(async move {
            if let Err(panic) = contained(writer).await {
                tracing::error!(%panic, "a client's writer failed; its connection ends");
            }
        });
        self.writer.replace(Some(writer));
        HasWriter(Rc::clone(self))
    }

    /// The actor has handled its messages: the writer does what it can. Then publishers go on: their messages have been
    /// offered to the socket.
    pub(super) fn write(&self, cx: &mut Context<'_>) {
        let mut writer = self.writer.borrow_mut();
        if let Some(writing) = writer.as_mut()
            && writing.as_mut().poll(cx).is_ready()
        {
            *writer = None;
        }
        drop(writer);
        let waiting = self.outbox.borrow().short_bytes();
        if self.backlog.load(Ordering::Relaxed) != waiting {
            self.backlog.store(waiting, Ordering::Relaxed);
        }
        self.underway.borrow_mut().clear();
    }
}

/// While this is there, the client has a writer.
pub(super) struct HasWriter(Rc<Outgoing>);

impl Drop for HasWriter {
    fn drop(&mut self) {
        self.0.writer.take();
    }
}

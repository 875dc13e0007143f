//! The outgoing side of one client: its outbox, the messages that have to be encoded first, and the news for the
//! writer.
//!
//! The connection's handlers put things in and the [writer](super::writer) takes them out. The writer is polled after
//! each message that the actor has handled, so it looks for itself; whatever changes something from another task says
//! so by [`Outgoing::wake_writer`]. Where it waits in a queue, it is polled in its turn as well, and the actor is not.
//!
//! **Invariant:** nothing that borrows a cell here waits while it does.

use std::cell::{Cell, RefCell};
use std::future::poll_fn;
use std::pin::Pin;
use std::rc::{Rc, Weak};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::task::{Context, Poll, Waker};

use bytes::Bytes;
use tokio::time::Instant;

use super::unencoded::Unencoded;
use crate::actors::gateway::limits::{LINGER, STALL_LIMIT, WRITE_BYTES, WRITE_FRAMES};
use crate::actors::gateway::messages::{Throttle, Underway};
use crate::actors::gateway::turns::{WritersQueue, WritesInTurn};
use crate::actors::panics::contain;
use crate::actors::resources::budget::{Account, MESSAGES_LEFT, free_elsewhere};
use crate::actors::resources::gauges::Gauges;
use crate::protocol::outbox::Outbox;

/// An outbox of no more is freed where it stands: that takes a fraction of a millisecond.
const FEW_BYTES: usize = 256 * 1024;

/// The outgoing side of one client; one thread, so plain cells do.
pub(super) struct Outgoing {
    outbox: RefCell<Outbox>,
    /// Topic messages that have to be encoded first.
    pub(super) unencoded: RefCell<Unencoded>,
    /// Messages whose publishers wait until they have been offered to the socket.
    underway: RefCell<Vec<Underway>>,
    /// Some of what waits has been encoded: that is of clients, and goes to many at one moment.
    is_encoded: Cell<bool>,
    /// The writer, while the client is spoken with.
    writer: RefCell<Option<WriterFuture>>,
    /// Wakes the actor, which polls the writer.
    actor: RefCell<Waker>,
    /// The writer waits in its queue.
    in_queue: Cell<bool>,
    /// The client ends its frames with no newline: an old one, that wants every frame in a write of its own.
    singly: Cell<bool>,
    /// Since when responses have been waiting without a break.
    responses_since: Cell<Option<Instant>>,
    /// When the client last took a byte of a write that goes on.
    taken: Cell<Instant>,
    /// There is something for whoever waits for [`Outgoing::news`], and who that is.
    has_news: Cell<bool>,
    listener: RefCell<Waker>,
    /// When the connection was made.
    since: Instant,
    /// Bytes of responses in the outbox, for the registry to look at.
    pub(super) backlog: Arc<AtomicUsize>,
    gauges: Arc<Gauges>,
    account: Arc<Account>,
    /// Topic messages that waited when the account was last brought up to date, their bytes, those of the ones that
    /// were being written, and those of responses.
    counted: Cell<[usize; 4]>,
}

/// The writer at its work, until the connection ends.
type WriterFuture = Pin<Box<dyn Future<Output = ()>>>;

impl Outgoing {
    /// Nothing waits.
    pub(super) fn new(gauges: Arc<Gauges>, account: Arc<Account>) -> Rc<Self> {
        Rc::new(Self {
            outbox: RefCell::new(Outbox::new()),
            unencoded: RefCell::default(),
            underway: RefCell::default(),
            is_encoded: Cell::new(false),
            writer: RefCell::default(),
            actor: RefCell::new(Waker::noop().clone()),
            in_queue: Cell::new(false),
            singly: Cell::new(false),
            responses_since: Cell::new(None),
            taken: Cell::new(Instant::now()),
            has_news: Cell::new(false),
            listener: RefCell::new(Waker::noop().clone()),
            since: Instant::now(),
            backlog: Arc::default(),
            gauges,
            account,
            counted: Cell::default(),
        })
    }

    // ---- putting in -------------------------------------------------------------------------------------------------

    /// Adds a topic message, or a series of them, that is ready to be sent.
    pub(super) fn push(&self, topic: &Arc<str>, frame: Bytes) {
        let mut outbox = self.outbox.borrow_mut();
        let before = outbox.dropped();
        let now = self.now(&outbox);
        outbox.push(topic, frame, now.into_std());
        let dropped = outbox.dropped() - before;
        if outbox.is_throttled() {
            // It may be held back, and the writer has to know until when.
            self.wake_writer();
        }
        drop(outbox);
        self.count_dropped(dropped);
    }

    /// Adds a response or a status; messages of `superseded` topics that throttling still holds back, or that wait to
    /// be encoded, never come, being older.
    pub(super) fn push_response(&self, frame: Bytes, superseded: &[&'static str]) {
        let mut outbox = self.outbox.borrow_mut();
        if outbox.response_bytes() == 0 {
            self.responses_since.set(Some(Instant::now()));
        }
        outbox.push_response(frame, superseded);
        self.unencoded.borrow_mut().supersede(superseded);
    }

    /// Sets how a topic is throttled, or forgets the topic.
    pub(super) fn configure(&self, topic: &Arc<str>, throttle: Option<Throttle>) {
        let mut outbox = self.outbox.borrow_mut();
        match throttle {
            Some(Throttle {
                interval,
                queue_length,
            }) => outbox.set_throttle(topic, Some((interval, queue_length))),
            None => outbox.forget(topic),
        }
        self.wake_writer();
    }

    /// Keeps a message's publisher waiting until the message has been offered to the socket.
    pub(super) fn hold(&self, underway: Option<Underway>) {
        self.underway.borrow_mut().extend(underway);
    }

    /// The message that has just been put in had been encoded aside.
    pub(super) fn note_encoded(&self) {
        self.is_encoded.set(true);
    }

    /// Whether each frame is written by itself.
    pub(super) fn set_singly(&self, singly: bool) {
        self.singly.set(singly);
    }

    /// So many topic messages had to go.
    pub(super) fn count_dropped(&self, dropped: u64) {
        if dropped > 0 {
            self.gauges.add_dropped(dropped);
        }
    }

    // ---- taking out -------------------------------------------------------------------------------------------------

    /// Moves what is written next into `frames`.
    pub(super) fn take(&self, frames: &mut Vec<Bytes>) {
        let mut outbox = self.outbox.borrow_mut();
        if outbox.is_empty() && !outbox.is_throttled() {
            return;
        }
        let now = self.now(&outbox).into_std();
        // Clients that end no line take what one read gives them for one frame.
        let most = if self.singly.get() { 1 } else { WRITE_FRAMES };
        outbox.take_frames(now, most, WRITE_BYTES, frames);
    }

    /// So many bytes of what was taken have been written.
    pub(super) fn written(&self, bytes: usize) {
        let mut outbox = self.outbox.borrow_mut();
        outbox.written(bytes);
        if outbox.response_bytes() == 0 {
            self.responses_since.set(None);
        }
    }

    /// When a message that is held back is due, if there is one.
    pub(super) fn next_release(&self) -> Option<Instant> {
        let release = self.outbox.borrow_mut().next_release();
        release.map(Instant::from_std)
    }

    /// How many bytes of topic messages are written next; `None` where a response waits, or nothing.
    pub(super) fn topics_alone(&self) -> Option<usize> {
        let outbox = self.outbox.borrow();
        let alone = !outbox.is_empty() && !outbox.has_responses();
        alone.then(|| outbox.topic_bytes().min(WRITE_BYTES))
    }

    /// Whether there is nothing to be written now.
    pub(super) fn is_empty(&self) -> bool {
        self.outbox.borrow().is_empty()
    }

    /// Whether a response waits.
    pub(super) fn has_responses(&self) -> bool {
        self.outbox.borrow().has_responses()
    }

    /// Bytes of the responses that have not been written, their places included.
    pub(super) fn response_cost(&self) -> usize {
        self.outbox.borrow().response_cost()
    }

    /// Bytes of topic messages that wait.
    pub(super) fn topic_bytes(&self) -> usize {
        self.outbox.borrow().topic_bytes()
    }

    /// The client has taken some of what is being written. Over TCP a write is over then.
    #[cfg(feature = "web")]
    pub(super) fn note_taken(&self) {
        self.taken.set(Instant::now());
    }

    /// Until when a client that has taken nothing since `last_byte` is borne with: while responses wait, or while it
    /// is finishing.
    pub(super) fn patience(&self, last_byte: Instant, is_finishing: bool) -> Option<Instant> {
        let last_byte = last_byte.max(self.taken.get());
        match self.responses_since.get() {
            Some(since) => Some(since.max(last_byte) + STALL_LIMIT),
            None => is_finishing.then(|| last_byte + LINGER),
        }
    }

    // ---- news -------------------------------------------------------------------------------------------------------

    /// Has the writer look: there is something for it to do.
    pub(super) fn wake_writer(&self) {
        self.has_news.set(true);
        self.listener.borrow().wake_by_ref();
    }

    /// Waits until `holds` does, or until the writer is woken for another reason.
    pub(super) async fn news(&self, holds: impl Fn() -> bool) {
        poll_fn(|cx| {
            if holds() || self.has_news.take() {
                return Poll::Ready(());
            }
            remember(&self.listener, cx);
            Poll::Pending
        })
        .await;
    }

    // ---- the writer -------------------------------------------------------------------------------------------------

    /// From now on this is the writer, until what is given is dropped.
    pub(super) fn begin_writing(
        self: &Rc<Self>,
        writer: impl Future<Output = ()> + 'static,
    ) -> HasWriter {
        self.writer.replace(Some(Box::pin(writer)));
        HasWriter(Rc::clone(self))
    }

    /// The actor has handled its messages: the writer does what it can.
    pub(super) fn write(&self, cx: &mut Context<'_>) {
        remember(&self.actor, cx);
        self.go_on(cx);
    }

    /// The queue in which the writer waits, where it has to.
    pub(super) fn queue(&self) -> WritersQueue {
        if self.underway.borrow().is_empty() && !self.is_encoded.get() {
            WritersQueue::Unpaced
        } else {
            WritersQueue::Paced
        }
    }

    /// Waits in its queue, with so many bytes to be written, while no response waits. Publishers wait as well.
    pub(super) async fn wait_for_turn(self: &Rc<Self>, bytes: usize) {
        if !self.in_queue.replace(true) {
            let this: Weak<Self> = Rc::downgrade(self);
            self.queue().join(bytes, this);
        }
        // It is polled in its turn, and behind the handler of a response.
        let may_go_on = || !self.in_queue.get() || self.has_responses();
        while !may_go_on() {
            self.news(may_go_on).await;
        }
    }

    /// Polls the writer, counts what is left, and lets publishers go on. Its panic ends this client and nothing else.
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
        drop(writer);
        if self.is_empty() {
            self.is_encoded.set(false);
        }
        self.recount();
        if !self.in_queue.get() {
            self.underway.borrow_mut().clear();
        }
    }

    // ---- memory -----------------------------------------------------------------------------------------------------

    /// Tells what waits now. Responses are in the account already, each by itself.
    fn recount(&self) {
        let outbox = self.outbox.borrow();
        let (count, bytes) = self.unencoded.borrow().size();
        let (count, bytes) = (outbox.topic_count() + count, outbox.topic_bytes() + bytes);
        let (writing, responses) = (outbox.writing_cost(), outbox.response_cost());
        let now = [count, bytes, writing, responses];
        // Others look at these, in memory that is not at hand: mostly nothing waits, before and after.
        if self.counted.replace(now) != now {
            self.backlog.store(responses, Ordering::Relaxed);
            self.account.queue(count, bytes, writing);
        }
    }

    /// Gives up what is asked for when all clients together hold too much: topic messages as often as need be, and
    /// ends once it is the connection; gives how many bytes it held.
    pub(super) async fn gives_way(&self) -> usize {
        while !self.account.asked().await {
            let mut outbox = self.outbox.borrow_mut();
            let before = outbox.dropped();
            outbox.keep_topics(MESSAGES_LEFT);
            let unencoded = self.unencoded.borrow_mut().keep(0);
            let dropped = outbox.dropped() - before + unencoded;
            drop(outbox);
            self.count_dropped(dropped);
            self.recount();
            self.account.gave_messages();
        }
        self.account.held()
    }

    /// Forgets what waits for the client.
    pub(super) fn empty(&self) {
        self.unencoded.borrow_mut().keep(0);
        self.recount();
        let freed = self.account.freeing();
        let waiting = self.outbox.borrow_mut().take_waiting();
        self.recount();
        free_elsewhere((waiting, freed));
    }

    /// The time, which is looked at for throttling alone.
    fn now(&self, outbox: &Outbox) -> Instant {
        if outbox.is_throttled() {
            Instant::now()
        } else {
            self.since
        }
    }
}

impl Drop for Outgoing {
    fn drop(&mut self) {
        let outbox = std::mem::take(self.outbox.get_mut());
        let is_long = outbox.response_cost() + outbox.topic_bytes() > FEW_BYTES;
        let freed = is_long.then(|| self.account.freeing());
        // A share may outlive the connection, and keep its account: nothing waits for it any more.
        self.account.queue(0, 0, 0);
        if is_long {
            free_elsewhere((outbox, freed));
        }
    }
}

impl WritesInTurn for Outgoing {
    fn write_in_turn(&self) {
        self.in_queue.set(false);
        let actor = self.actor.borrow();
        self.go_on(&mut Context::from_waker(&actor));
    }
}

/// While this is there, the client has a writer.
pub(super) struct HasWriter(Rc<Outgoing>);

impl Drop for HasWriter {
    fn drop(&mut self) {
        self.0.writer.take();
    }
}

/// Keeps whom to wake.
fn remember(whom: &RefCell<Waker>, cx: &Context<'_>) {
    whom.borrow_mut().clone_from(cx.waker());
}

//! The outgoing side of one client: all that waits to be written to it, and the writer.
//!
//! The connection's handlers put things in and the [writer](super::conversation) takes them out. The writer is polled
//! after each message that the actor has handled, so it sees what they have put in. Another task that changes something
//! calls [`Outgoing::wake_writer`]. A writer that waits in a queue is polled in its turn too, without its actor.
//!
//! Topic messages come in by [`Outgoing::accept`], which is in `encoding.rs` with the task that encodes them.
//!
//! **Invariant:** nothing that borrows a cell here waits while it does.

mod charge;
mod encoding;
mod news;
mod patience;
mod turn;
mod unencoded;
mod writer_task;

use std::cell::{Cell, RefCell};
use std::rc::{Rc, Weak};
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::task::Context;

use bytes::Bytes;
use tokio::time::Instant;

use self::charge::Charge;
use self::news::News;
use self::patience::Patience;
use self::turn::WritersTurn;
use self::unencoded::Unencoded;
use self::writer_task::WriterTask;
use crate::actors::gateway::limits::{WRITE_BYTES, WRITE_FRAMES};
use crate::actors::gateway::messages::{Throttle, Underway};
use crate::actors::gateway::turns::{WritersQueue, WritesInTurn};
use crate::actors::resources::budget::{Account, MESSAGES_LEFT, free_elsewhere};
use crate::actors::resources::gauges::Gauges;
use crate::protocol::outbox::Outbox;

/// A smaller outbox is freed at once, which takes a fraction of a millisecond.
const FEW_BYTES: usize = 256 * 1024;

/// The outgoing side of one client; one thread, so plain cells do.
pub(super) struct Outgoing {
    outbox: RefCell<Outbox>,
    /// Topic messages that have to be encoded first.
    unencoded: RefCell<Unencoded>,
    /// Whether each write has one frame only. Old clients, which end their frames with no newline, take what one read
    /// returns for one frame.
    singly: Cell<bool>,
    /// When the connection was made.
    since: Instant,
    charge: Charge,
    patience: Patience,
    news: News,
    turn: WritersTurn,
    writer: WriterTask,
}

impl Outgoing {
    /// Nothing waits.
    pub(super) fn new(gauges: Arc<Gauges>, account: Arc<Account>) -> Rc<Self> {
        Rc::new(Self {
            outbox: RefCell::new(Outbox::new()),
            unencoded: RefCell::default(),
            singly: Cell::new(false),
            since: Instant::now(),
            charge: Charge::new(gauges, account),
            patience: Patience::new(),
            news: News::new(),
            turn: WritersTurn::default(),
            writer: WriterTask::new(),
        })
    }

    /// Bytes of responses in the outbox, for the registry to look at.
    pub(super) fn backlog(&self) -> Arc<AtomicUsize> {
        Arc::clone(&self.charge.backlog)
    }

    // ---- putting in -------------------------------------------------------------------------------------------------

    /// Adds a topic message, or a series of them, that is ready to be sent.
    pub(super) fn push(&self, topic: &Arc<str>, frame: Bytes) {
        self.counting_dropped(|outbox| outbox.push(topic, frame, self.now(outbox).into_std()));
        if self.outbox.borrow().is_throttled() {
            // A message may be held back, and the writer has to know until when.
            self.wake_writer();
        }
    }

    /// Adds feedback of a goal.
    pub(super) fn push_feedback(&self, frame: Bytes) {
        self.counting_dropped(|outbox| outbox.push_feedback(frame));
    }

    fn counting_dropped(&self, push: impl FnOnce(&mut Outbox)) {
        let mut outbox = self.outbox.borrow_mut();
        let before = outbox.dropped();
        push(&mut outbox);
        self.charge.count_dropped(outbox.dropped() - before);
        self.free_given_up(&mut outbox);
    }

    /// Frees messages that the outbox has given up: elsewhere, where they are many.
    fn free_given_up(&self, outbox: &mut Outbox) {
        if let Some(many) = outbox.take_given_up() {
            free_elsewhere((many, self.charge.account.freeing()));
        }
    }

    /// Adds a response or a status. Discards held-back and unencoded messages on `superseded` topics: they are older.
    pub(super) fn push_response(&self, frame: Bytes, superseded: &[&'static str]) {
        let mut outbox = self.outbox.borrow_mut();
        if outbox.response_bytes() == 0 {
            self.patience.note_first_response();
        }
        outbox.push_response(frame, superseded);
        self.free_given_up(&mut outbox);
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
        self.free_given_up(&mut outbox);
        self.wake_writer();
    }

    /// Keeps a message's publisher waiting until the message has been offered to the socket.
    pub(super) fn hold(&self, underway: Option<Underway>) {
        self.turn.hold(underway);
    }

    /// Whether each frame is written by itself.
    pub(super) fn set_singly(&self, singly: bool) {
        self.singly.set(singly);
    }

    // ---- taking out -------------------------------------------------------------------------------------------------

    /// Moves what is written next into `frames`.
    pub(super) fn take(&self, frames: &mut Vec<Bytes>) {
        let mut outbox = self.outbox.borrow_mut();
        if outbox.is_empty() && !outbox.is_throttled() {
            return;
        }
        let now = self.now(&outbox).into_std();
        let most = if self.singly.get() { 1 } else { WRITE_FRAMES };
        outbox.take_frames(now, most, WRITE_BYTES, frames);
    }

    /// So many bytes of what was taken have been written.
    pub(super) fn written(&self, bytes: usize) {
        let mut outbox = self.outbox.borrow_mut();
        outbox.written(bytes);
        if outbox.response_bytes() == 0 {
            self.patience.note_last_response();
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
        alone.then(|| outbox.queued_bytes().min(WRITE_BYTES))
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

    /// Bytes of topic messages that may be written now.
    pub(super) fn queued_bytes(&self) -> usize {
        self.outbox.borrow().queued_bytes()
    }

    /// The client has taken some of what is being written. Over TCP a write is over then.
    #[cfg(feature = "web")]
    pub(super) fn note_taken(&self) {
        self.patience.note_taken();
    }

    /// When a client that has taken nothing since `last_byte` is given up; none while no response waits and it is not
    /// finishing.
    pub(super) fn patience(&self, last_byte: Instant, is_finishing: bool) -> Option<Instant> {
        self.patience.end(last_byte, is_finishing)
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
        self.writer.begin(writer);
        HasWriter(Rc::clone(self))
    }

    /// The actor has handled its messages: the writer does what it can.
    pub(super) fn write(&self, cx: &mut Context<'_>) {
        self.writer.poll(cx);
        self.note_written();
    }

    /// The queue in which the writer waits, where it has to.
    pub(super) fn queue(&self) -> WritersQueue {
        self.turn.queue()
    }

    /// Waits in its queue, with so many bytes to be written, while no response waits. Publishers wait as well.
    pub(super) async fn wait_for_turn(self: &Rc<Self>, bytes: usize) {
        if self.turn.begin() {
            let this: Weak<Self> = Rc::downgrade(self);
            self.queue().join(bytes, this);
        }
        // The writer is polled in its turn, and behind the handler of a response.
        let may_go_on = || !self.turn.is_waiting() || self.has_responses();
        while !may_go_on() {
            self.news(may_go_on).await;
        }
    }

    /// The writer has done what it can: counts what is left, and lets publishers go on.
    fn note_written(&self) {
        if self.is_empty() {
            self.turn.note_empty();
        }
        self.update_charge();
        self.turn.let_publishers_go_on();
    }

    // ---- memory -----------------------------------------------------------------------------------------------------

    /// Charges the client for what waits now.
    fn update_charge(&self) {
        let (outbox, unencoded) = (self.outbox.borrow(), self.unencoded.borrow());
        self.charge.update(&outbox, &unencoded);
    }

    /// Gives up what is asked for when all clients together hold too much. It gives up topic messages as often as it is
    /// asked to, and ends once the connection itself is asked for. Returns how many bytes the client held.
    pub(super) async fn gives_way(&self) -> usize {
        while !self.charge.account.asked().await {
            let mut outbox = self.outbox.borrow_mut();
            let before = outbox.dropped();
            outbox.keep_topics(MESSAGES_LEFT);
            let unencoded = self.unencoded.borrow_mut().keep(0);
            let dropped = outbox.dropped() - before + unencoded;
            self.free_given_up(&mut outbox);
            drop(outbox);
            self.charge.count_dropped(dropped);
            self.update_charge();
            self.charge.account.gave_messages();
        }
        self.charge.account.held()
    }

    /// Forgets what waits for the client.
    pub(super) fn empty(&self) {
        self.unencoded.borrow_mut().keep(0);
        self.update_charge();
        let freed = self.charge.account.freeing();
        let waiting = self.outbox.borrow_mut().take_waiting();
        self.update_charge();
        free_elsewhere((waiting, freed));
    }

    /// The time; only throttling needs it.
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
        let freed = is_long.then(|| self.charge.account.freeing());
        self.charge.clear();
        if is_long {
            free_elsewhere((outbox, freed));
        }
    }
}

impl WritesInTurn for Outgoing {
    fn write_in_turn(&self) {
        self.turn.end();
        self.writer.poll_in_turn();
        self.note_written();
    }
}

/// While this is there, the client has a writer.
pub(super) struct HasWriter(Rc<Outgoing>);

impl Drop for HasWriter {
    fn drop(&mut self) {
        self.0.writer.end();
    }
}

//! What the parts of one connection share: the outbox, the queue of computations, and when there is room for what.
//!
//! **Invariant:** nothing that borrows a cell here waits while it does.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use actix::prelude::*;
use bytes::Bytes;
use tokio::net::tcp::OwnedWriteHalf;
use tokio::sync::Notify;
use tokio::time::{Instant, timeout};

use super::{
    LOOK_AGAIN, MAX_COMPUTATIONS_WAITING, MAX_RESPONSES_WAITING, MAX_TOPIC_BYTES_SCARCE,
    SMALL_FRAME,
};
use crate::actors::ConnectionId;
use crate::actors::budget::{Claim, Share};
use crate::actors::gauges::Gauges;
use crate::actors::node::SMALL_ANSWER;
use crate::actors::registry::{Registry, Request};
use crate::protocol::outbox::{MAX_TOPIC_BYTES, Outbox};

/// What the actor and its two tasks share; one thread, so plain cells do.
pub(super) struct Shared {
    pub(super) id: Cell<Option<ConnectionId>>,
    pub(super) outbox: RefCell<Outbox>,
    /// Since when responses have been waiting without a break.
    pub(super) responses_since: Cell<Option<Instant>>,
    pub(super) computations: RefCell<Computations>,
    /// Something may be written, or the connection is finishing.
    pub(super) outgoing: Notify,
    /// Something was written or computed: the reader may go on.
    pub(super) room: Notify,
    /// What is owed is still sent; nothing more is read.
    pub(super) finishing: Cell<bool>,
    /// The client speaks something else, or is one too many: it is told so, and its input swallowed.
    pub(super) refusing: Cell<bool>,
    /// The client ends its frames with no newline: an old one, that wants every frame in a write of its own.
    pub(super) unbatched: Cell<bool>,
    /// Whether frames may be binary: over raw TCP they are text.
    pub(super) binary: Cell<bool>,
    /// The sending half of a plain TCP stream, for those who write without waiting.
    pub(super) stream: RefCell<Option<Rc<RefCell<OwnedWriteHalf>>>>,
    /// The writing task is in the middle of a write, or has to go on with what was [`begun`](Self::begun).
    pub(super) writing: Cell<bool>,
    /// What is left of a frame of which the socket has taken the beginning.
    pub(super) begun: Cell<Option<Bytes>>,
    /// Whether the connection is on the list of those to be written to.
    pub(super) due: Cell<bool>,
    /// When the connection was made.
    pub(super) since: Instant,
    /// Bytes of responses in the outbox, for the registry to look at.
    pub(super) backlog: Arc<AtomicUsize>,
    pub(super) gauges: Arc<Gauges>,
}

/// The heavy calls of one connection: one runs, some wait.
#[derive(Default)]
pub(super) struct Computations {
    pub(super) waiting: VecDeque<(Request, Share)>,
    /// Room for a small answer or a failure, and for the request itself, while one runs.
    pub(super) running: Option<Share>,
}

impl Shared {
    /// Nothing waits, nothing is begun.
    pub(super) fn new(gauges: Arc<Gauges>) -> Self {
        Self {
            id: Cell::new(None),
            outbox: RefCell::new(Outbox::new()),
            responses_since: Cell::new(None),
            computations: RefCell::default(),
            outgoing: Notify::new(),
            room: Notify::new(),
            finishing: Cell::new(false),
            refusing: Cell::new(false),
            unbatched: Cell::new(false),
            binary: Cell::new(false),
            stream: RefCell::default(),
            writing: Cell::new(false),
            begun: Cell::default(),
            due: Cell::new(false),
            since: Instant::now(),
            backlog: Arc::default(),
            gauges,
        }
    }

    /// Puts a response or a status into the outbox.
    pub(super) fn send(&self, frame: Bytes) {
        self.send_superseding(frame, &[]);
    }

    /// The same; messages of `topics` that throttling still holds back are discarded, being older than the response.
    pub(super) fn send_superseding(&self, frame: Bytes, topics: &[&str]) {
        let mut outbox = self.outbox.borrow_mut();
        if outbox.response_bytes() == 0 {
            self.responses_since.set(Some(Instant::now()));
        }
        outbox.push_response(frame, topics);
        self.backlog
            .store(outbox.response_bytes(), Ordering::Relaxed);
        self.outgoing.notify_one();
    }

    /// The client may be read: neither its responses nor its computations pile up.
    pub(super) fn may_read(&self) -> bool {
        self.may_compute() && self.computations.borrow().waiting.len() < MAX_COMPUTATIONS_WAITING
    }

    /// Another computation may start: its answer would not come on top of too many.
    pub(super) fn may_compute(&self) -> bool {
        self.outbox.borrow().response_bytes() <= MAX_RESPONSES_WAITING
    }

    /// So many bytes are on their way to the client: there may be room again.
    pub(super) fn written(&self, bytes: usize, registry: &Addr<Registry>) {
        let mut outbox = self.outbox.borrow_mut();
        outbox.written(bytes);
        self.backlog
            .store(outbox.response_bytes(), Ordering::Relaxed);
        if outbox.response_bytes() == 0 {
            self.responses_since.set(None);
        }
        drop(outbox);
        self.room.notify_one();
        self.start_computation(registry);
    }

    /// Bytes of topic messages that may wait for this client, now that one of `length` bytes comes. Where all clients together have
    /// much waiting, this one may keep the newest message; where they have nearly all, only a little.
    pub(super) fn topic_room(&self, length: usize) -> usize {
        let messages = &self.gauges.totals().messages;
        if messages.has_room(Claim::Heavy) {
            MAX_TOPIC_BYTES
        } else if messages.has_room(Claim::Last) {
            length.max(MAX_TOPIC_BYTES_SCARCE)
        } else {
            MAX_TOPIC_BYTES_SCARCE
        }
    }

    /// Waits for room for the answer to a frame of so many bytes, and for what is kept of the frame until then. A small frame of a
    /// client without backlog finds some as long as every client keeps to that.
    pub(super) async fn room_for(&self, length: usize) -> Share {
        let responses = &self.gauges.totals().responses;
        let bytes = SMALL_ANSWER + length + length / 2;
        loop {
            let is_modest = length <= SMALL_FRAME && self.outbox.borrow().response_bytes() == 0;
            let claim = if is_modest {
                Claim::Last
            } else {
                Claim::Ordinary
            };
            if let Some(share) = responses.take(bytes, claim) {
                return share;
            }
            if self.finishing.get() {
                return responses.note(0);
            }
            let _ = timeout(LOOK_AGAIN, self.room.notified()).await;
        }
    }

    /// Queues a heavy call behind the connection's others.
    pub(super) fn enqueue_computation(
        &self,
        request: Request,
        room: Share,
        registry: &Addr<Registry>,
    ) {
        let mut computations = self.computations.borrow_mut();
        computations.waiting.push_back((request, room));
        drop(computations);
        self.start_computation(registry);
    }

    /// Starts the next computation if none runs and its answer would find room.
    pub(super) fn start_computation(&self, registry: &Addr<Registry>) {
        let mut computations = self.computations.borrow_mut();
        if computations.running.is_some() || !self.may_compute() {
            return;
        }
        if let Some((request, room)) = computations.waiting.pop_front() {
            computations.running = Some(room);
            registry.do_send(request);
        }
    }

    /// True while a computation runs or waits.
    pub(super) fn is_computing(&self) -> bool {
        let computations = self.computations.borrow();
        computations.running.is_some() || !computations.waiting.is_empty()
    }

    /// Nobody waits for the computations any more.
    pub(super) fn abandon_computations(&self) {
        *self.computations.borrow_mut() = Computations::default();
    }

    /// Waits until nothing more is read.
    pub(super) async fn finished(&self) {
        while !self.finishing.get() {
            self.outgoing.notified().await;
        }
    }

    /// Nothing more is read; what is owed is sent.
    pub(super) fn finish(&self) {
        self.finishing.set(true);
        self.outgoing.notify_one();
        self.room.notify_one();
    }
}

//! The shared state of one connection: the client, its outbox, its computations, and how the connection
//! ends.
//!
//! **Invariant:** nothing that borrows a cell here waits while it does.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use actix::prelude::*;
use bytes::Bytes;
use tokio::sync::Notify;

use super::computations::Computations;
use super::outgoing::Outgoing;
use super::unread::UnreadSource;
use crate::actors::ConnectionId;
use crate::actors::gateway::limits::MAX_RESPONSES_WAITING;
use crate::actors::gateway::messages::Request;
use crate::actors::gateway::registry::Registry;
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::memory::Memory;

/// The state that the actor, its writer and the reading task share; one thread, so plain cells do.
pub(super) struct Shared {
    /// The client, once the registry knows it.
    pub(super) id: Cell<Option<ConnectionId>>,
    pub(super) registry: Addr<Registry>,
    /// Where long frames find their room.
    pub(super) memory: Memory,
    pub(super) outgoing: Rc<Outgoing>,
    computations: RefCell<Computations>,
    /// Set while the client is told why a call failed in `values` too.
    pub(super) wants_text: Arc<AtomicBool>,
    /// Something was written or computed: the reader may go on.
    pub(super) room: Notify,
    /// Nothing more is read; queued messages are still sent.
    finishing: Cell<bool>,
    /// How the connection ends.
    pub(super) ending: Cell<Ending>,
}

/// How a connection ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ending {
    /// The client or the runtime has finished.
    Orderly,
    /// The client speaks something else, or is one too many: a status says so, and its input is swallowed.
    Refused,
}

impl Shared {
    /// Nothing waits, nothing is begun.
    pub(super) fn new(registry: Addr<Registry>, gauges: Arc<Gauges>, unread: UnreadSource) -> Self {
        Self {
            id: Cell::new(None),
            registry,
            memory: gauges.memory().clone(),
            outgoing: Outgoing::new(gauges, unread),
            computations: RefCell::default(),
            wants_text: Arc::default(),
            room: Notify::new(),
            finishing: Cell::new(false),
            ending: Cell::new(Ending::Orderly),
        }
    }

    /// Refuses the client: it gets this status, and nothing that it sends is looked at any more.
    pub(super) fn refuse(&self, status: Bytes) {
        self.ending.set(Ending::Refused);
        self.outgoing.push_response(status, &[]);
        self.outgoing.wake_writer();
    }

    /// Whether the client has been refused.
    pub(super) fn is_refused(&self) -> bool {
        self.ending.get() == Ending::Refused
    }

    /// The client may be read: neither its responses nor its computations pile up.
    pub(super) fn may_read(&self) -> bool {
        self.may_compute() && !self.computations.borrow().are_too_many()
    }

    /// Another computation may start: its response would not come on top of too many.
    fn may_compute(&self) -> bool {
        self.outgoing.response_bytes() <= MAX_RESPONSES_WAITING
    }

    /// This many bytes are on their way to the client: there may be room again.
    pub(super) fn written(&self, bytes: usize) {
        let may_read = self.may_read();
        self.outgoing.written(bytes);
        if !may_read {
            self.room.notify_one();
        }
        self.start_computation();
    }

    /// Queues a heavy call behind the connection's others.
    pub(super) fn enqueue_computation(&self, request: Request, length: usize) {
        self.computations.borrow_mut().push(request, length);
        self.start_computation();
    }

    /// The computation that ran has been answered.
    pub(super) fn end_computation(&self) {
        self.computations.borrow_mut().end();
        self.start_computation();
        self.room.notify_one();
    }

    /// Starts the next computation if none runs and its response would find room.
    fn start_computation(&self) {
        let mut computations = self.computations.borrow_mut();
        if computations.can_start()
            && self.may_compute()
            && let Some(request) = computations.start()
        {
            self.registry.do_send(request);
        }
    }

    /// Whether a computation runs or waits.
    pub(super) fn is_computing(&self) -> bool {
        !self.computations.borrow().is_empty()
    }

    /// Gives up the computations: nobody waits for them any more.
    pub(super) fn abandon_computations(&self) {
        self.computations.take();
    }

    /// Ends reading; queued messages are still sent.
    pub(super) fn finish(&self) {
        self.finishing.set(true);
        self.outgoing.wake_writer();
        self.room.notify_one();
    }

    /// Whether nothing more is read.
    pub(super) fn is_finishing(&self) -> bool {
        self.finishing.get()
    }

    /// Whether nothing more is read or computed.
    pub(super) fn is_done(&self) -> bool {
        self.is_finishing() && !self.is_computing()
    }

    /// Waits until nothing more is read.
    pub(super) async fn finished(&self) {
        while !self.is_finishing() {
            self.outgoing.news(|| self.is_finishing()).await;
        }
    }
}

//! One client: bytes in, ops to the registry; messages and answers back, through a bounded outbox.
//!
//! A reception judges the client by its first bytes. From then on three parts on one thread share one `Shared`: the
//! reading task hands one op at a time to the registry and waits until it has taken effect; the actor moves what it is
//! sent into the outbox; the writing task drains the outbox. A client that reads slowly fills its own outbox and nothing else.
//!
//! Generic over the stream, so that tests put an in-memory pipe in its place and run in virtual time.
//!
//! **Invariant:** responses and statuses are never dropped; while too many wait, the client is not read.

mod due;
pub mod gate;
mod reader;
mod reception;
mod shared;
mod transport;
pub mod unfinished;
#[cfg(feature = "web")]
mod web;
mod writer;

use std::net::SocketAddr;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use actix::prelude::*;
use bytes::Bytes;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::task::JoinHandle;

use self::gate::Gate;
use self::reception::Reception;
use self::shared::Shared;
use super::ConnectionId;
use super::gauges::Gauges;
use super::panics::{contain, contained};
use super::registry::{Connect, Disconnect, Outlets, Refused, Registry, Throttle};
use crate::options::DEFAULT_BIND;
use crate::protocol::catalog::{Node, Service, Topic};

/// While more bytes of responses than this wait, the client is not read and none of its computations starts.
pub const MAX_RESPONSES_WAITING: usize = 32 * 1024 * 1024;
/// Computations of one connection that wait behind the one that runs; while so many do, the client is not read.
pub const MAX_COMPUTATIONS_WAITING: usize = 16;
/// A client that takes no byte for so long while responses wait is disconnected.
pub const STALL_LIMIT: Duration = Duration::from_secs(20);
/// How long a client that has stopped sending may take no byte of the topic messages that are left, and how long the
/// end of the stream itself may take.
pub const LINGER: Duration = Duration::from_secs(5);
/// How long a client that has stopped sending is owed the answers that are not ready yet: longer than other clients
/// usually have for theirs. It may as well be gone altogether, which shows only when something is sent to it.
pub const ANSWERS_OWED: Duration = Duration::from_secs(15);

/// A frame of no more bytes from a client that has no responses waiting is served whatever waits for the others.
pub const SMALL_FRAME: usize = 64 * 1024;
/// Bytes of topic messages that may wait for one client while all clients together have nearly all that there is for them.
pub const MAX_TOPIC_BYTES_SCARCE: usize = 64 * 1024;
/// How often a client that finds no room in a total looks again.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// What a response of the arm makes old: after the response to a pause, none of these from before it may follow.
const ARM_STATE: [&str; 8] = [
    Topic::JointStates.name(),
    Topic::JointStates.short_name(),
    Topic::Clock.name(),
    Topic::Clock.short_name(),
    Topic::Diagnostics.name(),
    Topic::Diagnostics.short_name(),
    Topic::Tf.name(),
    Topic::Tf.short_name(),
];

// ---- state ----------------------------------------------------------------------------------------------------------

/// The actor of one client.
pub struct Connection<S> {
    /// The stream, until the tasks take it.
    stream: Option<S>,
    registry: Addr<Registry>,
    shared: Rc<Shared>,
    /// What is asked of the client first.
    gate: Arc<Gate>,
    /// The address that the client has connected to.
    local: SocketAddr,
    /// What reads and writes, once the registry has answered.
    task: Option<Task<()>>,
}

/// A task that ends, where it stands, with whoever has this.
struct Task<T>(JoinHandle<T>);

impl<T> Drop for Task<T> {
    fn drop(&mut self) {
        self.0.abort();
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Connection<S> {
    /// Starts the actor for `stream` in the present system; nothing is asked of the client first.
    pub fn start_on(stream: S, registry: Addr<Registry>, gauges: Arc<Gauges>) -> Addr<Self> {
        Self::start_behind(Arc::default(), DEFAULT_BIND, stream, registry, gauges)
    }

    /// Starts the actor behind a gate, for a client that has connected to `local`.
    pub fn start_behind(
        gate: Arc<Gate>,
        local: SocketAddr,
        stream: S,
        registry: Addr<Registry>,
        gauges: Arc<Gauges>,
    ) -> Addr<Self> {
        let shared = Rc::new(Shared::new(gauges));
        Self {
            stream: Some(stream),
            registry,
            shared,
            gate,
            local,
            task: None,
        }
        .start()
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// A topic message for this client, or several, one behind the other. From the registry; may be dropped, oldest first, when the client is slow.
#[derive(Message, Clone)]
#[rtype(result = "()")]
pub struct Deliver {
    /// The topic, for throttling.
    pub topic: Arc<str>,
    /// The whole frame, or a [series](crate::protocol::series) of them, shared by all subscribers.
    pub frame: Bytes,
}

/// A response, a status, or a call forwarded to this client as a provider. From the registry; never dropped.
#[derive(Message, Clone)]
#[rtype(result = "()")]
pub struct Answer {
    /// The whole frame.
    pub frame: Bytes,
    /// The runtime's own service that it answers.
    pub service: Option<Service>,
}

/// How a topic is throttled for this client; `None` once it is not subscribed. From the registry.
#[derive(Message, Clone)]
#[rtype(result = "()")]
pub struct Configure {
    /// The topic.
    pub topic: Arc<str>,
    /// The smallest of the subscriptions' values.
    pub throttle: Option<Throttle>,
}

/// Send what is owed, then end. From the registry when the runtime ends, and from the reader at the end of the stream.
#[derive(Message, Clone, Copy)]
#[rtype(result = "()")]
pub struct Finish;

/// The writing task has ended: nothing can be sent any more. From the connection's own task.
#[derive(Message)]
#[rtype(result = "()")]
struct Ended;

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Actor for Connection<S> {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Context<Self>) {
        let address = ctx.address();
        let outlets = Outlets {
            deliver: address.clone().recipient(),
            answer: address.clone().recipient(),
            configure: address.clone().recipient(),
            finish: address.recipient(),
            gone: Arc::new(AtomicBool::new(false)),
            backlog: Arc::clone(&self.shared.backlog),
        };
        // Nothing is read before the registry knows the client.
        self.registry
            .send(Connect(outlets))
            .into_actor(self)
            .map(|answer, connection, ctx| {
                connection.begin(answer.unwrap_or(Err(Refused::Closed)), ctx);
            })
            .wait(ctx);
    }

    fn stopped(&mut self, _: &mut Context<Self>) {
        self.task = None;
        if let Some(id) = self.shared.id.take() {
            self.registry.do_send(Disconnect(id));
        }
    }
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Handler<Deliver> for Connection<S> {
    type Result = ();

    fn handle(&mut self, message: Deliver, ctx: &mut Context<Self>) {
        self.contain(ctx, |connection| {
            connection.shared.deliver(&message.topic, message.frame);
        });
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Handler<Answer> for Connection<S> {
    type Result = ();

    fn handle(&mut self, answer: Answer, ctx: &mut Context<Self>) {
        self.contain(ctx, |connection| {
            let shared = &connection.shared;
            let service = answer.service;
            let of_arm = service.is_some_and(|one| one.owner() == Node::ArmSim);
            shared.send_superseding(answer.frame, if of_arm { &ARM_STATE } else { &[] });
            if service.is_some_and(Service::is_computation) {
                shared.computations.borrow_mut().running = None;
                shared.start_computation(&connection.registry);
                shared.room.notify_one();
            }
        });
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Handler<Configure> for Connection<S> {
    type Result = ();

    fn handle(&mut self, configure: Configure, ctx: &mut Context<Self>) {
        self.contain(ctx, |connection| {
            let mut outbox = connection.shared.outbox.borrow_mut();
            match configure.throttle {
                Some(Throttle {
                    interval,
                    queue_length,
                }) => {
                    outbox.set_throttle(&configure.topic, Some((interval, queue_length)));
                }
                None => outbox.forget(&configure.topic),
            }
            connection.shared.outgoing.notify_one();
        });
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Handler<Finish> for Connection<S> {
    type Result = ();

    fn handle(&mut self, _: Finish, _: &mut Context<Self>) {
        self.shared.finish();
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Handler<Ended> for Connection<S> {
    type Result = ();

    fn handle(&mut self, _: Ended, ctx: &mut Context<Self>) {
        ctx.stop();
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<S: AsyncRead + AsyncWrite + Unpin + 'static> Connection<S> {
    /// Starts the tasks that serve the client, or tell it why not.
    fn begin(&mut self, admitted: Result<ConnectionId, Refused>, ctx: &mut Context<Self>) {
        let Some(stream) = self.stream.take() else {
            return;
        };
        let reception = Reception {
            shared: Rc::clone(&self.shared),
            registry: self.registry.clone(),
            finish: ctx.address().recipient(),
            gate: Arc::clone(&self.gate),
            local: self.local,
        };
        let address = ctx.address();
        self.task = Some(Task(actix_rt::spawn(async move {
            if let Err(panic) = contained(reception.run(stream, admitted)).await {
                tracing::error!(%panic, "a client's task failed; its connection ends");
            }
            address.do_send(Ended);
        })));
    }

    /// Does `work`; its panic ends this client and nothing else.
    fn contain(&mut self, ctx: &mut Context<Self>, work: impl FnOnce(&mut Self)) {
        if let Err(panic) = contain(|| work(self)) {
            tracing::error!(%panic, "a client's actor failed; its connection ends");
            ctx.stop();
        }
    }
}

//! Clients join and leave, and get their responses, statuses and refusals. Also the other requests of the runtime and its
//! nodes.
//!
//! **Invariant:** a client has one entry from [`Connect`] to [`Disconnect`]. Its registrations end when it stops
//! sending.

use std::collections::HashSet;
use std::fmt::Display;
use std::net::IpAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use actix::prelude::*;
use bytes::Bytes;
use tokio::time::Instant;

use super::{Client, FrameOrigin, Outlets, Registry, ToClient};
use crate::actors::ConnectionId;
use crate::actors::graph::registrations::{EntrySum, Registrations};
use crate::actors::node::{
    Attach, Barrier, ClientLink, Completion, FinishAll, FrameKind, Respond, TakeCensus, Tapped,
};
use crate::actors::resources::memory::{MAX_BACKLOG, MAX_LONG_BACKLOG, Pool, SHORT, cover};
use crate::actors::resources::places::Refused;
use crate::protocol::catalog::Service;
use crate::protocol::messages::{self, ErrorForm, Level};
use crate::protocol::op::{GoalStatus, OpError, Verbosity};

/// The place of a registered client. Dropping it frees the place, even if the answer to [`Connect`] is lost.
pub struct HeldPlace {
    /// The client's id.
    pub id: ConnectionId,
    registry: Addr<Registry>,
}

impl Drop for HeldPlace {
    fn drop(&mut self) {
        self.registry.do_send(Disconnect(self.id));
    }
}

/// A new client. From its connection. Returns its place.
#[derive(Message)]
#[rtype(result = "Result<HeldPlace, Refused>")]
pub struct Connect {
    /// The handles to its connection.
    pub outlets: Outlets,
    /// Its address.
    pub from: IpAddr,
    /// Whether it may use a kept place.
    pub may_use_kept: bool,
}

/// A client was refused because no place was free. From its connection.
#[derive(Message)]
#[rtype(result = "()")]
pub struct CountRefusal;

/// The client has stopped sending. The registry withdraws its registrations. From its connection. The
/// answer completes when the client's calls have been answered.
#[derive(Message)]
#[rtype(result = "Completion")]
pub struct Retire(pub ConnectionId);

/// The client has disconnected, and its output is gone. The registry frees its place. From its connection. Idempotent.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Disconnect(pub ConnectionId);

impl Client {
    /// Sends a status, a forwarded call or another client's response.
    pub(super) fn send(&self, frame: Bytes) {
        self.respond(frame, None);
    }

    /// Sends a forwarded call or another client's response, which counts for `MAX_LONG_BACKLOG` if it is long.
    pub(super) fn send_long(&self, frame: Bytes) {
        let permit = self.long_backlog.try_take(frame.len());
        self.send(cover(permit.as_ref(), frame));
    }

    /// Whether a forwarded call or another client's response of this length may wait for it.
    pub(super) fn may_wait(&self, bytes: usize) -> bool {
        bytes <= SHORT || self.long_backlog.has(bytes)
    }

    /// Sends a response. `service` is the responding service, if it is the runtime's own.
    pub(super) fn respond(&self, frame: Bytes, service: Option<Service>) {
        if frame.len() <= SHORT {
            self.outlets
                .backlog
                .fetch_add(frame.len(), Ordering::Relaxed);
        }
        let response = ToClient::Respond { frame, service };
        self.outlets.mailbox.do_send(response);
    }

    /// Sends feedback of a goal. It may be dropped.
    pub(super) fn deliver_feedback(&self, frame: Bytes) {
        let (topic, at) = (None, Instant::now());
        let feedback = ToClient::Deliver { topic, frame, at };
        self.outlets.mailbox.do_send(feedback);
    }

    /// Bytes of responses that wait to be written to it.
    pub(super) fn backlog(&self) -> usize {
        self.outlets.backlog.load(Ordering::Relaxed)
    }

    /// Whether its short responses wait beyond the limit. Then other clients' calls and answers to it are refused.
    pub(super) fn is_congested(&self) -> bool {
        self.backlog() > MAX_BACKLOG
    }
}

// ---- the runtime and its nodes --------------------------------------------------------------------------------------

impl Handler<Connect> for Registry {
    type Result = Result<HeldPlace, Refused>;

    fn handle(&mut self, connect: Connect, ctx: &mut Context<Self>) -> Self::Result {
        if self.closed.is_some() {
            return Err(Refused::Closed);
        }
        let taken = self.clients.len();
        self.places.check_free(taken, connect.may_use_kept)?;
        self.connections_made += 1;
        let id = ConnectionId(self.connections_made);
        let link = ClientLink {
            registry: ctx.address().recipient(),
            connection: id,
            gone: connect.outlets.gone.clone(),
        };
        let client = Client {
            outlets: connect.outlets,
            link,
            from: connect.from,
            entries: EntrySum::default(),
            registered: Registrations::default(),
            long_backlog: Pool::of(MAX_LONG_BACKLOG),
            withdrawn: HashSet::new(),
            verbosity: Verbosity::ALL,
            error_form: ErrorForm::default(),
            listening: Arc::default(),
            calls: Some(Completion::pending()),
        };
        self.clients.insert(id, client);
        self.gauges.set_connections(self.clients.len() as u64);
        let registry = ctx.address();
        Ok(HeldPlace { id, registry })
    }
}

impl Handler<CountRefusal> for Registry {
    type Result = ();

    fn handle(&mut self, _: CountRefusal, _: &mut Context<Self>) {
        let all = self.clients.values().map(|client| client.from);
        self.places.warn_of_refusal(all, Instant::now());
    }
}

impl Handler<Retire> for Registry {
    type Result = Completion;

    fn handle(&mut self, Retire(id): Retire, _: &mut Context<Self>) -> Completion {
        self.withdraw(id);
        let client = self.clients.get_mut(&id);
        let calls = client.and_then(|client| client.calls.take());
        calls.map_or_else(Completion::at_once, |(_, all)| all)
    }
}

impl Handler<Disconnect> for Registry {
    type Result = ();

    fn handle(&mut self, Disconnect(id): Disconnect, _: &mut Context<Self>) {
        self.withdraw(id);
        self.requests.forget_caller(id);
        if let Some(client) = self.clients.remove(&id) {
            client.link.gone.set();
            self.gauges.set_connections(self.clients.len() as u64);
        }
    }
}

impl Handler<Attach> for Registry {
    type Result = ();

    fn handle(&mut self, Attach(nodes): Attach, _: &mut Context<Self>) {
        self.nodes = nodes;
    }
}

impl Handler<Barrier> for Registry {
    type Result = ();

    fn handle(&mut self, _: Barrier, _: &mut Context<Self>) {}
}

impl Handler<FinishAll> for Registry {
    type Result = ();

    fn handle(&mut self, _: FinishAll, _: &mut Context<Self>) {
        for client in self.clients.values() {
            client.outlets.mailbox.do_send(ToClient::Finish);
        }
    }
}

impl Handler<TakeCensus> for Registry {
    type Result = MessageResult<TakeCensus>;

    fn handle(&mut self, _: TakeCensus, _: &mut Context<Self>) -> Self::Result {
        MessageResult(self.providers.census(self.topics.listed()))
    }
}

impl Handler<Respond> for Registry {
    type Result = ();

    fn handle(&mut self, respond: Respond, _: &mut Context<Self>) {
        let Some(client) = self.clients.get(&respond.connection) else {
            return;
        };
        match respond.kind {
            FrameKind::Status(level) if !client.verbosity.wants(level) => {}
            FrameKind::Status(_) | FrameKind::End => client.send(respond.frame),
            FrameKind::Feedback => client.deliver_feedback(respond.frame),
            FrameKind::Answer(service) => {
                if let Some(tap) = &mut self.tap {
                    tap(Tapped::Answered {
                        to: respond.connection,
                        service,
                        frame: &respond.frame,
                    });
                }
                client.respond(respond.frame, Some(service));
            }
        }
    }
}

impl Registry {
    /// Withdraws a client's registrations. The cleanup ends the calls and goals that wait for its answer, because there
    /// may be many.
    fn withdraw(&mut self, id: ConnectionId) {
        let Some(client) = self.clients.get_mut(&id) else {
            return;
        };
        let registered = std::mem::take(&mut client.registered);
        for topic in registered.advertised.keys() {
            self.topics.remove_publisher(topic);
        }
        for topic in &registered.subscribed {
            self.drop_subscriber(topic, id);
        }
        for (kind, name) in registered.served.keys() {
            self.providers.withdraw(*kind, name, id);
        }
        if self.requests.waiting_for(id).is_some() {
            self.gone.push_back(id);
        }
    }

    /// Answers a frame that has no op: by the response of its call, by the result of its goal, or by a status.
    pub(super) fn answer_error(&self, origin: &FrameOrigin, why: &OpError) {
        match why {
            OpError::Call { service, problem } => self.refuse_call(origin, service, problem, None),
            OpError::Goal { action, problem } => {
                self.end_goal(origin, action, problem, GoalStatus::Unknown);
            }
            OpError::Status(problem) => self.refuse(origin, problem),
        }
    }

    /// Sends an error status with the reason to the sender of a refused frame.
    pub(super) fn refuse(&self, origin: &FrameOrigin, why: &impl Display) {
        let why = why.to_string();
        tracing::debug!(connection = origin.from.0, why, "refused");
        self.send_status(origin, Level::Error, &why);
    }

    pub(super) fn send_status(&self, origin: &FrameOrigin, level: Level, msg: &str) {
        if let Some(client) = self.clients.get(&origin.from)
            && client.verbosity.wants(level)
        {
            client.send(self.covered(messages::status(level, msg, origin.id.as_ref())));
        }
    }

    /// The frame with the memory permit of the long frame from which it was made.
    pub(super) fn covered(&self, frame: Bytes) -> Bytes {
        cover(self.permit.as_ref(), frame)
    }
}

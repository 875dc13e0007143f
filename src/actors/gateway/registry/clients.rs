//! The clients of the registry: their places, and their responses, statuses and refusals.
//!
//! **Invariant:** a client has one entry from [`Connect`] to its end. A frame made from a long one has its permit.

use std::collections::{BTreeMap, HashSet};
use std::fmt::Display;
use std::net::IpAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use actix::prelude::*;
use bytes::Bytes;
use tokio::time::Instant;

use super::messages::{Connect, Outlets, ToClient};
use crate::actors::ConnectionId;
use crate::actors::graph::registrations::{EntrySum, Registrations};
use crate::actors::node::{ClientLink, Completion, Respond, Working};
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::memory::{MAX_BACKLOG, MAX_LONG_BACKLOG, Permit, Pool, SHORT, cover};
use crate::actors::resources::places::{Places, Refused};
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::{self, ErrorForm, Level};
use crate::protocol::op::{GoalStatus, OpError, Verbosity};
use crate::protocol::wire::json::Payload;

/// The sender of the frame that is being performed, and the frame's `id`.
pub(super) struct FrameOrigin {
    pub(super) from: ConnectionId,
    pub(super) id: Option<Payload>,
}

// ---- one client -----------------------------------------------------------------------------------------------------

/// The registry's entry of one client.
pub(super) struct Client {
    pub(super) outlets: Outlets,
    /// The client, as the nodes get it.
    pub(super) link: ClientLink,
    /// Its address.
    from: IpAddr,
    /// The sum of its registrations, and of its calls and goals that wait for other clients.
    pub(super) entries: EntrySum,
    pub(super) registered: Registrations,
    /// The memory of long calls and answers of other clients that wait for it.
    long_backlog: Pool,
    /// Topics of the runtime's subscriptions that this client has explicitly unadvertised. Its messages there are
    /// dropped until it advertises again.
    pub(super) withdrawn: HashSet<Topic>,
    /// The lowest level of statuses that it gets.
    pub(super) verbosity: Verbosity,
    /// The form in which it gets the reason of a failed call.
    pub(super) error_form: ErrorForm,
    /// Replaced when the client unsubscribes from the feedback of its goals, and dropped with the client.
    pub(super) listening: Arc<()>,
    /// What its calls to other clients hold, and the completion of all of them. Removed when the client
    /// stops sending.
    pub(super) calls: Option<(Working, Completion)>,
}

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

// ---- all clients ----------------------------------------------------------------------------------------------------

/// All clients.
#[derive(Default)]
pub(super) struct Clients {
    by_id: BTreeMap<ConnectionId, Client>,
    pub(super) places: Places,
    pub(super) gauges: Arc<Gauges>,
    connections_made: u64,
    /// The memory permit of the frame whose op is being performed, if that frame is long.
    pub(super) permit: Option<Permit>,
}

impl Clients {
    /// Adds a client, if there is a place for it. `registry` passes on the nodes' frames for it.
    pub(super) fn add(
        &mut self,
        connect: Connect,
        registry: Recipient<Respond>,
    ) -> Result<ConnectionId, Refused> {
        let taken = self.by_id.len();
        self.places.check_free(taken, connect.may_use_kept)?;
        self.connections_made += 1;
        let id = ConnectionId(self.connections_made);
        let link = ClientLink {
            registry,
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
        self.by_id.insert(id, client);
        self.count();
        Ok(id)
    }

    /// Removes a client that has disconnected.
    pub(super) fn remove(&mut self, id: ConnectionId) {
        if let Some(client) = self.by_id.remove(&id) {
            client.link.gone.set();
            self.count();
        }
    }

    fn count(&self) {
        self.gauges.set_connections(self.by_id.len() as u64);
    }

    pub(super) fn get(&self, id: ConnectionId) -> Option<&Client> {
        self.by_id.get(&id)
    }

    pub(super) fn get_mut(&mut self, id: ConnectionId) -> Option<&mut Client> {
        self.by_id.get_mut(&id)
    }

    /// Every connection sends its queue and ends.
    pub(super) fn finish_all(&self) {
        for client in self.by_id.values() {
            client.outlets.mailbox.do_send(ToClient::Finish);
        }
    }

    /// Counts a client that was refused because no place was free.
    pub(super) fn count_refusal(&mut self) {
        let all = self.by_id.values().map(|client| client.from);
        self.places.warn_of_refusal(all, Instant::now());
    }

    // ---- frames to one of them --------------------------------------------------------------------------------------

    /// The frame with the memory permit of the long frame from which it was made.
    pub(super) fn covered(&self, frame: Bytes) -> Bytes {
        cover(self.permit.as_ref(), frame)
    }

    pub(super) fn send_status(&self, origin: &FrameOrigin, level: Level, msg: &str) {
        if let Some(client) = self.get(origin.from)
            && client.verbosity.wants(level)
        {
            client.send(self.covered(messages::status(level, msg, origin.id.as_ref())));
        }
    }

    /// Sends an error status with the reason to the sender of a refused frame.
    pub(super) fn refuse(&self, origin: &FrameOrigin, why: &impl Display) {
        let why = why.to_string();
        tracing::debug!(connection = origin.from.0, why, "refused");
        self.send_status(origin, Level::Error, &why);
    }

    /// Answers a call with `result: false` and the reason. `own` is the service, if a node of the runtime serves it.
    pub(super) fn refuse_call(
        &self,
        origin: &FrameOrigin,
        service: &str,
        why: &impl Display,
        own: Option<Service>,
    ) {
        if let Some(client) = self.get(origin.from) {
            let (id, form) = (origin.id.as_ref(), client.error_form);
            let frame = messages::failure(service, id, &why.to_string(), form);
            client.respond(self.covered(frame), own);
        }
    }

    /// Ends a goal that has no result, for this reason.
    pub(super) fn end_goal(
        &self,
        origin: &FrameOrigin,
        action: &str,
        why: &impl Display,
        status: GoalStatus,
    ) {
        if let Some(client) = self.get(origin.from) {
            let (id, why) = (origin.id.as_ref(), why.to_string());
            let frame = messages::action_result(action, id, &why, status as u8, false);
            client.send(self.covered(frame));
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
}

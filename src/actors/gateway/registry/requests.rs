//! Routes calls and goals to the node or client that serves them, and routes answers back. Sends clients their
//! responses, statuses and refusals.
//!
//! **Invariant:** every call has one response. Every goal has one `action_result`, unless its sender disconnects first.

use std::fmt::Display;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::task::{self, Poll, ready};
use std::time::Duration;

use actix::prelude::*;
use bytes::Bytes;
use serde_json::json;
use tokio::time::Instant;

use super::{Client, FrameOrigin, Handled, Registry, ToClient};
use crate::actors::gateway::limits::DEFAULT_TIMEOUT;
use crate::actors::graph::forwarded::Forwarded;
use crate::actors::graph::refusal::{self, Refusal};
use crate::actors::node::{
    ActionClient, ActionRequest, Caller, CancelSent, Done, ForwardGoal, FrameKind, RefuseCalls,
    Respond, Route, ServiceCall, Tapped, guard,
};
use crate::actors::resources::memory::{MAX_BACKLOG, SHORT, cover, cover_message};
use crate::actors::resources::turns::{Timer, end_turn};
use crate::protocol::catalog::{Action, Service};
use crate::protocol::messages::{self, Level};
use crate::protocol::names;
use crate::protocol::op::fields::mistyped;
use crate::protocol::op::{
    ActionGoal, Arguments, CallService, GoalStatus, OpError, Problem, ProviderOp, Served,
};
use crate::protocol::wire::json::Payload;
use crate::services::{Address, NoService};

/// Calls and goals ended per cleanup, which takes a third of a millisecond.
const ENDED_IN_A_ROW: usize = 128;
/// A deadline that is noticed so late shows that the process was stopped.
const STOPPED: Duration = Duration::from_millis(250);
/// Time to read the answers in sockets after a stop.
const READ_SOCKETS: Duration = Duration::from_millis(50);

// ---- to the runtime's own nodes -------------------------------------------------------------------------------------

impl Registry {
    /// Sends a call to the node or the client that serves it. A failure is the call's one response.
    pub(super) fn call(&mut self, origin: FrameOrigin, call: CallService) -> Handled {
        let own = Service::from_name(&call.service);
        let cancelled = self.action_to_cancel(&call.service);
        let refusal = match (self.closed, own, cancelled) {
            (Some(why), ..) => Err(Refusal::Closed(why)),
            (None, Some(service), _) => return self.call_node(service, origin, call),
            (None, None, Some(action)) => match self.cancel_all_goals(&origin, &call, action) {
                Ok(handled) => return handled,
                Err(why) => Err(why),
            },
            (None, None, None) => {
                let deadline = Instant::now() + call.timeout.unwrap_or(DEFAULT_TIMEOUT);
                let (kind, args) = (Served::Service, &call.args);
                let encode = |spelling: &str, id: &str| messages::call(spelling, id, args);
                self.forward(
                    &origin,
                    kind,
                    (&call.service, args),
                    (Some(deadline), false),
                    encode,
                )
            }
        };
        if let Err(why) = refusal {
            self.refuse_call(&origin, &call.service, &why, own);
        }
        Handled::at_once()
    }

    /// Sends a call to the node that serves it, and shows it to the tap. Refuses it if no node does.
    fn call_node(&mut self, service: Service, origin: FrameOrigin, call: CallService) -> Handled {
        let Some(client) = self.clients.get(&origin.from) else {
            return Handled::at_once();
        };
        let Some(node) = self.nodes.services.get(&service) else {
            let why = NoService::NotServed(call.service.clone());
            self.refuse_call(&origin, &call.service, &why, Some(service));
            return Handled::at_once();
        };
        if let Some(tap) = &mut self.tap {
            tap(Tapped::Called {
                from: origin.from,
                service,
                id: origin.id.as_ref(),
                args: &call.args,
            });
        }
        let address = Address::new(service, call.service.into_boxed_str(), origin.id)
            .with_errors(client.error_form);
        let (link, memory) = (client.link.clone(), self.gauges.memory().clone());
        let (caller, ended) = Caller::new(link, address, memory, self.permit.clone());
        node(ServiceCall {
            service,
            arguments: call.args,
            caller,
        });
        Handled::with(ended)
    }

    /// Sends a goal to the node, or the client, that serves its action. A failure is the goal's one result.
    pub(super) fn send_action_goal(&mut self, origin: FrameOrigin, goal: ActionGoal) -> Handled {
        let Some(client) = self.clients.get(&origin.from) else {
            return Handled::at_once();
        };
        let refusal = match (self.closed, Action::from_name(&goal.action)) {
            (Some(why), _) => Err(Refusal::Closed(why)),
            (None, Some(action)) => match self.action_route(action, &goal) {
                Ok(node) => {
                    let (done, ended) = guard();
                    let client = ActionClient {
                        link: client.link.clone(),
                        action: Arc::from(goal.action),
                        id: origin.id,
                        wants_feedback: goal.feedback,
                    };
                    let goal = goal.args;
                    node(ActionRequest::Goal(ForwardGoal { goal, client, done }));
                    return Handled::with(ended);
                }
                Err(why) => Err(why),
            },
            (None, None) => {
                let (type_name, args) = (goal.type_name.as_deref(), &goal.args);
                let encode = |spelling: &str, id: &str| {
                    messages::action_goal(spelling, id, type_name, args, goal.feedback)
                };
                let name = (&*goal.action, args);
                self.forward(&origin, Served::Action, name, (None, goal.feedback), encode)
            }
        };
        if let Err(why) = refusal {
            self.end_goal(&origin, &goal.action, &why, GoalStatus::Unknown);
        }
        Handled::at_once()
    }

    /// The node that serves an action of the runtime.
    fn action_route(
        &self,
        action: Action,
        goal: &ActionGoal,
    ) -> Result<&Route<ActionRequest>, Refusal> {
        match &goal.type_name {
            Some(name) if !names::same_type(name, action.type_name()) => {
                Err(Refusal::ActionType(action.type_name()))
            }
            _ => {
                let unknown = || Refusal::NoAction(goal.action.clone());
                self.nodes.actions.get(&action).ok_or_else(unknown)
            }
        }
    }

    /// Cancels a goal of the same client.
    pub(super) fn cancel_action_goal(&self, origin: &FrameOrigin, action: &str) -> Handled {
        let at_node = self.cancel_at_node(origin, action, origin.id.clone(), false);
        at_node.unwrap_or_else(|| {
            if let Err(why) = self.forward_cancellation(origin, action) {
                self.refuse(origin, &why);
            }
            Handled::at_once()
        })
    }

    /// Cancels the client's goal with this id, or all goals, at the node that serves the action. `None` if no node
    /// does.
    fn cancel_at_node(
        &self,
        origin: &FrameOrigin,
        action: &str,
        id: Option<Payload>,
        all: bool,
    ) -> Option<Handled> {
        let node = self.nodes.actions.get(&Action::from_name(action)?)?;
        let link = self.clients.get(&origin.from)?.link.clone();
        let (done, ended) = guard();
        node(ActionRequest::Cancel(CancelSent {
            link,
            id,
            all,
            done,
        }));
        Some(Handled::with(ended))
    }

    /// The action whose goals a call of this service cancels, unless a client provides the service itself.
    fn action_to_cancel<'a>(&self, service: &'a str) -> Option<&'a str> {
        let action = names::cancelled_action(service)?;
        let has = |kind, name| {
            self.providers
                .provider(kind, &names::absolute(name))
                .is_some()
        };
        let is_known = Action::from_name(action).is_some() || has(Served::Action, action);
        (is_known && !has(Served::Service, service)).then_some(action)
    }

    /// Cancels all goals of an action, also those of other clients, as the service of ROS 2 does. The goals end after
    /// the answer.
    fn cancel_all_goals(
        &mut self,
        origin: &FrameOrigin,
        call: &CallService,
        action: &str,
    ) -> Result<Handled, Refusal> {
        let mut args = call.args.get().bytes();
        if !args.all(|byte| b"{}[] \t\r\n".contains(&byte)) {
            return Err(Refusal::OneGoal);
        }
        let handled = match self.cancel_at_node(origin, action, None, true) {
            Some(handled) => handled,
            None => {
                self.forward_all_cancellations(action)?;
                Handled::at_once()
            }
        };
        let values = json!({"return_code": 0, "goals_canceling": []});
        let id = origin.id.as_ref();
        let frame = messages::response(&call.service, id, &values, true, "");
        if let Some(client) = self.clients.get(&origin.from) {
            client.send(self.covered(frame));
        }
        Ok(handled)
    }
}

// ---- to clients that serve ------------------------------------------------------------------------------------------

impl Registry {
    /// Performs an op of a client that serves `name`.
    pub(super) fn perform_as_provider(
        &mut self,
        origin: &FrameOrigin,
        kind: Served,
        name: &str,
        op: ProviderOp,
    ) -> Result<(), Refusal> {
        match op {
            ProviderOp::Advertise { type_name } => {
                self.serve(origin, kind, name, type_name.as_deref())
            }
            ProviderOp::Unadvertise => self.stop_serving(origin, kind, name),
            ProviderOp::Feedback { values } => self.pass_feedback(origin, name, &values),
            ProviderOp::End {
                values,
                status,
                result,
            } => self.complete(origin, kind, name, |name, id| {
                messages::action_result(name, id, &values, status, result)
            }),
            ProviderOp::Respond {
                values,
                result,
                status,
            } => {
                let status = status.unwrap_or_default();
                self.complete(origin, kind, name, |name, id| {
                    messages::response(name, id, &values, result, &status)
                })
            }
        }
    }

    /// Makes a client the provider of a service, or the server of an action.
    fn serve(
        &mut self,
        origin: &FrameOrigin,
        kind: Served,
        spelling: &str,
        type_name: Option<&str>,
    ) -> Result<(), Refusal> {
        refusal::check_served(kind, spelling)?;
        let name = &*names::absolute(spelling);
        let Some(client) = self.clients.get_mut(&origin.from) else {
            return Ok(());
        };
        let bytes = spelling.len() + type_name.map_or(0, str::len);
        let (key, served) = ((kind, name.into()), &mut client.registered.served);
        let entry = client.entries.enter(bytes, served.get(&key))?;
        served.insert(key, entry);
        let provider = (origin.from, spelling);
        let before = self.providers.provide(kind, name, provider, type_name);
        if let Some(before) = before.filter(|one| *one != origin.from)
            && let Some(before) = self.clients.get_mut(&before)
        {
            before.registered.served.remove(&(kind, name.into()));
        }
        let msg = format!("advertised {} {spelling}", kind.noun());
        self.send_status(origin, Level::Info, &msg);
        Ok(())
    }

    /// Withdraws a name. The client still answers its pending calls and goals.
    fn stop_serving(
        &mut self,
        origin: &FrameOrigin,
        kind: Served,
        spelling: &str,
    ) -> Result<(), Refusal> {
        let name = &*names::absolute(spelling);
        if !self.providers.withdraw(kind, name, origin.from) {
            return Err(Refusal::NotServed(kind, spelling.to_owned()));
        }
        if let Some(client) = self.clients.get_mut(&origin.from) {
            client.registered.served.remove(&(kind, name.into()));
        }
        Ok(())
    }

    /// Forwards a call or a goal to its provider. `encode` makes the frame, with the provider's spelling of the name
    /// and an id of the runtime's own.
    fn forward(
        &mut self,
        origin: &FrameOrigin,
        kind: Served,
        (name, args): (&str, &Arguments),
        (deadline, wants_feedback): (Option<Instant>, bool),
        encode: impl FnOnce(&str, &str) -> Bytes,
    ) -> Result<(), Refusal> {
        let absolute = &*names::absolute(name);
        let Some(provider) = self.providers.provider(kind, absolute) else {
            return Err(match kind {
                Served::Service => NoService::NoProvider(name.to_owned()).into(),
                Served::Action => Refusal::NoAction(name.to_owned()),
            });
        };
        if !args.get().starts_with(['{', '[']) {
            let expected = "an object or an array";
            return Err(Refusal::BadArguments(mistyped(expected, args.raw())));
        }
        let server = self.clients.get(&provider.connection);
        if server.is_some_and(Client::is_congested) {
            return Err(Refusal::ProviderBusy(name.to_owned()));
        }
        if server.is_some_and(|server| !server.has_long_room(args.get().len())) {
            return Err(Refusal::ProviderFull(name.to_owned()));
        }
        let Some(caller) = self.clients.get(&origin.from) else {
            return Ok(());
        };
        let (spelling, done) = match kind {
            Served::Service => (
                None,
                caller.calls.as_ref().map(|(done, _)| Done::clone(done)),
            ),
            Served::Action => (Some(provider.spelling.clone()), None),
        };
        let id = origin.id.as_ref().map_or(0, Payload::allocated);
        let bytes = id + name.len() + spelling.as_deref().map_or(0, str::len);
        let known_as = self.requests.add(Forwarded {
            caller: origin.from,
            id: origin.id.clone(),
            provider: provider.connection,
            name: name.into(),
            kind,
            deadline,
            spelling,
            wants_feedback,
            is_cancelled: false,
            _done: done,
            _entry: caller.entries.enter(bytes, None)?,
        });
        if let Some(server) = server {
            server.send_long(self.covered(encode(&provider.spelling, &known_as)));
        }
        Ok(())
    }

    /// Forwards the cancellation of a goal to its action server.
    fn forward_cancellation(&self, origin: &FrameOrigin, action: &str) -> Result<(), Refusal> {
        let requests = &self.requests;
        let goal = requests.newest_goal(origin.id.as_ref(), action, origin.from);
        let Some((id, goal)) = goal else {
            let name = names::absolute(action);
            return Err(match self.providers.provider(Served::Action, &name) {
                Some(_) => Refusal::NoGoal(action.to_owned()),
                None => Refusal::NoAction(action.to_owned()),
            });
        };
        if let (Some(server), Some(spelling)) = (self.clients.get(&goal.provider), &goal.spelling) {
            if server.is_congested() {
                return Err(Refusal::ProviderBusy(action.to_owned()));
            }
            server.send(messages::cancellation(spelling, &id));
        }
        Ok(())
    }

    /// Forwards the cancellation of all goals of an action, as far as its server reads. If goals remain, the caller
    /// gets a refusal and may call again.
    fn forward_all_cancellations(&mut self, action: &str) -> Result<(), Refusal> {
        let provider = self
            .providers
            .provider(Served::Action, &names::absolute(action));
        let server = provider.and_then(|one| Some((one, self.clients.get(&one.connection)?)));
        let Some((provider, server)) = server else {
            return Err(Refusal::NoAction(action.to_owned()));
        };
        let spelling = &*provider.spelling;
        let length = messages::cancellation(spelling, &names::own_id(u64::MAX)).len();
        let room = MAX_BACKLOG.saturating_sub(server.backlog()) / length;
        let (ids, is_rest) = self.requests.cancel_all(action, provider.connection, room);
        for id in &ids {
            server.send(messages::cancellation(spelling, id));
        }
        if is_rest {
            return Err(Refusal::ProviderBusy(action.to_owned()));
        }
        Ok(())
    }

    /// Sends feedback to the sender of the goal, if it requested feedback. A slow client may miss some.
    fn pass_feedback(
        &self,
        origin: &FrameOrigin,
        action: &str,
        values: &Payload,
    ) -> Result<(), Refusal> {
        let requests = &self.requests;
        let meant = requests.find_answered(Served::Action, origin.id.as_ref(), None, origin.from);
        let goal = meant.and_then(|number| requests.get(number));
        let goal = goal.ok_or_else(|| Refusal::StaleGoal(action.to_owned()))?;
        if !names::are_same(&goal.name, action) {
            return Err(Refusal::OfAnother(Served::Action, goal.name.to_string()));
        }
        let sender = self.clients.get(&goal.caller);
        if let Some(sender) = sender.filter(|_| goal.wants_feedback) {
            let frame = messages::action_feedback(&goal.name, goal.id.as_ref(), values);
            sender.deliver_feedback(cover_message(self.permit.as_ref(), frame));
        }
        Ok(())
    }

    /// Sends the provider's answer to the caller, under the caller's own id.
    fn complete(
        &mut self,
        origin: &FrameOrigin,
        kind: Served,
        name: &str,
        encode: impl FnOnce(&str, Option<&Payload>) -> Bytes,
    ) -> Result<(), Refusal> {
        let (requests, id) = (&mut self.requests, origin.id.as_ref());
        let request = requests.take_answered(kind, id, None, origin.from);
        let request = request.ok_or_else(|| match kind {
            Served::Service => Refusal::StaleCall(name.to_owned()),
            Served::Action => Refusal::StaleGoal(name.to_owned()),
        })?;
        if !names::are_same(&request.name, name) {
            return self.discard(&request, Refusal::OfAnother(kind, request.name.to_string()));
        }
        let Some(caller) = self.clients.get(&request.caller) else {
            return Ok(());
        };
        let name = || request.name.to_string();
        if caller.is_congested() {
            self.fail(&request, &Refusal::CallerBusy(name()));
            return Ok(());
        }
        let answer = encode(&request.name, request.id.as_ref());
        if !caller.has_long_room(answer.len()) {
            self.fail(&request, &Refusal::CallerFull(name()));
            return Ok(());
        }
        caller.send_long(self.covered(answer));
        Ok(())
    }

    /// Ends the call or goal that got a bad answer, if there is one.
    pub(super) fn fail_answered(
        &mut self,
        origin: &FrameOrigin,
        kind: Served,
        name: Option<&str>,
        problem: Problem,
    ) -> Result<(), Refusal> {
        let why = Refusal::Unreadable(problem);
        let (requests, id) = (&mut self.requests, origin.id.as_ref());
        match requests.take_answered(kind, id, name, origin.from) {
            Some(request) => self.discard(&request, why),
            None => Err(why),
        }
    }

    /// Discards an answer. The caller and the provider get the reason.
    fn discard(&mut self, request: &Forwarded, why: Refusal) -> Result<(), Refusal> {
        let name = request.name.to_string();
        self.fail(request, &Refusal::BadAnswer(name, Box::new(why.clone())));
        Err(why)
    }

    /// Ends a request without an answer. The caller gets the reason.
    fn fail(&self, request: &Forwarded, why: &Refusal) {
        let origin = FrameOrigin {
            from: request.caller,
            id: request.id.clone(),
        };
        match request.kind {
            Served::Service => self.refuse_call(&origin, &request.name, why, None),
            Served::Action => {
                self.end_goal(&origin, &request.name, why, GoalStatus::Aborted);
            }
        }
    }

    /// Answers a call with `result: false` and the reason. `own` is the service, if a node of the runtime serves it.
    fn refuse_call(
        &self,
        origin: &FrameOrigin,
        service: &str,
        why: &impl Display,
        own: Option<Service>,
    ) {
        if let Some(client) = self.clients.get(&origin.from) {
            let (id, form) = (origin.id.as_ref(), client.error_form);
            let frame = messages::failure(service, id, &why.to_string(), form);
            client.respond(self.covered(frame), own);
        }
    }

    /// Ends a goal that has no result, for this reason.
    fn end_goal(&self, origin: &FrameOrigin, action: &str, why: &impl Display, status: GoalStatus) {
        if let Some(client) = self.clients.get(&origin.from) {
            let (id, why) = (origin.id.as_ref(), why.to_string());
            let frame = messages::action_result(action, id, &why, status as u8, false);
            client.send(self.covered(frame));
        }
    }
}

// ---- frames to a client ---------------------------------------------------------------------------------------------

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

impl Client {
    /// Sends a status, a forwarded call or another client's response.
    fn send(&self, frame: Bytes) {
        self.respond(frame, None);
    }

    /// Sends a forwarded call or another client's response, which counts for `MAX_LONG_BACKLOG` if it is long.
    fn send_long(&self, frame: Bytes) {
        let room = self.long_room.try_take(frame.len());
        self.send(cover(room.as_ref(), frame));
    }

    /// Whether a forwarded call or another client's response of this length may wait for it.
    fn has_long_room(&self, bytes: usize) -> bool {
        bytes <= SHORT || self.long_room.has(bytes)
    }

    /// Sends a response. `service` is the responding service, if it is the runtime's own.
    fn respond(&self, frame: Bytes, service: Option<Service>) {
        if frame.len() <= SHORT {
            self.outlets
                .backlog
                .fetch_add(frame.len(), Ordering::Relaxed);
        }
        let response = ToClient::Respond { frame, service };
        self.outlets.mailbox.do_send(response);
    }

    /// Sends feedback of a goal. It may be dropped.
    fn deliver_feedback(&self, frame: Bytes) {
        let (topic, at) = (None, Instant::now());
        let feedback = ToClient::Deliver { topic, frame, at };
        self.outlets.mailbox.do_send(feedback);
    }

    /// Bytes of responses that wait to be written to it.
    fn backlog(&self) -> usize {
        self.outlets.backlog.load(Ordering::Relaxed)
    }

    /// Whether its short responses wait beyond the limit. Then other clients' calls and answers to it are refused.
    fn is_congested(&self) -> bool {
        self.backlog() > MAX_BACKLOG
    }
}

impl Registry {
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
    fn covered(&self, frame: Bytes) -> Bytes {
        cover(self.permit.as_ref(), frame)
    }
}

// ---- cleanup: requests end in batches, and other messages are handled in between ------------------------------------

/// Ends calls past their deadlines, and requests of disconnected providers. The actor polls it after each message.
#[derive(Default)]
struct Cleanup {
    timer: Timer,
    /// Calls end from this time on, after the process was stopped beyond a deadline.
    sockets_read: Option<Instant>,
}

impl Cleanup {
    /// When the next call ends. If its deadline passed long ago, the process was stopped, and an answer may wait in a
    /// socket. So the sockets are read first.
    fn next_end(&mut self, deadline: Option<Instant>, now: Instant) -> Option<Instant> {
        let was_stopped = deadline.is_some_and(|deadline| deadline + STOPPED < now);
        self.sockets_read = match was_stopped {
            true => self.sockets_read.or(Some(now + READ_SOCKETS)),
            false => None,
        };
        deadline.max(self.sockets_read)
    }
}

impl ActorFuture<Registry> for Cleanup {
    type Output = ();

    fn poll(
        mut self: Pin<&mut Self>,
        registry: &mut Registry,
        _: &mut Context<Registry>,
        cx: &mut task::Context<'_>,
    ) -> Poll<()> {
        if registry.gone.is_empty() {
            let end = self.next_end(registry.requests.next_deadline(), Instant::now());
            ready!(self.timer.poll(end, cx));
        }
        registry.clean_up_batch();
        end_turn(cx)
    }
}

impl Registry {
    pub(super) fn start_cleanup(ctx: &mut Context<Self>) {
        ctx.spawn(Cleanup::default());
    }

    /// Ends one batch: first calls past their deadlines, then requests of disconnected providers.
    fn clean_up_batch(&mut self) {
        let now = Instant::now();
        for _ in 0..ENDED_IN_A_ROW {
            if let Some(call) = self.requests.take_due(now) {
                self.fail(&call, &Refusal::TimedOut(call.name.to_string()));
                continue;
            }
            let Some(provider) = self.gone.front() else {
                return;
            };
            let waiting = self.requests.waiting_for(*provider);
            if let Some(request) = waiting.and_then(|number| self.requests.take(number)) {
                self.fail(&request, &Refusal::ProviderGone(request.name.to_string()));
            } else {
                self.gone.pop_front();
            }
        }
    }
}

impl Handler<RefuseCalls> for Registry {
    type Result = ();

    fn handle(&mut self, RefuseCalls(why): RefuseCalls, _: &mut Context<Self>) {
        self.closed = Some(why);
        for request in self.requests.take_all() {
            self.fail(&request, &Refusal::Closed(why));
        }
    }
}

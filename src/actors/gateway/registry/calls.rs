//! Routes calls to the node or client that serves them, and the answers of clients back, also those to goals.
//!
//! **Invariant:** every call has one response.

use std::fmt::Display;
use std::pin::Pin;
use std::task::{self, Poll, ready};
use std::time::Duration;

use actix::prelude::*;
use bytes::Bytes;
use tokio::time::Instant;

use super::{Client, FrameOrigin, Registry};
use crate::actors::gateway::limits::DEFAULT_TIMEOUT;
use crate::actors::graph::forwarded::Forwarded;
use crate::actors::graph::providers::Provider;
use crate::actors::graph::refusal::{self, Refusal};
use crate::actors::node::{Caller, Completion, RefuseCalls, ServiceCall, Tapped};
use crate::actors::resources::turns::{Timer, end_turn};
use crate::protocol::catalog::Service;
use crate::protocol::messages::{self, Level};
use crate::protocol::names;
use crate::protocol::op::fields::mistyped;
use crate::protocol::op::{Arguments, CallService, GoalStatus, Problem, ProviderOp, Served};
use crate::protocol::wire::json::Payload;
use crate::services::{Address, NoService};

/// Calls and goals ended per cleanup, which takes a third of a millisecond.
const ENDED_IN_A_ROW: usize = 128;
/// A deadline that is noticed so late shows that the process was stopped.
const STOPPED: Duration = Duration::from_millis(250);
/// Time to read the answers in sockets after a stop.
const READ_SOCKETS: Duration = Duration::from_millis(50);

/// A call or a goal for the client that serves it.
pub(super) struct ToForward<'a> {
    pub(super) kind: Served,
    /// The name, as the caller spells it.
    pub(super) name: &'a str,
    pub(super) args: &'a Arguments,
    /// When the call ends without an answer.
    pub(super) deadline: Option<Instant>,
    /// Whether the sender of the goal gets its feedback.
    pub(super) wants_feedback: bool,
}

impl Registry {
    // ---- to the runtime's own nodes ---------------------------------------------------------------------------------

    /// Sends a call to the node or the client that serves it. A failure is the call's one response.
    pub(super) fn call(&mut self, origin: FrameOrigin, call: CallService) -> Completion {
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
                let to_forward = ToForward {
                    kind: Served::Service,
                    name: &call.service,
                    args: &call.args,
                    deadline: Some(Instant::now() + call.timeout.unwrap_or(DEFAULT_TIMEOUT)),
                    wants_feedback: false,
                };
                self.forward(&origin, &to_forward, |spelling, id| {
                    messages::call(spelling, id, &call.args)
                })
            }
        };
        if let Err(why) = refusal {
            self.refuse_call(&origin, &call.service, &why, own);
        }
        Completion::at_once()
    }

    /// Sends a call to the node that serves it, and shows it to the tap. Refuses it if no node does.
    fn call_node(
        &mut self,
        service: Service,
        origin: FrameOrigin,
        call: CallService,
    ) -> Completion {
        let Some(client) = self.clients.get(&origin.from) else {
            return Completion::at_once();
        };
        let Some(node) = self.nodes.services.get(&service) else {
            let why = NoService::NotServed(call.service.clone());
            self.refuse_call(&origin, &call.service, &why, Some(service));
            return Completion::at_once();
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
        let (caller, completion) = Caller::new(link, address, memory, self.permit.clone());
        node(ServiceCall {
            service,
            arguments: call.args,
            caller,
        });
        completion
    }

    // ---- to clients that serve --------------------------------------------------------------------------------------

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
        let provider = Provider::new(origin.from, spelling, type_name);
        let before = self.providers.provide(kind, name, provider);
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
    pub(super) fn forward(
        &mut self,
        origin: &FrameOrigin,
        request: &ToForward<'_>,
        encode: impl FnOnce(&str, &str) -> Bytes,
    ) -> Result<(), Refusal> {
        let ToForward {
            kind, name, args, ..
        } = *request;
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
        if server.is_some_and(|server| !server.may_wait(args.get().len())) {
            return Err(Refusal::ProviderFull(name.to_owned()));
        }
        let Some(caller) = self.clients.get(&origin.from) else {
            return Ok(());
        };
        let (spelling, working) = match kind {
            Served::Service => (
                None,
                caller.calls.as_ref().map(|(working, _)| working.clone()),
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
            deadline: request.deadline,
            spelling,
            wants_feedback: request.wants_feedback,
            is_cancelled: false,
            _working: working,
            _entry: caller.entries.enter(bytes, None)?,
        });
        if let Some(server) = server {
            server.send_long(self.covered(encode(&provider.spelling, &known_as)));
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
        if !caller.may_wait(answer.len()) {
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
    pub(super) fn refuse_call(
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

    // ---- the end of requests without an answer ----------------------------------------------------------------------

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

impl Handler<RefuseCalls> for Registry {
    type Result = ();

    fn handle(&mut self, RefuseCalls(why): RefuseCalls, _: &mut Context<Self>) {
        self.closed = Some(why);
        for request in self.requests.take_all() {
            self.fail(&request, &Refusal::Closed(why));
        }
    }
}

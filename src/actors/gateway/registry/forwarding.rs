//! Services and actions of clients: calls and goals are forwarded to the client that serves them, and its answers go
//! back.
//!
//! **Invariant:** every forwarded call has one response, and every goal one `action_result`, unless its sender
//! disconnects first.

use std::collections::VecDeque;
use std::time::Duration;

use bytes::Bytes;
use tokio::time::Instant;

use super::clients::{Client, Clients, FrameOrigin};
use crate::actors::ConnectionId;
use crate::actors::graph::forwarded::{Forwarded, ForwardedRequests};
use crate::actors::graph::providers::{Provider, Providers};
use crate::actors::graph::refusal::{self, Refusal};
use crate::actors::resources::memory::{MAX_BACKLOG, cover_message};
use crate::protocol::messages::{self, Level};
use crate::protocol::names;
use crate::protocol::op::fields::mistyped;
use crate::protocol::op::{Arguments, GoalStatus, Problem, ProviderOp, Served};
use crate::protocol::wire::json::Payload;
use crate::services::NoService;

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

/// The names that clients serve, and the calls and goals that wait for these clients.
#[derive(Default)]
pub(super) struct Forwarding {
    pub(super) providers: Providers,
    requests: ForwardedRequests,
    /// Providers that have disconnected while calls or goals waited for them.
    gone: VecDeque<ConnectionId>,
    /// Calls end from this time on, after the process was stopped beyond a deadline.
    sockets_read: Option<Instant>,
}

impl Forwarding {
    // ---- ops of clients that serve ----------------------------------------------------------------------------------

    /// Performs an op of a client that serves `name`.
    pub(super) fn perform(
        &mut self,
        clients: &mut Clients,
        origin: &FrameOrigin,
        kind: Served,
        name: &str,
        op: ProviderOp,
    ) -> Result<(), Refusal> {
        match op {
            ProviderOp::Advertise { type_name } => {
                self.serve(clients, origin, kind, name, type_name.as_deref())
            }
            ProviderOp::Unadvertise => self.stop_serving(clients, origin, kind, name),
            ProviderOp::Feedback { values } => self.pass_feedback(clients, origin, name, &values),
            ProviderOp::End {
                values,
                status,
                result,
            } => self.complete(clients, origin, kind, name, |name, id| {
                messages::action_result(name, id, &values, status, result)
            }),
            ProviderOp::Respond {
                values,
                result,
                status,
            } => {
                let status = status.unwrap_or_default();
                self.complete(clients, origin, kind, name, |name, id| {
                    messages::response(name, id, &values, result, &status)
                })
            }
        }
    }

    /// Makes a client the provider of a service, or the server of an action.
    fn serve(
        &mut self,
        clients: &mut Clients,
        origin: &FrameOrigin,
        kind: Served,
        spelling: &str,
        type_name: Option<&str>,
    ) -> Result<(), Refusal> {
        refusal::check_served(kind, spelling)?;
        let name = &*names::absolute(spelling);
        let Some(client) = clients.get_mut(origin.from) else {
            return Ok(());
        };
        let bytes = spelling.len() + type_name.map_or(0, str::len);
        let (key, served) = ((kind, name.into()), &mut client.registered.served);
        let entry = client.entries.enter(bytes, served.get(&key))?;
        served.insert(key, entry);
        let provider = Provider::new(origin.from, spelling, type_name);
        let before = self.providers.provide(kind, name, provider);
        if let Some(before) = before.filter(|one| *one != origin.from)
            && let Some(before) = clients.get_mut(before)
        {
            before.registered.served.remove(&(kind, name.into()));
        }
        let msg = format!("advertised {} {spelling}", kind.noun());
        clients.send_status(origin, Level::Info, &msg);
        Ok(())
    }

    /// Withdraws a name. The client still answers its pending calls and goals.
    fn stop_serving(
        &mut self,
        clients: &mut Clients,
        origin: &FrameOrigin,
        kind: Served,
        spelling: &str,
    ) -> Result<(), Refusal> {
        let name = &*names::absolute(spelling);
        if !self.providers.withdraw(kind, name, origin.from) {
            return Err(Refusal::NotServed(kind, spelling.to_owned()));
        }
        if let Some(client) = clients.get_mut(origin.from) {
            client.registered.served.remove(&(kind, name.into()));
        }
        Ok(())
    }

    /// Sends the provider's answer to the caller, under the caller's own id.
    fn complete(
        &mut self,
        clients: &Clients,
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
            let why = Refusal::OfAnother(kind, request.name.to_string());
            return discard(clients, &request, why);
        }
        let Some(caller) = clients.get(request.caller) else {
            return Ok(());
        };
        let name = || request.name.to_string();
        if caller.is_congested() {
            fail(clients, &request, &Refusal::CallerBusy(name()));
            return Ok(());
        }
        let answer = encode(&request.name, request.id.as_ref());
        if !caller.may_wait(answer.len()) {
            fail(clients, &request, &Refusal::CallerFull(name()));
            return Ok(());
        }
        caller.send_long(clients.covered(answer));
        Ok(())
    }

    /// Ends the call or goal that got a bad answer, if there is one.
    pub(super) fn fail_answered(
        &mut self,
        clients: &Clients,
        origin: &FrameOrigin,
        kind: Served,
        name: Option<&str>,
        problem: Problem,
    ) -> Result<(), Refusal> {
        let why = Refusal::Unreadable(problem);
        let (requests, id) = (&mut self.requests, origin.id.as_ref());
        match requests.take_answered(kind, id, name, origin.from) {
            Some(request) => discard(clients, &request, why),
            None => Err(why),
        }
    }

    /// Sends feedback to the sender of the goal, if it requested feedback. A slow client may miss some.
    fn pass_feedback(
        &self,
        clients: &Clients,
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
        let sender = clients.get(goal.caller);
        if let Some(sender) = sender.filter(|_| goal.wants_feedback) {
            let frame = messages::action_feedback(&goal.name, goal.id.as_ref(), values);
            sender.deliver_feedback(cover_message(clients.permit.as_ref(), frame));
        }
        Ok(())
    }

    // ---- calls and goals of others ----------------------------------------------------------------------------------

    /// Forwards a call or a goal to its provider. `encode` makes the frame, with the provider's spelling of the name
    /// and an id of the runtime's own.
    pub(super) fn forward(
        &mut self,
        clients: &Clients,
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
        let server = clients.get(provider.connection);
        if server.is_some_and(Client::is_congested) {
            return Err(Refusal::ProviderBusy(name.to_owned()));
        }
        if server.is_some_and(|server| !server.may_wait(args.get().len())) {
            return Err(Refusal::ProviderFull(name.to_owned()));
        }
        let Some(caller) = clients.get(origin.from) else {
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
            server.send_long(clients.covered(encode(&provider.spelling, &known_as)));
        }
        Ok(())
    }

    /// Forwards the cancellation of a goal to its action server.
    pub(super) fn cancel_goal(
        &self,
        clients: &Clients,
        origin: &FrameOrigin,
        action: &str,
    ) -> Result<(), Refusal> {
        let requests = &self.requests;
        let goal = requests.newest_goal(origin.id.as_ref(), action, origin.from);
        let Some((id, goal)) = goal else {
            let name = names::absolute(action);
            return Err(match self.providers.provider(Served::Action, &name) {
                Some(_) => Refusal::NoGoal(action.to_owned()),
                None => Refusal::NoAction(action.to_owned()),
            });
        };
        if let (Some(server), Some(spelling)) = (clients.get(goal.provider), &goal.spelling) {
            if server.is_congested() {
                return Err(Refusal::ProviderBusy(action.to_owned()));
            }
            server.send(messages::cancellation(spelling, &id));
        }
        Ok(())
    }

    /// Forwards the cancellation of all goals of an action, as far as its server reads. If goals remain, the caller
    /// gets a refusal and may call again.
    pub(super) fn cancel_all_goals(
        &mut self,
        clients: &Clients,
        action: &str,
    ) -> Result<(), Refusal> {
        let provider = self
            .providers
            .provider(Served::Action, &names::absolute(action));
        let server = provider.and_then(|one| Some((one, clients.get(one.connection)?)));
        let Some((provider, server)) = server else {
            return Err(Refusal::NoAction(action.to_owned()));
        };
        let spelling = &*provider.spelling;
        let length = messages::cancellation(spelling, &names::own_id(u64::MAX)).len();
        let most = MAX_BACKLOG.saturating_sub(server.backlog()) / length;
        let (ids, is_rest) = self.requests.cancel_all(action, provider.connection, most);
        for id in &ids {
            server.send(messages::cancellation(spelling, id));
        }
        if is_rest {
            return Err(Refusal::ProviderBusy(action.to_owned()));
        }
        Ok(())
    }

    // ---- the end of requests without an answer ----------------------------------------------------------------------

    /// A provider serves nothing more. The cleanup ends the calls and goals that wait for its answer, because there may
    /// be many.
    pub(super) fn note_gone(&mut self, provider: ConnectionId) {
        if self.requests.waiting_for(provider).is_some() {
            self.gone.push_back(provider);
        }
    }

    /// Removes the requests of a client that has disconnected.
    pub(super) fn forget_caller(&mut self, caller: ConnectionId) {
        self.requests.forget_caller(caller);
    }

    /// Ends all requests for this reason.
    pub(super) fn close(&mut self, clients: &Clients, why: &'static str) {
        for request in self.requests.take_all() {
            fail(clients, &request, &Refusal::Closed(why));
        }
    }

    /// Whether requests of disconnected providers are to end now.
    pub(super) fn has_gone_providers(&self) -> bool {
        !self.gone.is_empty()
    }

    /// When the next call ends. If its deadline passed long ago, the process was stopped, and an answer may wait in a
    /// socket. So the sockets are read first.
    pub(super) fn next_end(&mut self, now: Instant) -> Option<Instant> {
        let deadline = self.requests.next_deadline();
        let was_stopped = deadline.is_some_and(|deadline| deadline + STOPPED < now);
        self.sockets_read = match was_stopped {
            true => self.sockets_read.or(Some(now + READ_SOCKETS)),
            false => None,
        };
        deadline.max(self.sockets_read)
    }

    /// Ends one batch: first calls past their deadlines, then requests of disconnected providers.
    pub(super) fn end_batch(&mut self, clients: &Clients, now: Instant) {
        for _ in 0..ENDED_IN_A_ROW {
            if let Some(call) = self.requests.take_due(now) {
                fail(clients, &call, &Refusal::TimedOut(call.name.to_string()));
                continue;
            }
            let Some(provider) = self.gone.front() else {
                return;
            };
            let waiting = self.requests.waiting_for(*provider);
            if let Some(request) = waiting.and_then(|number| self.requests.take(number)) {
                let why = Refusal::ProviderGone(request.name.to_string());
                fail(clients, &request, &why);
            } else {
                self.gone.pop_front();
            }
        }
    }
}

/// Discards an answer. The caller and the provider get the reason.
fn discard(clients: &Clients, request: &Forwarded, why: Refusal) -> Result<(), Refusal> {
    let name = request.name.to_string();
    let reason = Refusal::BadAnswer(name, Box::new(why.clone()));
    fail(clients, request, &reason);
    Err(why)
}

/// Ends a request without an answer. The caller gets the reason.
fn fail(clients: &Clients, request: &Forwarded, why: &Refusal) {
    let origin = FrameOrigin {
        from: request.caller,
        id: request.id.clone(),
    };
    match request.kind {
        Served::Service => clients.refuse_call(&origin, &request.name, why, None),
        Served::Action => clients.end_goal(&origin, &request.name, why, GoalStatus::Aborted),
    }
}

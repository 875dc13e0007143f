//! Routes calls and goals to the node or client that serves them, and clients' answers back to the callers.
//!
//! **Invariant:** every call has one response. Every goal has one `action_result`, unless its sender disconnects first.

use std::sync::Arc;

use actix::prelude::*;
use bytes::Bytes;
use tokio::time::Instant;

use super::forwarded::{Forwarded, RequestTerms};
use super::refusal::Refusal;
use super::{FrameOrigin, Registry};
use crate::actors::gateway::limits::{DEFAULT_TIMEOUT, MAX_BACKLOG};
use crate::actors::gateway::messages::{Handled, Tapped};
use crate::actors::node::guard;
use crate::actors::resources::memory::cover_message;
use crate::actors::wire::action_client::{
    ActionClient, ActionRequest, CancelSent, ForwardGoal, SentGoal,
};
use crate::actors::wire::{Caller, Route, ServiceCall};
use crate::protocol::catalog::{Action, Service};
use crate::protocol::messages::{self, Level};
use crate::protocol::names;
use crate::protocol::op::{ActionGoal, Arguments, CallService, GoalStatus, Problem, Served};
use crate::protocol::wire::json::Payload;
use crate::services::{Address, NoService};

// ---- to the runtime's own nodes -------------------------------------------------------------------------------------

impl Registry {
    /// Sends a call to the node or the client that serves it. A failure is the call's one response.
    pub(super) fn call(
        &mut self,
        origin: FrameOrigin,
        call: CallService,
        ctx: &mut Context<Self>,
    ) -> Handled {
        let Some(client) = self.clients.get(&origin.from) else {
            return Handled::at_once();
        };
        let refusal = if let Some(why) = self.closed {
            Err(Refusal::Closed(why))
        } else if let Some(service) = Service::from_name(&call.service) {
            match self.nodes.services.get(&service) {
                Some(node) => {
                    if let Some(tap) = &mut self.tap {
                        tap(Tapped::Called {
                            from: origin.from,
                            service,
                            id: origin.id.as_ref(),
                            args: &call.args,
                        });
                    }
                    let address = Address::new(service, call.service.into_boxed_str(), origin.id)
                        .with_errors(client.outlets.error_form());
                    let (caller, ended) = Caller::new(
                        ctx.address().recipient(),
                        origin.from,
                        address,
                        Arc::clone(&client.outlets.gone),
                        self.gauges.memory().clone(),
                        self.permit.clone(),
                    );
                    node(ServiceCall {
                        service,
                        arguments: call.args,
                        caller,
                    });
                    return Handled::with(ended);
                }
                None => Err(NoService::NotServed(call.service.clone()).into()),
            }
        } else {
            let deadline = Instant::now() + call.timeout.unwrap_or(DEFAULT_TIMEOUT);
            let terms = |_: &str| RequestTerms::Call { deadline };
            let encode = |spelling: &str, id: &str| messages::call(spelling, id, &call.args);
            self.forward(
                &origin,
                Served::Service,
                (&call.service, &call.args),
                terms,
                encode,
            )
        };
        self.schedule_cleanup(ctx);
        if let Err(why) = refusal {
            self.refuse_call(&origin, &call.service, &why);
        }
        Handled::at_once()
    }

    /// Sends a goal to the node, or the client, that serves its action.
    pub(super) fn send_action_goal(
        &mut self,
        origin: FrameOrigin,
        goal: ActionGoal,
        ctx: &mut Context<Self>,
    ) -> Handled {
        let route = if let Some(why) = self.closed {
            Err(Refusal::Closed(why))
        } else if Action::from_name(&goal.action).is_some() {
            self.action_route(&goal)
        } else {
            let terms = |spelling: &str| RequestTerms::Goal {
                spelling: spelling.into(),
                wants_feedback: goal.feedback,
            };
            let type_name = goal.type_name.as_deref();
            let args = &goal.args;
            let encode = |spelling: &str, id: &str| {
                messages::action_goal(spelling, id, type_name, args, goal.feedback)
            };
            match self.forward(
                &origin,
                Served::Action,
                (&goal.action, &goal.args),
                terms,
                encode,
            ) {
                Ok(()) => return Handled::at_once(),
                Err(why) => Err(why),
            }
        };
        let Some(client) = self.clients.get(&origin.from) else {
            return Handled::at_once();
        };
        let action_client = ActionClient {
            respond: ctx.address().recipient(),
            connection: origin.from,
            action: Arc::from(goal.action.as_str()),
            id: origin.id,
            wants_feedback: goal.feedback,
            gone: Arc::clone(&client.outlets.gone),
        };
        match route {
            Ok(node) => {
                let (done, ended) = guard();
                node(ActionRequest::Goal(ForwardGoal {
                    goal: goal.args,
                    client: action_client,
                    done,
                }));
                Handled::with(ended)
            }
            Err(why) => {
                action_client.refuse(&why.to_string());
                Handled::at_once()
            }
        }
    }

    fn action_route(&self, goal: &ActionGoal) -> Result<&Route<ActionRequest>, Refusal> {
        let unknown = || Refusal::NoAction(goal.action.clone());
        let action = Action::from_name(&goal.action).ok_or_else(unknown)?;
        match &goal.type_name {
            Some(name) if !names::same_type(name, action.type_name()) => {
                Err(Refusal::ActionType(action.type_name()))
            }
            _ => self.nodes.actions.get(&action).ok_or_else(unknown),
        }
    }

    /// Cancels a goal of the same client.
    pub(super) fn cancel_action_goal(
        &mut self,
        origin: FrameOrigin,
        action: &str,
        ctx: &mut Context<Self>,
    ) -> Handled {
        let node = Action::from_name(action).and_then(|action| self.nodes.actions.get(&action));
        let Some(node) = node else {
            if let Err(why) = self.forward_cancellation(&origin, action) {
                self.refuse(&origin, &why);
            }
            return Handled::at_once();
        };
        let (done, ended) = guard();
        node(ActionRequest::Cancel(CancelSent {
            goal: SentGoal {
                connection: origin.from,
                id: origin.id,
            },
            respond: ctx.address().recipient(),
            done,
        }));
        Handled::with(ended)
    }
}

// ---- to clients that serve ------------------------------------------------------------------------------------------

impl Registry {
    /// Makes a client the provider of a service, or the server of an action.
    pub(super) fn serve(
        &mut self,
        origin: &FrameOrigin,
        kind: Served,
        spelling: &str,
        type_name: Option<&str>,
    ) -> Result<(), Refusal> {
        let is_own = match kind {
            Served::Service => Service::from_name(spelling).is_some(),
            Served::Action => Action::from_name(spelling).is_some(),
        };
        if is_own {
            return Err(Refusal::OfRuntime(kind, spelling.to_owned()));
        }
        let name = &*names::absolute(spelling);
        let Some(client) = self.clients.get_mut(&origin.from) else {
            return Ok(());
        };
        let bytes = spelling.len() + type_name.map_or(0, str::len);
        let (key, served) = ((kind, name.into()), &mut client.registered.served);
        let entry = client.kept.enter(bytes, served.get(&key))?;
        served.insert(key, entry);
        let provider = (origin.from, spelling);
        let before = self.directory.provide(kind, name, provider, type_name);
        if let Some(before) = before.filter(|one| *one != origin.from)
            && let Some(before) = self.clients.get_mut(&before)
        {
            before.registered.served.remove(&(kind, name.into()));
        }
        let msg = format!("advertised {} {spelling}", kind.noun());
        self.send_status(origin.from, Level::Info, &msg, origin.id.as_ref());
        Ok(())
    }

    /// Withdraws a name. The client still answers its pending calls and goals.
    pub(super) fn stop_serving(
        &mut self,
        origin: &FrameOrigin,
        kind: Served,
        spelling: &str,
    ) -> Result<(), Refusal> {
        let name = &*names::absolute(spelling);
        if !self.directory.withdraw(kind, name, origin.from) {
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
        terms: impl FnOnce(&str) -> RequestTerms,
        encode: impl FnOnce(&str, &str) -> Bytes,
    ) -> Result<(), Refusal> {
        let absolute = &*names::absolute(name);
        let Some(provider) = self.directory.provider(kind, absolute).cloned() else {
            return Err(match kind {
                Served::Service => NoService::NoProvider(name.to_owned()).into(),
                Served::Action => Refusal::NoAction(name.to_owned()),
            });
        };
        if !args.get().starts_with(['{', '[']) {
            return Err(Refusal::BadArguments);
        }
        let server = self.clients.get(&provider.connection);
        if server.is_some_and(|server| server.backlog() > MAX_BACKLOG) {
            return Err(Refusal::ProviderBusy(name.to_owned()));
        }
        let Some(caller) = self.clients.get(&origin.from) else {
            return Ok(());
        };
        let terms = terms(&provider.spelling);
        let spelling = match &terms {
            RequestTerms::Call { .. } => 0,
            RequestTerms::Goal { spelling, .. } => spelling.len(),
        };
        let id = origin.id.as_ref().map_or(0, Payload::allocated);
        let entry = caller.kept.enter(id + name.len() + spelling, None)?;
        let known_as = self.requests.add(Forwarded {
            caller: origin.from,
            id: origin.id.clone(),
            provider: provider.connection,
            name: name.into(),
            terms,
            _entry: entry,
        });
        if let Some(client) = self.clients.get(&provider.connection) {
            client.send(self.covered(encode(&provider.spelling, &known_as)));
        }
        Ok(())
    }

    /// Forwards the cancellation of a goal to its action server.
    fn forward_cancellation(&self, origin: &FrameOrigin, action: &str) -> Result<(), Refusal> {
        let requests = &self.requests;
        let goal = requests.goal_made_under(origin.id.as_ref(), action, origin.from);
        let Some((id, goal)) = goal else {
            let name = names::absolute(action);
            return Err(match self.directory.provider(Served::Action, &name) {
                Some(_) => Refusal::NoGoal(action.to_owned()),
                None => Refusal::NoAction(action.to_owned()),
            });
        };
        if let (Some(server), RequestTerms::Goal { spelling, .. }) =
            (self.clients.get(&goal.provider), &goal.terms)
        {
            if server.backlog() > MAX_BACKLOG {
                return Err(Refusal::ProviderBusy(action.to_owned()));
            }
            server.send(messages::cancellation(spelling, &id));
        }
        Ok(())
    }

    /// Sends feedback to the sender of the goal, if it requested feedback. A slow client may miss some.
    pub(super) fn pass_feedback(
        &self,
        origin: &FrameOrigin,
        action: &str,
        values: &Payload,
    ) -> Result<(), Refusal> {
        let requests = &self.requests;
        let meant = requests.meant(Served::Action, origin.id.as_ref(), None, origin.from);
        let goal = meant.and_then(|number| requests.get(number));
        let goal = goal.ok_or_else(|| Refusal::StaleGoal(action.to_owned()))?;
        if !names::are_same(&goal.name, action) {
            return Err(Refusal::OfAnother(Served::Action, goal.name.to_string()));
        }
        let is_wanted =
            matches!(goal.terms, RequestTerms::Goal { wants_feedback, .. } if wants_feedback);
        if let Some(sender) = self.clients.get(&goal.caller).filter(|_| is_wanted) {
            let frame = messages::action_feedback(&goal.name, goal.id.as_ref(), values);
            sender.deliver_feedback(cover_message(self.permit.as_ref(), frame));
        }
        Ok(())
    }

    /// Sends the provider's answer to the caller, under the caller's own id.
    pub(super) fn complete(
        &mut self,
        origin: &FrameOrigin,
        kind: Served,
        name: &str,
        encode: impl FnOnce(&str, Option<&Payload>) -> Bytes,
    ) -> Result<(), Refusal> {
        let request = self.take_answered(origin, kind, None);
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
        if caller.backlog() > MAX_BACKLOG {
            self.fail(&request, &Refusal::CallerBusy(request.name.to_string()));
            return Ok(());
        }
        caller.send(self.covered(encode(&request.name, request.id.as_ref())));
        self.note_answered(&request);
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
        match self.take_answered(origin, kind, name) {
            Some(request) => self.discard(&request, why),
            None => Err(why),
        }
    }

    fn take_answered(
        &mut self,
        origin: &FrameOrigin,
        kind: Served,
        name: Option<&str>,
    ) -> Option<Forwarded> {
        let requests = &mut self.requests;
        let number = requests.meant(kind, origin.id.as_ref(), name, origin.from)?;
        requests.take(number)
    }

    /// Discards an answer. The caller and the provider get the reason.
    fn discard(&mut self, request: &Forwarded, why: Refusal) -> Result<(), Refusal> {
        let name = request.name.to_string();
        self.fail(request, &Refusal::BadAnswer(name, Box::new(why.clone())));
        Err(why)
    }

    /// Ends a request without an answer. The caller gets the reason.
    pub(super) fn fail(&mut self, request: &Forwarded, why: &Refusal) {
        let Forwarded {
            caller, id, name, ..
        } = request;
        match request.terms {
            RequestTerms::Call { .. } => {
                let origin = FrameOrigin {
                    from: *caller,
                    id: id.clone(),
                };
                self.refuse_call(&origin, name, why);
            }
            RequestTerms::Goal { .. } => {
                if let Some(sender) = self.clients.get(caller) {
                    let (id, why) = (id.as_ref(), why.to_string());
                    let status = GoalStatus::Aborted as u8;
                    sender.send(messages::action_result(name, id, &why, status, false));
                }
            }
        }
        self.note_answered(request);
    }

    /// After the caller's last call, a caller that has stopped sending may be disconnected.
    fn note_answered(&mut self, request: &Forwarded) {
        if !self.requests.has_waiting(request.caller)
            && let Some(client) = self.clients.get_mut(&request.caller)
        {
            client.answered = None;
        }
    }

    /// Answers a call with `result: false` and the reason.
    fn refuse_call(&self, origin: &FrameOrigin, service: &str, why: &Refusal) {
        if let Some(client) = self.clients.get(&origin.from) {
            let (id, form) = (origin.id.as_ref(), client.outlets.error_form());
            let frame = messages::failure(service, id, &why.to_string(), form);
            client.respond(frame, Service::from_name(service));
        }
    }
}

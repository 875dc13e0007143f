//! The registry has every client, topic and service. It fans messages out to subscribers, and routes calls.
//!
//! This file has the path of an op: to a node of the runtime, or to the value with its subject. `clients.rs` has the
//! clients and the frames to them, `broker.rs` topics, `forwarding.rs` the services and actions of clients, and
//! `actors/graph/` the tables.
//!
//! **Invariant:** a message is encoded once for each spelling and form, and not at all without subscribers. A
//! refused op changes nothing. It gets an error status, or the call's one response. Messages of one sender take effect
//! in the order sent: the registry has one mailbox, and so has each connection.

mod broker;
mod clients;
mod forwarding;
mod messages;

use std::pin::Pin;
use std::sync::Arc;
use std::task::{self, Poll, ready};

use actix::prelude::*;
use serde_json::json;
use tokio::time::Instant;

use self::broker::Broker;
use self::clients::{Clients, FrameOrigin};
use self::forwarding::{Forwarding, ToForward};
pub use self::messages::{
    Connect, CountRefusal, Disconnect, HeldPlace, Outlets, Request, Retire, ToClient,
};
use super::limits::DEFAULT_TIMEOUT;
use crate::actors::ConnectionId;
use crate::actors::graph::forms::ToEncode;
use crate::actors::graph::refusal::{self, Refusal};
use crate::actors::node::{
    ActionClient, ActionRequest, Barrier, Caller, CancelSent, Completion, ForwardGoal, FrameKind,
    Publish, Respond, Route, ServiceCall, TakeCensus, TopicMessage, Working,
};
pub use crate::actors::node::{Attach, FinishAll, Nodes, RefuseCalls, SetTap, Tapped};
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::long_work::{WorkKind, run_long_work};
use crate::actors::resources::places::{Places, Refused};
use crate::actors::resources::turns::{Timer, end_turn};
use crate::protocol::catalog::{Action, Service};
use crate::protocol::messages as frames;
use crate::protocol::names;
use crate::protocol::op::{ActionGoal, CallService, GoalStatus, Incoming, Op, Served};
use crate::protocol::wire::json::Payload;
use crate::services::{Address, NoService};

// ---- state ----------------------------------------------------------------------------------------------------------

/// The registry actor.
#[derive(Default)]
pub struct Registry {
    clients: Clients,
    broker: Broker,
    forwarding: Forwarding,
    /// The runtime's own nodes.
    nodes: Nodes,
    /// The reason why calls are rejected, once the runtime is ending.
    closed: Option<&'static str>,
}

impl Registry {
    /// A registry without nodes. [`Attach`] adds them.
    #[must_use]
    pub fn new(gauges: Arc<Gauges>) -> Self {
        let mut registry = Self::default();
        registry.clients.gauges = Arc::clone(&gauges);
        registry.broker.gauges = gauges;
        registry
    }

    /// A registry without nodes, for at most `clients` clients at once.
    #[must_use]
    pub fn serving_at_most(mut self, clients: usize) -> Self {
        self.clients.places = Places::of(clients);
        self
    }

    /// Performs one op of a registered client.
    fn perform(&mut self, origin: FrameOrigin, op: Op, ctx: &mut Context<Self>) -> Completion {
        let clients = &mut self.clients;
        let refusal = match op {
            Op::Publish { topic, msg } => return self.publish(origin, &topic, msg, ctx),
            Op::PublishLines(lines) => {
                let long = self.broker.publish_lines(clients, origin.from, &lines);
                return self.finish_delivery(long, ctx);
            }
            Op::CallService(call) => return self.call(origin, call),
            Op::SendActionGoal(goal) => return self.send_action_goal(origin, goal),
            Op::CancelActionGoal { action } => return self.cancel_action_goal(&origin, &action),
            Op::Advertise { topic, type_name } => {
                let type_name = type_name.as_deref();
                self.broker.advertise(clients, &origin, &topic, type_name)
            }
            Op::Unadvertise { topic } => {
                self.broker.unadvertise(clients, &origin, &topic);
                Ok(())
            }
            Op::Subscribe(subscribe) => self.broker.subscribe(clients, &origin, &subscribe),
            Op::Unsubscribe { topic } => {
                self.broker.unsubscribe(clients, &origin, &topic);
                Ok(())
            }
            Op::SetLevel { verbosity, errors } => {
                if let Some(client) = clients.get_mut(origin.from) {
                    client.verbosity = verbosity;
                    client.error_form = errors.unwrap_or(client.error_form);
                }
                Ok(())
            }
            Op::Serve { kind, name, op } => {
                let forwarding = &mut self.forwarding;
                forwarding.perform(clients, &origin, kind, &name, op)
            }
            Op::BadAnswer {
                kind,
                name,
                problem,
            } => {
                let (name, forwarding) = (name.as_deref(), &mut self.forwarding);
                forwarding.fail_answered(clients, &origin, kind, name, problem)
            }
            // The connection has already joined the pieces and checked the token. If no token is required, any token is
            // accepted.
            Op::Fragment(_) | Op::Auth { .. } => Ok(()),
        };
        if let Err(why) = refusal {
            self.clients.refuse(&origin, &why);
        }
        Completion::at_once()
    }

    // ---- messages ---------------------------------------------------------------------------------------------------

    /// Delivers a client's message to the topic's subscribers, and to the runtime's own subscriber if there is one.
    fn publish(
        &mut self,
        origin: FrameOrigin,
        topic: &str,
        msg: Payload,
        ctx: &mut Context<Self>,
    ) -> Completion {
        let own = match refusal::check_published(topic) {
            Ok(own) => own,
            Err(why) => {
                self.clients.refuse(&origin, &why);
                return Completion::at_once();
            }
        };
        let topic = &*names::absolute(topic);
        let Some(client) = self.clients.get(origin.from) else {
            return Completion::at_once();
        };
        let node = own
            .filter(|topic| !client.withdrawn.contains(topic))
            .and_then(|topic| Some((topic, self.nodes.subscribers.get(&topic)?)));
        if node.is_none() && !client.registered.advertised.contains_key(topic) {
            return Completion::at_once();
        }
        let encode = |spelling: &str| frames::publish_raw(spelling, &msg);
        let permit = self.clients.permit.as_ref();
        let long = self.broker.fan_out(topic, permit, encode);
        let Some((topic, node)) = node else {
            return self.finish_delivery(long, ctx);
        };
        let (working, completion) = Completion::pending();
        self.encode_on_worker(long, &working, ctx);
        let frame = || frames::publish_raw(topic.name(), &msg);
        self.broker
            .show_tap(|tap| tap(Tapped::Published(topic, &frame())));
        node(TopicMessage {
            msg,
            link: client.link.clone(),
            listening: Arc::downgrade(&client.listening),
            id: origin.id,
            working,
        });
        completion
    }

    /// Ends the delivery of a client's message. The client waits for the encoding of a long one.
    fn finish_delivery(&self, long: Vec<ToEncode>, ctx: &mut Context<Self>) -> Completion {
        if long.is_empty() {
            return Completion::at_once();
        }
        let (working, completion) = Completion::pending();
        self.encode_on_worker(long, &working, ctx);
        completion
    }

    /// Encodes long messages on worker threads, and delivers them. It delays only their publisher.
    fn encode_on_worker(&self, long: Vec<ToEncode>, working: &Working, ctx: &mut Context<Self>) {
        for message in long {
            let working = working.clone();
            let kind = WorkKind::of(message.plain.len());
            let count = message.recipients.len() as u64;
            let making = run_long_work(kind, move || (message.make(), message));
            ctx.spawn(making.into_actor(self).map(move |made, registry, _| {
                match made {
                    Some((made, message)) => registry.broker.deliver_made(&message, &made),
                    None => registry.broker.gauges.add_dropped(count),
                }
                drop(working);
            }));
        }
    }

    // ---- calls ------------------------------------------------------------------------------------------------------

    /// Sends a call to the node or the client that serves it. A failure is the call's one response.
    fn call(&mut self, origin: FrameOrigin, call: CallService) -> Completion {
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
                let encode = |spelling: &str, id: &str| frames::call(spelling, id, &call.args);
                let forwarding = &mut self.forwarding;
                forwarding.forward(&self.clients, &origin, &to_forward, encode)
            }
        };
        if let Err(why) = refusal {
            let service = &call.service;
            self.clients.refuse_call(&origin, service, &why, own);
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
        let Some(client) = self.clients.get(origin.from) else {
            return Completion::at_once();
        };
        let Some(node) = self.nodes.services.get(&service) else {
            let why = NoService::NotServed(call.service.clone());
            let (name, own) = (&call.service, Some(service));
            self.clients.refuse_call(&origin, name, &why, own);
            return Completion::at_once();
        };
        self.broker.show_tap(|tap| {
            tap(Tapped::Called {
                from: origin.from,
                service,
                id: origin.id.as_ref(),
                args: &call.args,
            });
        });
        let address = Address::new(service, call.service.into_boxed_str(), origin.id)
            .with_errors(client.error_form);
        let memory = self.clients.gauges.memory().clone();
        let permit = self.clients.permit.clone();
        let (caller, completion) = Caller::new(client.link.clone(), address, memory, permit);
        node(ServiceCall {
            service,
            arguments: call.args,
            caller,
        });
        completion
    }

    // ---- goals ------------------------------------------------------------------------------------------------------

    /// Sends a goal to the node, or the client, that serves its action. A failure is the goal's one result.
    fn send_action_goal(&mut self, origin: FrameOrigin, goal: ActionGoal) -> Completion {
        let Some(client) = self.clients.get(origin.from) else {
            return Completion::at_once();
        };
        let refusal = match (self.closed, Action::from_name(&goal.action)) {
            (Some(why), _) => Err(Refusal::Closed(why)),
            (None, Some(action)) => match self.action_route(action, &goal) {
                Ok(node) => {
                    let (working, completion) = Completion::pending();
                    let client = ActionClient {
                        link: client.link.clone(),
                        action: Arc::from(goal.action),
                        id: origin.id,
                        wants_feedback: goal.feedback,
                    };
                    let goal = goal.args;
                    node(ActionRequest::Goal(ForwardGoal {
                        goal,
                        client,
                        working,
                    }));
                    return completion;
                }
                Err(why) => Err(why),
            },
            (None, None) => {
                let to_forward = ToForward {
                    kind: Served::Action,
                    name: &goal.action,
                    args: &goal.args,
                    deadline: None,
                    wants_feedback: goal.feedback,
                };
                let type_name = goal.type_name.as_deref();
                let encode = |spelling: &str, id: &str| {
                    frames::action_goal(spelling, id, type_name, &goal.args, goal.feedback)
                };
                let forwarding = &mut self.forwarding;
                forwarding.forward(&self.clients, &origin, &to_forward, encode)
            }
        };
        if let Err(why) = refusal {
            let status = GoalStatus::Unknown;
            self.clients.end_goal(&origin, &goal.action, &why, status);
        }
        Completion::at_once()
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
    fn cancel_action_goal(&self, origin: &FrameOrigin, action: &str) -> Completion {
        let at_node = self.cancel_at_node(origin, action, origin.id.clone(), false);
        at_node.unwrap_or_else(|| {
            let cancelled = self.forwarding.cancel_goal(&self.clients, origin, action);
            if let Err(why) = cancelled {
                self.clients.refuse(origin, &why);
            }
            Completion::at_once()
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
    ) -> Option<Completion> {
        let node = self.nodes.actions.get(&Action::from_name(action)?)?;
        let link = self.clients.get(origin.from)?.link.clone();
        let (working, completion) = Completion::pending();
        node(ActionRequest::Cancel(CancelSent {
            link,
            id,
            all,
            working,
        }));
        Some(completion)
    }

    /// The action whose goals a call of this service cancels, unless a client provides the service itself.
    fn action_to_cancel<'a>(&self, service: &'a str) -> Option<&'a str> {
        let action = names::cancelled_action(service)?;
        let has = |kind, name| {
            let providers = &self.forwarding.providers;
            providers.provider(kind, &names::absolute(name)).is_some()
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
    ) -> Result<Completion, Refusal> {
        let mut args = call.args.get().bytes();
        if !args.all(|byte| b"{}[] \t\r\n".contains(&byte)) {
            return Err(Refusal::OneGoal);
        }
        let handled = match self.cancel_at_node(origin, action, None, true) {
            Some(handled) => handled,
            None => {
                self.forwarding.cancel_all_goals(&self.clients, action)?;
                Completion::at_once()
            }
        };
        let values = json!({"return_code": 0, "goals_canceling": []});
        let id = origin.id.as_ref();
        let frame = frames::response(&call.service, id, &values, true, "");
        if let Some(client) = self.clients.get(origin.from) {
            client.send(self.clients.covered(frame));
        }
        Ok(handled)
    }

    // ---- the end of a client ----------------------------------------------------------------------------------------

    /// Withdraws a client's registrations.
    fn withdraw(&mut self, id: ConnectionId) {
        let Some(client) = self.clients.get_mut(id) else {
            return;
        };
        let registered = std::mem::take(&mut client.registered);
        for topic in registered.advertised.keys() {
            self.broker.topics.remove_publisher(topic);
        }
        for topic in &registered.subscribed {
            self.broker.drop_subscriber(&mut self.clients, topic, id);
        }
        for (kind, name) in registered.served.keys() {
            self.forwarding.providers.withdraw(*kind, name, id);
        }
        self.forwarding.note_gone(id);
    }
}

// ---- the actor ------------------------------------------------------------------------------------------------------

impl Actor for Registry {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Context<Self>) {
        ctx.spawn(Cleanup::default());
    }
}

/// Ends calls past their deadlines, and requests of disconnected providers, in batches. The actor polls it after each
/// message.
#[derive(Default)]
struct Cleanup(Timer);

impl ActorFuture<Registry> for Cleanup {
    type Output = ();

    fn poll(
        mut self: Pin<&mut Self>,
        registry: &mut Registry,
        _: &mut Context<Registry>,
        cx: &mut task::Context<'_>,
    ) -> Poll<()> {
        let forwarding = &mut registry.forwarding;
        if !forwarding.has_gone_providers() {
            let end = forwarding.next_end(Instant::now());
            ready!(self.0.poll(end, cx));
        }
        forwarding.end_batch(&registry.clients, Instant::now());
        end_turn(cx)
    }
}

// ---- messages of connections ----------------------------------------------------------------------------------------

impl Handler<Connect> for Registry {
    type Result = Result<HeldPlace, Refused>;

    fn handle(&mut self, connect: Connect, ctx: &mut Context<Self>) -> Self::Result {
        if self.closed.is_some() {
            return Err(Refused::Closed);
        }
        let registry = ctx.address();
        let id = self.clients.add(connect, registry.clone().recipient())?;
        let registry = registry.recipient();
        Ok(HeldPlace { id, registry })
    }
}

impl Handler<CountRefusal> for Registry {
    type Result = ();

    fn handle(&mut self, _: CountRefusal, _: &mut Context<Self>) {
        self.clients.count_refusal();
    }
}

impl Handler<Request> for Registry {
    type Result = Completion;

    fn handle(&mut self, request: Request, ctx: &mut Context<Self>) -> Completion {
        let Request { from, incoming, .. } = request;
        if self.clients.get(from).is_none() {
            return Completion::at_once();
        }
        let Incoming { id, op } = incoming;
        let origin = FrameOrigin { from, id };
        self.clients.permit = request.permit;
        let completion = match op {
            Ok(op) => self.perform(origin, op, ctx),
            Err(why) => {
                self.clients.answer_error(&origin, &why);
                Completion::at_once()
            }
        };
        let permit = self.clients.permit.take();
        if let Some(permit) = permit.filter(|_| completion.is_at_once()) {
            permit.trim();
        }
        completion
    }
}

impl Handler<Retire> for Registry {
    type Result = Completion;

    fn handle(&mut self, Retire(id): Retire, _: &mut Context<Self>) -> Completion {
        self.withdraw(id);
        let client = self.clients.get_mut(id);
        let calls = client.and_then(|client| client.calls.take());
        calls.map_or_else(Completion::at_once, |(_, all)| all)
    }
}

impl Handler<Disconnect> for Registry {
    type Result = ();

    fn handle(&mut self, Disconnect(id): Disconnect, _: &mut Context<Self>) {
        self.withdraw(id);
        self.forwarding.forget_caller(id);
        self.clients.remove(id);
    }
}

// ---- messages of nodes, of the recorder and of the runtime ----------------------------------------------------------

impl Handler<Publish> for Registry {
    type Result = ();

    fn handle(&mut self, message: Publish, _: &mut Context<Self>) {
        self.broker.publish(message);
    }
}

impl Handler<Respond> for Registry {
    type Result = ();

    fn handle(&mut self, respond: Respond, _: &mut Context<Self>) {
        let Some(client) = self.clients.get(respond.connection) else {
            return;
        };
        match respond.kind {
            FrameKind::Status(level) if !client.verbosity.wants(level) => {}
            FrameKind::Status(_) | FrameKind::End => client.send(respond.frame),
            FrameKind::Feedback => client.deliver_feedback(respond.frame),
            FrameKind::Answer(service) => {
                self.broker.show_tap(|tap| {
                    tap(Tapped::Answered {
                        to: respond.connection,
                        service,
                        frame: &respond.frame,
                    });
                });
                client.respond(respond.frame, Some(service));
            }
        }
    }
}

impl Handler<Barrier> for Registry {
    type Result = ();

    fn handle(&mut self, _: Barrier, _: &mut Context<Self>) {}
}

impl Handler<TakeCensus> for Registry {
    type Result = MessageResult<TakeCensus>;

    fn handle(&mut self, _: TakeCensus, _: &mut Context<Self>) -> Self::Result {
        let topics = self.broker.topics.listed();
        MessageResult(self.forwarding.providers.census(topics))
    }
}

impl Handler<SetTap> for Registry {
    type Result = ();

    fn handle(&mut self, SetTap(tap): SetTap, _: &mut Context<Self>) {
        self.broker.set_tap(tap);
    }
}

impl Handler<Attach> for Registry {
    type Result = ();

    fn handle(&mut self, Attach(mut nodes): Attach, _: &mut Context<Self>) {
        self.broker.owners = std::mem::take(&mut nodes.publishers);
        self.nodes = nodes;
    }
}

impl Handler<RefuseCalls> for Registry {
    type Result = ();

    fn handle(&mut self, RefuseCalls(why): RefuseCalls, _: &mut Context<Self>) {
        self.closed = Some(why);
        self.forwarding.close(&self.clients, why);
    }
}

impl Handler<FinishAll> for Registry {
    type Result = ();

    fn handle(&mut self, _: FinishAll, _: &mut Context<Self>) {
        self.clients.finish_all();
    }
}

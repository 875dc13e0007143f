//! An action of the arm in the graph: three services and two topics, as in ROS 2.
//!
//! **Invariant:** a goal is accepted or refused at once, before its feedback. Every caller that waits for its end is
//! answered, at the latest when the arm disconnects.

use std::rc::Rc;

use actix::prelude::*;
use pendularm::protocol::catalog::Action;
use pendularm::protocol::catalog::types;
use pendularm::protocol::catalog::types::Type;
use pendularm::protocol::messages::Stamp;
use pendularm::protocol::ros::cdr;
use serde_json::{Value, json};
use zenoh::Session;

use super::endpoints::Endpoints;
use super::gateway::Gateway;
use super::goals::{Goal, GoalId, GoalTable, now, read_stamp};
use super::inlet::{Inlet, Request};
use super::outlet::Outlet;
use super::{Cancel, ForwardGoal, GoalEvent, GoalUpdate, MAILBOX};
use crate::convention::EndpointKind;
use crate::convention::hash::type_hash;
use crate::interfaces::{ActionInterface, ServiceInterface, cancel_goal};
use crate::report;
use crate::translation;

/// The type of the topic with the states of goals.
const STATUS_TYPE: &str = "action_msgs/msg/GoalStatusArray";

/// An action in the graph.
pub struct ActionBridge {
    action: Action,
    interface: Rc<ActionInterface>,
    cancel_goal: ServiceInterface,
    status_type: Option<Type>,
    gateway: Addr<Gateway>,
    goals: GoalTable<Request>,
    feedback: Outlet,
    status: Outlet,
    _inlets: [Inlet; 3],
}

/// A request.
#[derive(Message)]
#[rtype(result = "()")]
struct Requested(Part, Request);

/// The requested service of an action.
#[derive(Debug, Clone, Copy)]
enum Part {
    SendGoal,
    GetResult,
    CancelGoal,
}

impl ActionBridge {
    /// Starts it.
    ///
    /// # Errors
    /// If Zenoh refuses.
    pub(super) fn join(
        session: &Session,
        action: Action,
        interface: Rc<ActionInterface>,
        endpoints: &mut Endpoints,
        gateway: Addr<Gateway>,
    ) -> zenoh::Result<Addr<Self>> {
        let mut context = Context::new();
        context.set_mailbox_capacity(MAILBOX);
        let address: Addr<Self> = context.address();
        let cancel_goal = cancel_goal();
        let status_type = types::find(STATUS_TYPE);
        let owner = action.owner();
        let name = |part: &str| format!("{}/_action/{part}", action.name());
        let mut inlet = |part, called: &str, of: &ServiceInterface| {
            let address = address.clone();
            let endpoint = endpoints.service(owner, &name(called), of);
            Inlet::new(session, endpoint, move |request| {
                let sent = address.try_send(Requested(part, request));
                sent.err().map(|error| error.into_inner().1)
            })
        };
        let inlets = [
            inlet(Part::SendGoal, "send_goal", &interface.send_goal)?,
            inlet(Part::GetResult, "get_result", &interface.get_result)?,
            inlet(Part::CancelGoal, "cancel_goal", &cancel_goal)?,
        ];
        let feedback = endpoints.next(
            owner,
            EndpointKind::Publisher,
            &name("feedback"),
            interface.feedback.name,
            &interface.feedback_hash,
        );
        let status_hash = status_type.map(|one| type_hash(one, &[]));
        let status = endpoints.next(
            owner,
            EndpointKind::LatchedPublisher,
            &name("status"),
            STATUS_TYPE,
            &status_hash.unwrap_or_default(),
        );
        Ok(context.run(Self {
            action,
            interface,
            cancel_goal,
            status_type,
            gateway,
            goals: GoalTable::default(),
            feedback: Outlet::new(session, feedback, false)?,
            status: Outlet::new(session, status, true)?,
            _inlets: inlets,
        }))
    }

    fn send_goal(&mut self, request: Request, mut read: Value, ctx: &mut Context<Self>) {
        let Some(id) = GoalId::read(&read) else {
            return request.refuse("no goal_id");
        };
        let mut goal = read.get_mut("goal").map(Value::take).unwrap_or_default();
        let goal = translation::arguments(self.action.goal_fields(), &mut goal);
        if let Err(request) = self.goals.begin(id, request) {
            // The id exists already, or there are too many goals.
            return self.tell_acceptance(request, false, now());
        }
        let forwarded = ForwardGoal {
            action: self.action,
            id: id.text(),
            goal,
            to: ctx.address().recipient(),
        };
        let sent = self.gateway.send(forwarded).into_actor(self);
        let sent = sent.map(move |sent, bridge, _| {
            let why = match sent {
                Ok(Ok(())) => return,
                Ok(Err(why)) => why,
                Err(error) => error.to_string(),
            };
            bridge.ended(id, 0, &Value::String(why));
        });
        ctx.spawn(sent);
    }

    fn tell_acceptance(&self, request: Request, is_accepted: bool, stamp: Stamp) {
        let response = json!({"accepted": is_accepted, "stamp": stamp});
        request.respond(&self.interface.send_goal, &response);
    }

    /// The arm has accepted a goal.
    fn accept(&mut self, id: GoalId) {
        let accepted = self.goals.accept(id);
        if let Some((request, stamp)) = accepted {
            self.tell_acceptance(request, true, stamp);
            self.publish_status();
        }
    }

    fn ended(&mut self, id: GoalId, status: i8, values: &Value) {
        if status == 0 {
            report::say(&format!("{}: refused: {values}", self.action.name()));
            if let Some(goal) = self.goals.remove(id) {
                self.never_accepted(goal);
            }
            return;
        }
        self.accept(id);
        let result = json!({"status": status, "result": values});
        for request in self.goals.end(id, status, result.clone()) {
            request.respond(&self.interface.get_result, &result);
        }
        self.publish_status();
    }

    fn never_accepted(&self, goal: Goal<Request>) {
        if let Some(request) = goal.asked {
            self.tell_acceptance(request, false, goal.stamp);
        }
        let unknown = json!({"status": 0});
        for request in goal.waiting {
            request.respond(&self.interface.get_result, &unknown);
        }
    }

    fn get_result(&mut self, request: Request, read: &Value) {
        let of = &self.interface.get_result;
        let unknown = json!({"status": 0});
        let Some(id) = GoalId::read(read) else {
            return request.refuse("no goal_id");
        };
        match self.goals.wait(id, request) {
            Ok(()) => {}
            Err((request, result)) => request.respond(of, result.unwrap_or(&unknown)),
        }
    }

    fn cancel(&mut self, request: Request, read: &Value) {
        let info = read.get("goal_info").unwrap_or(&Value::Null);
        let Some(id) = GoalId::read(info) else {
            return request.refuse("no goal_id");
        };
        let (code, cancelled) = self.goals.cancel(id, read_stamp(info));
        for id in &cancelled {
            self.gateway.do_send(Cancel {
                action: self.action,
                id: id.text(),
            });
        }
        let infos: Vec<Value> = cancelled.iter().map(|id| self.goals.info(*id)).collect();
        let response = json!({"return_code": code, "goals_canceling": infos});
        request.respond(&self.cancel_goal, &response);
        self.publish_status();
    }

    fn publish_status(&mut self) {
        if let Some(one) = self.status_type {
            self.status.put(cdr::encode(one, &self.goals.status()));
        }
    }
}

impl Actor for ActionBridge {
    type Context = Context<Self>;

    fn started(&mut self, _: &mut Self::Context) {
        // There is no goal yet. Publish this, so that new subscribers see it.
        self.publish_status();
    }

    fn stopped(&mut self, _: &mut Self::Context) {
        for request in self.goals.drain() {
            request.refuse("the arm has disconnected");
        }
    }
}

impl Handler<Requested> for ActionBridge {
    type Result = ();

    fn handle(&mut self, Requested(part, request): Requested, ctx: &mut Self::Context) {
        let of = match part {
            Part::SendGoal => &self.interface.send_goal,
            Part::GetResult => &self.interface.get_result,
            Part::CancelGoal => &self.cancel_goal,
        };
        match (request.read(of), part) {
            (Err(why), _) => request.refuse(&why),
            (Ok(read), Part::SendGoal) => self.send_goal(request, read, ctx),
            (Ok(read), Part::GetResult) => self.get_result(request, &read),
            (Ok(read), Part::CancelGoal) => self.cancel(request, &read),
        }
    }
}

impl Handler<GoalUpdate> for ActionBridge {
    type Result = ();

    fn handle(&mut self, GoalUpdate { id, what }: GoalUpdate, _: &mut Self::Context) {
        let Some(id) = GoalId::of_text(&id) else {
            return;
        };
        match what {
            GoalEvent::Accepted => self.accept(id),
            GoalEvent::Feedback(values) => {
                self.accept(id);
                let message = json!({"goal_id": id.json(), "feedback": values});
                let payload = cdr::encode(self.interface.feedback, &message);
                self.feedback.put(payload);
            }
            GoalEvent::End(status, values) => self.ended(id, status, &values),
        }
    }
}

stops_with_the_arm!(ActionBridge);

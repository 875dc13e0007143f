//! The arm's side: one rosbridge connection, with the subscribed topics and the waiting calls.
//!
//! **Invariant:** every call is answered, at the latest when the connection ends.

use std::collections::HashMap;
use std::time::Duration;

use actix::prelude::*;
use pendularm::protocol::catalog::{Rosapi, Service};
use serde_json::{Value, json};
use tokio::sync::{mpsc, oneshot};

use super::link::{self, Ended, FrameReceived};
use super::{
    Answer, ArmMessage, ArmPresence, CallArm, Cancel, ForwardGoal, GoalEvent, GoalUpdate, Listen,
    MAILBOX, PublishToArm,
};
use crate::report::{self, Repeated};

/// Pause between two tries to connect.
const RETRY: Duration = Duration::from_secs(1);
/// Most calls that wait for their answers.
const MAX_CALLS: usize = 1024;

/// The arm's side.
pub struct Gateway {
    address: String,
    token: Option<String>,
    graph: Recipient<ArmPresence>,
    /// The number of the connection, from 1.
    link: u64,
    outgoing: Option<mpsc::Sender<String>>,
    listeners: HashMap<&'static str, Recipient<ArmMessage>>,
    calls: HashMap<u64, oneshot::Sender<Result<Answer, String>>>,
    last_call: u64,
    goals: HashMap<String, Recipient<GoalUpdate>>,
    warning: Repeated,
}

impl Gateway {
    /// A gateway to the arm at that address. It informs the graph when the arm connects and disconnects.
    #[must_use]
    pub fn new(address: String, token: Option<String>, graph: Recipient<ArmPresence>) -> Self {
        Self {
            address,
            token,
            graph,
            link: 0,
            outgoing: None,
            listeners: HashMap::new(),
            calls: HashMap::new(),
            last_call: 0,
            goals: HashMap::new(),
            warning: Repeated::default(),
        }
    }

    fn connect(&mut self, ctx: &mut Context<Self>) {
        self.link += 1;
        let opening = link::open(
            self.link,
            self.address.clone(),
            self.token.clone(),
            ctx.address().recipient(),
            ctx.address().recipient(),
        );
        let opened = opening
            .into_actor(self)
            .map(|opened, gateway, ctx| match opened {
                Ok(outgoing) => {
                    gateway.outgoing = Some(outgoing);
                    gateway.warning.clear();
                    gateway.graph.do_send(ArmPresence::Here);
                }
                Err(why) => {
                    let line = format!("no arm at {} yet: {why}", gateway.address);
                    gateway.warning.say(line);
                    ctx.run_later(RETRY, Self::connect);
                }
            });
        ctx.spawn(opened);
    }

    /// Puts a frame into the queue. The error has the reason for a failure.
    fn write(&self, frame: &Value) -> Result<(), String> {
        let outgoing = self.outgoing.as_ref().ok_or("the arm is not connected")?;
        let sent = outgoing.try_send(format!("{frame}\n"));
        sent.map_err(|_| "the arm accepts nothing more".to_owned())
    }

    fn answered(&mut self, mut frame: Value) {
        let id = frame.get("id").and_then(Value::as_u64);
        let Some(waiting) = id.and_then(|id| self.calls.remove(&id)) else {
            return;
        };
        let answer = Answer {
            values: frame.get_mut("values").map(Value::take).unwrap_or_default(),
            is_success: frame.get("result") == Some(&Value::Bool(true)),
            status: text(&frame, "status").to_owned(),
        };
        // The caller may have ended meanwhile.
        let _ = waiting.send(Ok(answer));
    }

    /// Passes an event of a goal, made of the frame's status and values, to its sender.
    fn tell_of_goal(&mut self, mut frame: Value, event: impl FnOnce(i8, Value) -> GoalEvent) {
        let id = text(&frame, "id").to_owned();
        let Some(to) = self.goals.get(&id).cloned() else {
            return;
        };
        let values = frame.get_mut("values").map(Value::take).unwrap_or_default();
        let status = frame.get("status").and_then(Value::as_i64);
        let status = status.and_then(|status| i8::try_from(status).ok());
        let what = event(status.unwrap_or_default(), values);
        if let GoalEvent::End(..) = what {
            self.goals.remove(&id);
        }
        if to.try_send(GoalUpdate { id, what }).is_err() {
            report::say("feedback or result of a goal was dropped: its action is busy");
        }
    }
}

impl Actor for Gateway {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Self::Context) {
        ctx.set_mailbox_capacity(MAILBOX);
        self.connect(ctx);
    }
}

impl Handler<FrameReceived> for Gateway {
    type Result = ();

    fn handle(&mut self, FrameReceived { link, mut frame }: FrameReceived, _: &mut Self::Context) {
        if link != self.link {
            return;
        }
        match text(&frame, "op") {
            "publish" => {
                let listener = self.listeners.get(text(&frame, "topic"));
                let msg = frame.get_mut("msg").map(Value::take);
                if let (Some(listener), Some(msg)) = (listener, msg)
                    && listener.try_send(ArmMessage(msg)).is_err()
                {
                    report::say("a message of the arm's was dropped: its publisher is busy");
                }
            }
            "service_response" if text(&frame, "id").is_empty() => self.answered(frame),
            // The arm has sent the reason before this, if it has refused the goal.
            "service_response" => self.tell_of_goal(frame, |_, _| GoalEvent::Accepted),
            "action_feedback" => self.tell_of_goal(frame, |_, values| GoalEvent::Feedback(values)),
            "action_result" => self.tell_of_goal(frame, GoalEvent::End),
            "status" if matches!(text(&frame, "level"), "error" | "warning") => {
                report::say(&format!("the arm says: {}", text(&frame, "msg")));
            }
            _ => {}
        }
    }
}

impl Handler<Ended> for Gateway {
    type Result = ();

    fn handle(&mut self, Ended { link, why }: Ended, ctx: &mut Self::Context) {
        if link != self.link {
            return;
        }
        report::say(&format!("lost the arm at {}: {why}", self.address));
        self.outgoing = None;
        self.listeners.clear();
        // Dropping a call sends an error to its caller.
        self.calls.clear();
        self.goals.clear();
        self.graph.do_send(ArmPresence::Gone);
        ctx.run_later(RETRY, Self::connect);
    }
}

impl Handler<Listen> for Gateway {
    type Result = ();

    fn handle(&mut self, Listen { topic, to }: Listen, _: &mut Self::Context) {
        let op = match to {
            Some(to) => {
                self.listeners.insert(topic, to);
                "subscribe"
            }
            None => {
                self.listeners.remove(topic);
                "unsubscribe"
            }
        };
        // A new connection has no subscriptions, so the topics are subscribed again.
        let _ = self.write(&json!({"op": op, "topic": topic}));
    }
}

impl Handler<PublishToArm> for Gateway {
    type Result = ();

    fn handle(&mut self, PublishToArm { topic, msg }: PublishToArm, _: &mut Self::Context) {
        if let Err(why) = self.write(&json!({"op": "publish", "topic": topic, "msg": msg})) {
            report::say(&format!("{topic}: a message was dropped: {why}"));
        }
    }
}

impl Handler<ForwardGoal> for Gateway {
    type Result = Result<(), String>;

    fn handle(&mut self, forwarded: ForwardGoal, _: &mut Self::Context) -> Self::Result {
        let ForwardGoal {
            action,
            id,
            goal,
            to,
        } = forwarded;
        let (name, kind) = (action.name(), action.type_name());
        self.write(
            &json!({"op": "send_action_goal", "id": id, "action": name, "action_type": kind,
            "args": goal, "feedback": true}),
        )?;
        // A paused arm sends nothing about a goal. It answers this call after it has accepted or refused the goal.
        self.write(&json!({"op": "call_service", "id": id, "service": Service::Rosapi(Rosapi::GetTime).name()}))?;
        self.goals.insert(id, to);
        Ok(())
    }
}

impl Handler<Cancel> for Gateway {
    type Result = ();

    fn handle(&mut self, Cancel { action, id }: Cancel, _: &mut Self::Context) {
        let name = action.name();
        // If the arm has disconnected, the goal has ended.
        let _ = self.write(&json!({"op": "cancel_action_goal", "id": id, "action": name}));
    }
}

impl Handler<CallArm> for Gateway {
    type Result = ResponseFuture<Result<Answer, String>>;

    fn handle(
        &mut self,
        CallArm { service, args }: CallArm,
        _: &mut Self::Context,
    ) -> Self::Result {
        self.last_call += 1;
        let id = self.last_call;
        let call = json!({"op": "call_service", "id": id, "service": service, "args": args});
        let written = if self.calls.len() < MAX_CALLS {
            self.write(&call)
        } else {
            Err("too many calls wait".to_owned())
        };
        let (sender, receiver) = oneshot::channel();
        if written.is_ok() {
            self.calls.insert(id, sender);
        }
        Box::pin(async move {
            written?;
            let answer = receiver.await;
            answer.unwrap_or_else(|_| Err("the arm has disconnected".to_owned()))
        })
    }
}

/// A text member; empty if it is missing.
fn text<'a>(frame: &'a Value, name: &str) -> &'a str {
    frame.get(name).and_then(Value::as_str).unwrap_or_default()
}

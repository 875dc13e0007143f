//! The arm's actor in virtual time: exact step counts, what it says and when, and that it is the offline simulation.
//! Here an arm, and somebody who hears all that it says.
//!
//! The arm is asked as another node asks it. A client's calls are here where it is meant what is made of their fields.

mod steps;
mod topics;

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use crate::askers::hand_on;
use crate::stage::ms;
use crate::system::in_virtual_time;
use actix::prelude::*;
use bytes::Bytes;
use pendularm::actors::ConnectionId;
use pendularm::actors::arm::sim::{
    ArmSim, Enable, Pause, Reset, SetGains, SetIntegrator, SetSetpoint, TakeSnapshot,
};
use pendularm::actors::node::{
    Ask, Asker, Call, Done, Interest, Publish, Reply, Respond, Unserved,
};
use pendularm::actors::resources::gauges::Gauges;
use pendularm::actors::wire::Nodes;
use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;
use pendularm::protocol::catalog::{Service, Topic};
use serde_json::{Value, json};
use tokio::sync::oneshot;
use tokio::time::{Instant, sleep};

/// Everything that the arm has said, in order.
#[derive(Clone, Default)]
pub struct NodeMessage(Rc<RefCell<Vec<Said>>>);

#[derive(Clone, Debug, PartialEq)]
pub enum Said {
    Published(Topic, Value),
    Responded(ConnectionId, Value),
    /// To a typed message.
    Answered,
}

impl NodeMessage {
    fn take(&self) -> Vec<Said> {
        std::mem::take(&mut self.0.borrow_mut())
    }

    fn push(&self, said: Said) {
        self.0.borrow_mut().push(said);
    }

    /// The messages on `topic` since the last look at anything.
    pub fn messages(&self, topic: Topic) -> Vec<Value> {
        let said = self.take().into_iter();
        said.filter_map(|one| match one {
            Said::Published(of, frame) if of == topic => Some(frame["msg"].clone()),
            _ => None,
        })
        .collect()
    }
}

/// Stands in for the registry.
struct Ear(NodeMessage);

impl Actor for Ear {
    type Context = Context<Self>;
}

impl Handler<Publish> for Ear {
    type Result = ();

    fn handle(&mut self, publish: Publish, _: &mut Context<Self>) {
        let frame: Value = serde_json::from_slice(&publish.frame.write()).expect("valid JSON");
        self.0.push(Said::Published(publish.topic, frame));
    }
}

impl Handler<Respond> for Ear {
    type Result = ();

    fn handle(&mut self, respond: Respond, _: &mut Context<Self>) {
        let frame = serde_json::from_slice(&respond.frame.write()).expect("valid JSON");
        self.0.push(Said::Responded(respond.connection, frame));
    }
}

/// Stands in for a client with a typed message: the word of its answer takes the way that the arm's messages take.
struct Asking<T> {
    ear: Addr<Ear>,
    answer: oneshot::Sender<T>,
}

impl<T: Send> Asker<T> for Asking<T> {
    fn answer(self: Box<Self>, answer: Result<T, Unserved>, _: Option<Done>) {
        self.ear.do_send(Answered);
        let _ = self.answer.send(answer.expect("an answer"));
    }
}

#[derive(Message)]
#[rtype(result = "()")]
struct Answered;

impl Handler<Answered> for Ear {
    type Result = ();

    fn handle(&mut self, _: Answered, _: &mut Context<Self>) {
        self.0.push(Said::Answered);
    }
}

/// An arm, and somebody who hears all that it says.
pub struct ArmBench<const N: usize> {
    pub arm: Addr<ArmSim<N>>,
    /// The ways by which clients' calls and messages come to it.
    routes: Nodes,
    ear: Addr<Ear>,
    pub heard: NodeMessage,
    pub gauges: Arc<Gauges>,
}

impl<const N: usize> ArmBench<N>
where
    Gains<N>: Default,
{
    pub fn new(arm: Arm<N>) -> Self {
        let heard = NodeMessage::default();
        let ear = Ear(heard.clone()).start();
        let publish = ear.clone().recipient();
        let gauges = Arc::new(Gauges::default());
        let arm = ArmSim::new(arm, Gains::default(), publish, Arc::clone(&gauges)).start();
        let mut routes = Nodes::default();
        ArmSim::attach(&arm, &mut routes);
        Self {
            arm,
            routes,
            ear,
            heard,
            gauges,
        }
    }

    /// An arm that nothing moves, whatever the timestep.
    fn weightless() -> Self {
        Self::new(Arm::new([1.0; N], [1.0; N], 0.0).unwrap())
    }

    /// Calls a service as a client does and gives the whole response; no virtual time passes.
    async fn call(&self, service: Service, args: Value) -> Value {
        let respond = self.ear.clone().recipient();
        let ended = hand_on(&self.routes, respond, service, &args);
        let _ = ended.await;
        self.heard_all().await;
        let said = self.heard.0.borrow();
        match said
            .iter()
            .rev()
            .find(|one| matches!(one, Said::Responded(..)))
        {
            Some(Said::Responded(_, frame)) => frame.clone(),
            _ => panic!("no response"),
        }
    }

    /// Asks as another node does; no virtual time passes.
    pub async fn ask<A: Ask>(&self, question: A) -> A::Answer
    where
        ArmSim<N>: Actor<Context = Context<ArmSim<N>>> + Handler<Call<A>>,
    {
        let (give, answer) = oneshot::channel();
        let asking = Asking {
            ear: self.ear.clone(),
            answer: give,
        };
        let reply = Reply::new(asking, None);
        self.arm.do_send(Call {
            ask: question,
            reply,
        });
        let answer = answer.await.expect("an arm");
        self.heard_all().await;
        answer
    }

    /// Has the controller hold this from the next step on.
    pub async fn hold(&self, position: [f64; N], velocity: [f64; N]) {
        let (setpoint, done) = (Setpoint { position, velocity }, None);
        let held = SetSetpoint { setpoint, done };
        self.arm.send(held).await.unwrap();
    }

    /// Waits until the ear has heard what was said so far.
    async fn heard_all(&self) {
        tokio::task::yield_now().await;
        self.ear
            .send(Respond {
                connection: ConnectionId(0),
                frame: Bytes::from_static(b"null").into(),
                service: None,
                status: None,
                done: None,
            })
            .await
            .unwrap();
        self.heard.0.borrow_mut().pop();
    }

    pub async fn want(&self, topic: Topic, wanted: bool) {
        self.arm.send(Interest { topic, wanted }).await.unwrap();
    }

    /// The simulation once it has taken what is due: a slow machine may need several wake-ups at one virtual instant.
    async fn snapshot(&self) -> Simulation<N> {
        let mut before = None;
        loop {
            let simulation = *self.arm.send(TakeSnapshot).await.unwrap().0;
            if before == Some(simulation.steps()) {
                return simulation;
            }
            before = Some(simulation.steps());
        }
    }

    async fn steps(&self) -> u64 {
        self.snapshot().await.steps()
    }
}

pub fn of_timestep(timestep: f64) -> SetIntegrator {
    SetIntegrator {
        timestep: Some(timestep),
        ..SetIntegrator::default()
    }
}

pub fn method(method: Method) -> SetIntegrator {
    SetIntegrator {
        method: Some(method),
        ..SetIntegrator::default()
    }
}

pub fn pause(paused: bool) -> Pause {
    Pause {
        paused: Some(paused),
        ..Pause::default()
    }
}

pub fn enable(enabled: bool) -> Enable {
    Enable {
        enabled: Some(enabled),
        ..Enable::default()
    }
}

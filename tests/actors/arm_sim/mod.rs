//! The arm's actor in virtual time: exact step counts, what it says and when, and that it is the offline simulation.
//! Here an arm, and somebody who hears all that it says.

mod answers;
mod offline;
mod steps;
mod topics;

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use crate::system::in_virtual_time;
use actix::prelude::*;
use bytes::Bytes;
use pendularm::actors::ConnectionId;
use pendularm::actors::arm::sim::{
    ArmSim, Enable, Pause, Reset, SetGains, SetIntegrator, SetSetpoint, TakeSnapshot,
};
use pendularm::actors::node::{Ask, Call, Interest, Publish, Respond, ask};
use pendularm::actors::resources::gauges::Gauges;
use pendularm::actors::wire::{Caller, Nodes, ServiceCall, TopicMessage};
use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;
use pendularm::protocol::catalog::{Service, Topic};
use pendularm::protocol::op::Arguments;
use pendularm::protocol::wire::payload::Payload;
use serde_json::value::to_raw_value;
use serde_json::{Value, json};
use tokio::sync::oneshot;
use tokio::time::{Instant, sleep};

/// Everything that the arm has said, in order.
#[derive(Clone, Default)]
struct Heard(Rc<RefCell<Vec<Said>>>);

#[derive(Clone, Debug, PartialEq)]
enum Said {
    Published(Topic, Value),
    Responded(ConnectionId, Value),
}

impl Heard {
    fn take(&self) -> Vec<Said> {
        std::mem::take(&mut self.0.borrow_mut())
    }

    /// The messages on `topic` since the last look at anything.
    fn messages(&self, topic: Topic) -> Vec<Value> {
        let said = self.take().into_iter();
        said.filter_map(|one| match one {
            Said::Published(of, frame) if of == topic => Some(frame["msg"].clone()),
            _ => None,
        })
        .collect()
    }
}

/// Stands in for the registry.
struct Probe(Heard);

impl Actor for Probe {
    type Context = Context<Self>;
}

impl Handler<Publish> for Probe {
    type Result = ();

    fn handle(&mut self, publish: Publish, _: &mut Context<Self>) {
        let frame: Value = serde_json::from_slice(&publish.frame.write()).expect("valid JSON");
        self.0
            .0
            .borrow_mut()
            .push(Said::Published(publish.topic, frame));
    }
}

impl Handler<Respond> for Probe {
    type Result = ();

    fn handle(&mut self, respond: Respond, _: &mut Context<Self>) {
        let frame = serde_json::from_slice(&respond.frame.write()).expect("valid JSON");
        self.0
            .0
            .borrow_mut()
            .push(Said::Responded(respond.connection, frame));
    }
}

/// An arm, and somebody who hears all that it says.
struct Bench<const N: usize> {
    arm: Addr<ArmSim<N>>,
    /// The ways by which clients' calls and messages come to it.
    routes: Nodes,
    probe: Addr<Probe>,
    heard: Heard,
}

const CALLER: ConnectionId = ConnectionId(7);

impl<const N: usize> Bench<N>
where
    Gains<N>: Default,
{
    fn new(arm: Arm<N>) -> Self {
        let heard = Heard::default();
        let probe = Probe(heard.clone()).start();
        let publish = probe.clone().recipient();
        let gauges = Arc::new(Gauges::default());
        let arm = ArmSim::new(arm, Gains::default(), publish, gauges).start();
        let mut routes = Nodes::default();
        ArmSim::attach(&arm, &mut routes);
        Self {
            arm,
            routes,
            probe,
            heard,
        }
    }

    /// An arm that nothing moves, whatever the timestep.
    fn weightless() -> Self {
        Self::new(Arm::new([1.0; N], [1.0; N], 0.0).unwrap())
    }

    /// Calls a service as a client does and gives the whole response; no virtual time passes.
    async fn call(&self, service: Service, args: Value) -> Value {
        let (caller, ended) = Caller::new(
            self.probe.clone().recipient(),
            CALLER,
            service,
            service.name().into(),
            None,
            Arc::default(),
        );
        let raw = to_raw_value(&args).unwrap();
        let arguments = if args.is_array() {
            Arguments::Positional(raw.into())
        } else {
            Arguments::Object(raw.into())
        };
        self.routes.services[&service](ServiceCall {
            service,
            arguments,
            caller,
        });
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
    async fn ask<A: Ask>(&self, question: A) -> A::Answer
    where
        ArmSim<N>: Actor<Context = Context<ArmSim<N>>> + Handler<Call<A>>,
    {
        let answer = ask(&self.arm.clone().recipient(), question).await;
        self.heard_all().await;
        answer.expect("an answer")
    }

    /// Has the controller hold this from the next step on.
    async fn hold(&self, position: [f64; N], velocity: [f64; N]) {
        let (setpoint, done) = (Setpoint { position, velocity }, None);
        let held = SetSetpoint { setpoint, done };
        self.arm.send(held).await.unwrap();
    }

    /// Waits until the probe has heard what was said so far.
    async fn heard_all(&self) {
        tokio::task::yield_now().await;
        self.probe
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

    /// Publishes on `/joint_trajectory` as a client does.
    async fn trajectory(&self, msg: Value, id: Option<Value>) {
        let (done, ended) = oneshot::channel();
        self.routes.listeners[&Topic::JointTrajectory](TopicMessage {
            heard: Payload::from(to_raw_value(&msg).unwrap()).into(),
            respond: self.probe.clone().recipient(),
            connection: CALLER,
            id: id.map(|id| to_raw_value(&id).unwrap().into()),
            done,
        });
        assert!(
            ended.await.is_err(),
            "dropped when the message has taken effect"
        );
        self.heard_all().await;
    }

    async fn want(&self, topic: Topic, wanted: bool) {
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

fn of_timestep(timestep: f64) -> SetIntegrator {
    SetIntegrator {
        timestep: Some(timestep),
        ..SetIntegrator::default()
    }
}

fn method(method: Method) -> SetIntegrator {
    SetIntegrator {
        method: Some(method),
        ..SetIntegrator::default()
    }
}

fn pause(paused: bool) -> Pause {
    Pause {
        paused: Some(paused),
        ..Pause::default()
    }
}

fn enable(enabled: bool) -> Enable {
    Enable {
        enabled: Some(enabled),
        ..Enable::default()
    }
}

fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

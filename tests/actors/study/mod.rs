//! The node `study`: here what its tests are made of, a client, an arm with settings of its own and the pool's bench.
//!
//! The node is asked as another node asks it; a client's calls are here where it is meant what is made of their fields,
//! and how an answer is written.

mod arm;
mod predictions;
mod rollouts;
mod turns;

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::stage::{ms, pass};
use crate::system::in_virtual_time;
use actix::prelude::*;
use pendularm::actors::ConnectionId;
use pendularm::actors::arm::sim::{
    ArmSettings, ArmSim, Consult, Enable, HeldLimit, LEAST_PAUSE, Pause, Present, Reset, SetGains,
    SetIntegrator, SetParams, SetSetpoint, TakeSnapshot,
};
use pendularm::actors::compute::integration::{Integration, IntegrationStep};
use pendularm::actors::compute::study::{
    NotPlanned, NotRun, PlanRun, PredictStability, RunOffline, Study, SuggestGains,
};
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::node::{
    Ask, Asker, Call, Done, Interest, Publish, Reply, Respond, Unserved, ask,
};
use pendularm::actors::resources::gauges::Gauges;
use pendularm::actors::resources::work_clock;
use pendularm::actors::wire::{Caller, Nodes, ServiceCall};
use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;
use pendularm::protocol::catalog::{Service, Topic};
use pendularm::protocol::op::Arguments;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::error_estimate::estimate;
use pendularm::study::gains::{GainsRequirements, GainsSearch};
use pendularm::study::linear::no_control;
use pendularm::study::motion::Motion;
use pendularm::study::planner::{Planning, Task};
use pendularm::study::stability::{Limits, limit_held, limits};
use serde_json::value::to_raw_value;
use serde_json::{Value, json};
use tokio::sync::{mpsc, oneshot};
use tokio::time::{sleep, timeout};

/// How long anything may take before a test gives up.
const PATIENCE: Duration = Duration::from_secs(20);

/// Stands in for a client that has called: says that it has its answer, and hands it on.
struct Asking<T> {
    connection: u64,
    gone: Arc<AtomicBool>,
    answered: mpsc::UnboundedSender<u64>,
    answer: oneshot::Sender<Result<T, Unserved>>,
}

impl<T: Send> Asker<T> for Asking<T> {
    fn answer(self: Box<Self>, answer: Result<T, Unserved>, _: Option<Done>) {
        let _ = self.answered.send(self.connection);
        let _ = self.answer.send(answer);
    }

    fn client(&self) -> Option<ConnectionId> {
        Some(ConnectionId(self.connection))
    }

    fn is_gone(&self) -> bool {
        self.gone.load(Ordering::Relaxed)
    }
}

/// A call on its way: its answer and its end to come, and the flag that its caller has gone.
struct Called<T> {
    answer: oneshot::Receiver<Result<T, Unserved>>,
    ended: oneshot::Receiver<()>,
    gone: Arc<AtomicBool>,
}

/// Asks as the client of that connection, which says so once it has its answer.
fn call<A: Ask>(
    node: &Recipient<Call<A>>,
    connection: u64,
    answered: &mpsc::UnboundedSender<u64>,
    ask: A,
) -> Called<A::Answer> {
    let gone = Arc::new(AtomicBool::new(false));
    let (done, ended) = oneshot::channel();
    let (give, answer) = oneshot::channel();
    let asking = Asking {
        connection,
        gone: Arc::clone(&gone),
        answered: answered.clone(),
        answer: give,
    };
    let reply = Reply::new(asking, Some(done));
    node.do_send(Call { ask, reply });
    Called {
        answer,
        ended,
        gone,
    }
}

/// Stands in for the registry; passes on every response.
struct Probe(mpsc::UnboundedSender<Value>);

impl Actor for Probe {
    type Context = Context<Self>;
}

impl Handler<Respond> for Probe {
    type Result = ();

    fn handle(&mut self, respond: Respond, _: &mut Context<Self>) {
        let frame = serde_json::from_slice(&respond.frame.write()).expect("valid JSON");
        let _ = self.0.send(frame);
    }
}

/// An arm with settings of its own, none of them the default.
struct SettledArm<const N: usize>;

impl<const N: usize> Actor for SettledArm<N> {
    type Context = Context<Self>;
}

fn settings<const N: usize>() -> Present<N> {
    Present {
        control: ControlLoop {
            arm: Arm::new([0.8; N], [1.5; N], 3.7).unwrap(),
            gains: Gains {
                kp: [300.0; N],
                ki: [50.0; N],
                kd: [20.0; N],
            },
            setpoint: Setpoint {
                position: [0.4; N],
                velocity: [0.0; N],
            },
            method: Method::Midpoint,
            timestep: 0.002,
        },
        state: State {
            position: [0.3; N],
            velocity: [-0.2; N],
        },
    }
}

/// The same as a client would write it.
fn settings_as_args<const N: usize>() -> Value {
    json!({
        "integrator": "midpoint",
        "gains": {"kp": vec![300.0; N], "ki": vec![50.0; N], "kd": vec![20.0; N]},
        "params": {"gravity": 3.7, "masses": vec![1.5; N], "lengths": vec![0.8; N]},
        "setpoint": vec![0.4; N],
    })
}

impl<const N: usize> Handler<ArmSettings<N>> for SettledArm<N> {
    type Result = Present<N>;

    fn handle(&mut self, _: ArmSettings<N>, _: &mut Context<Self>) -> Present<N> {
        settings()
    }
}

struct Bench<const N: usize> {
    pool: WorkerPool,
    study: Addr<Study<N>>,
    probe: Addr<Probe>,
    responses: mpsc::UnboundedReceiver<Value>,
    answered: mpsc::UnboundedSender<u64>,
    order: mpsc::UnboundedReceiver<u64>,
}

impl<const N: usize> Bench<N> {
    /// With one worker, so that turns can be told from luck.
    fn new() -> Self {
        let (sender, responses) = mpsc::unbounded_channel();
        let (answered, order) = mpsc::unbounded_channel();
        let pool = WorkerPool::start(1).unwrap();
        let arm = SettledArm::<N>.start();
        Self {
            study: Study::new(arm.recipient(), pool.clone()).start(),
            pool,
            probe: Probe(sender).start(),
            responses,
            answered,
            order,
        }
    }

    fn call<A: Ask>(&self, connection: u64, ask: A) -> Called<A::Answer>
    where
        Study<N>: Actor<Context = Context<Study<N>>> + Handler<Call<A>>,
    {
        let node = self.study.clone().recipient();
        call(&node, connection, &self.answered, ask)
    }

    /// The connection whose call is answered next.
    async fn next(&mut self) -> u64 {
        let next = timeout(PATIENCE, self.order.recv()).await;
        next.expect("an answer in time").expect("the bench lives")
    }

    async fn ask<A: Ask>(&self, question: A) -> A::Answer
    where
        Study<N>: Actor<Context = Context<Study<N>>> + Handler<Call<A>>,
    {
        let answer = ask(&self.study.clone().recipient(), question);
        let answer = timeout(PATIENCE, answer).await;
        answer.expect("an answer in time").expect("an answer")
    }

    /// The response to a client's call.
    async fn response(&mut self, service: Service, args: &Value) -> Value {
        let (caller, _) = Caller::new(
            self.probe.clone().recipient(),
            ConnectionId(1),
            service,
            service.name().into(),
            None,
            Arc::default(),
        );
        let mut routes = Nodes::default();
        Study::attach(&self.study, &mut routes);
        routes.services[&service](ServiceCall {
            service,
            arguments: Arguments::Object(to_raw_value(args).unwrap().into()),
            caller,
        });
        let response = timeout(PATIENCE, self.responses.recv()).await;
        response
            .expect("a response in time")
            .expect("the probe lives")
    }

    async fn values(&mut self, service: Service, args: &Value) -> Value {
        let response = self.response(service, args).await;
        assert_eq!(response["result"], true, "{response}");
        assert_eq!(response["status"], "", "{response}");
        response["values"].clone()
    }

    async fn refusal(&mut self, service: Service, args: &Value) -> String {
        let response = self.response(service, args).await;
        assert_eq!(
            (&response["result"], &response["values"]),
            (&json!(false), &json!({})),
            "{response}"
        );
        response["status"].as_str().unwrap().to_owned()
    }
}

impl<const N: usize> Drop for Bench<N> {
    fn drop(&mut self) {
        self.pool.close("the test is over");
    }
}

fn gravity(gravity: f64) -> SetParams<2> {
    SetParams {
        gravity: Some(gravity),
        ..SetParams::default()
    }
}

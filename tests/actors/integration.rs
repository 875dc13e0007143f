//! `/arm_sim/integration_step` on the worker pool: turns, ends, and one answer each.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use actix::prelude::*;
use pendularm::actors::ConnectionId;
use pendularm::actors::compute::integration::Integration;
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::node::Respond;
use pendularm::actors::wire::{Caller, Nodes, ServiceCall};
use pendularm::math::expression::Expression;
use pendularm::math::integrator::Method;
use pendularm::math::particle::Particle;
use pendularm::protocol::catalog::Service;
use pendularm::protocol::op::Arguments;
use serde_json::value::to_raw_value;
use serde_json::{Value, json};
use tokio::sync::{mpsc, oneshot};
use tokio::time::timeout;

/// How long anything may take before a test gives up.
const PATIENCE: Duration = Duration::from_secs(20);

/// Stands in for the registry; passes every answer on with the connection that it is for.
struct Probe(mpsc::UnboundedSender<(u64, Value)>);

impl Actor for Probe {
    type Context = Context<Self>;
}

impl Handler<Respond> for Probe {
    type Result = ();

    fn handle(&mut self, respond: Respond, _: &mut Context<Self>) {
        assert_eq!(respond.service, Some(Service::IntegrationStep));
        let frame = serde_json::from_slice(&respond.frame.write()).expect("valid JSON");
        let _ = self.0.send((respond.connection.0, frame));
    }
}

struct Bench {
    pool: WorkerPool,
    integration: Addr<Integration>,
    probe: Addr<Probe>,
    answers: mpsc::UnboundedReceiver<(u64, Value)>,
}

/// A call on its way: ends with it; and the flag that its caller has gone.
struct Call {
    ended: oneshot::Receiver<()>,
    gone: Arc<AtomicBool>,
}

impl Bench {
    /// With one worker, so that turns can be told from luck.
    fn new() -> Self {
        let (sender, answers) = mpsc::unbounded_channel();
        let pool = WorkerPool::start(1).unwrap();
        let integration = Integration::new(pool.clone()).start();
        Self {
            integration,
            pool,
            probe: Probe(sender).start(),
            answers,
        }
    }

    fn call(&self, connection: u64, args: &Value) -> Call {
        let gone = Arc::new(AtomicBool::new(false));
        let service = Service::IntegrationStep;
        let (caller, ended) = Caller::new(
            self.probe.clone().recipient(),
            ConnectionId(connection),
            service,
            service.name().into(),
            None,
            Arc::clone(&gone),
        );
        let arguments = Arguments::Object(to_raw_value(args).unwrap().into());
        let mut routes = Nodes::default();
        Integration::attach(&self.integration, &mut routes);
        routes.services[&service](ServiceCall {
            service,
            arguments,
            caller,
        });
        Call { ended, gone }
    }

    async fn answer(&mut self) -> (u64, Value) {
        let answer = timeout(PATIENCE, self.answers.recv()).await;
        answer.expect("an answer in time").expect("the probe lives")
    }

    async fn assert_nothing_more(&mut self) {
        // Whatever else the worker would say, it would say before it is done with the next call.
        let call = self.call(99, &request("t", 1));
        assert_eq!(self.answer().await.0, 99);
        let _ = call.ended.await;
        assert!(self.answers.try_recv().is_err());
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.pool.close("the test is over");
    }
}

fn request(function: &str, steps: u64) -> Value {
    json!({"function": function, "x0": 1, "xdot0": -1, "dt": 0.001, "steps": steps, "integrator": "rk4"})
}

/// Seconds of work in an unoptimised build; no test waits for its end.
fn heavy() -> Value {
    request(&vec!["t"; 2001].join("+"), 100_000)
}

#[test]
fn the_answer_is_the_particles_own() {
    System::new().block_on(async {
        let mut bench = Bench::new();
        bench.call(1, &request("sin(5*t)*exp(-t)", 5000));
        let (connection, frame) = bench.answer().await;
        assert_eq!(connection, 1);
        assert_eq!((&frame["op"], &frame["result"], &frame["status"]), (&json!("service_response"), &json!(true), &json!("")));
        let function = Expression::parse("sin(5*t)*exp(-t)").unwrap();
        let mut particle = Particle::new(function, 1.0, -1.0, 0.001, 5000, Method::Rk4).unwrap();
        particle.advance(5000);
        let times: Vec<f64> = particle.times().collect();
        // Exactly: what is printed reads back as the same bits.
        assert_eq!(frame["values"], json!({"times": times, "positions": particle.positions(), "velocities": particle.velocities()}));
    });
}

#[test]
fn a_light_call_is_done_while_a_heavy_one_takes_turns_with_it() {
    System::new().block_on(async {
        let mut bench = Bench::new();
        let heavy = bench.call(1, &heavy());
        for connection in 2..10 {
            bench.call(connection, &request("t", 100));
        }
        let mut order = Vec::new();
        for _ in 2..10 {
            order.push(bench.answer().await.0);
        }
        assert_eq!(
            order,
            [2, 3, 4, 5, 6, 7, 8, 9],
            "in the order in which they came, and before the heavy one"
        );
        heavy.gone.store(true, Ordering::Relaxed);
    });
}

#[test]
fn a_call_whose_caller_has_gone_ends_early_and_once() {
    System::new().block_on(async {
        let mut bench = Bench::new();
        let call = bench.call(1, &heavy());
        call.gone.store(true, Ordering::Relaxed);
        // The registry drops the answer; that there is one is how every call ends.
        let (connection, frame) = bench.answer().await;
        assert_eq!((connection, &frame["result"]), (1, &json!(false)));
        assert!(timeout(PATIENCE, call.ended).await.is_ok());
        bench.assert_nothing_more().await;
    });
}

#[test]
fn a_caller_that_leaves_at_any_moment_is_answered_once() {
    System::new().block_on(async {
        let mut bench = Bench::new();
        for microseconds in (0..2000).step_by(40) {
            let call = bench.call(1, &request("t", 300));
            tokio::time::sleep(Duration::from_micros(microseconds)).await;
            call.gone.store(true, Ordering::Relaxed);
            assert!(timeout(PATIENCE, call.ended).await.is_ok());
            assert_eq!(bench.answer().await.0, 1);
        }
        bench.assert_nothing_more().await;
    });
}

#[test]
fn the_end_of_the_pool_refuses_what_runs_what_waits_and_what_comes() {
    System::new().block_on(async {
        let mut bench = Bench::new();
        for connection in 1..=5 {
            bench.call(connection, &heavy());
        }
        bench.pool.close("shutting down");
        bench.call(6, &heavy());
        let mut refused = Vec::new();
        for _ in 1..=6 {
            let (connection, frame) = bench.answer().await;
            assert_eq!(
                (&frame["result"], &frame["values"], &frame["status"]),
                (&json!(false), &json!({}), &json!("shutting down"))
            );
            refused.push(connection);
        }
        refused.sort_unstable();
        assert_eq!(refused, [1, 2, 3, 4, 5, 6]);
        assert!(bench.answers.try_recv().is_err());
        assert!(bench.pool.is_idle());
    });
}

#[test]
fn what_is_refused_does_not_take_a_turn_away() {
    System::new().block_on(async {
        let mut bench = Bench::new();
        for (connection, args) in [
            (1, json!({})),
            (2, request("((((", 10)),
            (3, request("t", 2_000_000)),
            (4, request("t", 10)),
        ] {
            bench.call(connection, &args);
        }
        for connection in 1..=4 {
            let (of, frame) = bench.answer().await;
            assert_eq!(of, connection);
            assert_eq!(frame["result"], connection == 4, "{frame}");
            assert_eq!(frame["values"] == json!({}), connection != 4);
        }
    });
}

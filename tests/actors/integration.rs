//! `/arm_sim/integration_step` on the worker pool: turns, ends, and one answer each.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::system::in_real_time;
use actix::prelude::*;
use pendularm::actors::ConnectionId;
use pendularm::actors::compute::integration::{Integration, IntegrationStep, NotIntegrated};
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::node::{Asker, Call, Done, Reply, Unserved};
use pendularm::math::expression::Expression;
use pendularm::math::integrator::Method;
use pendularm::math::particle::Particle;
use tokio::sync::{mpsc, oneshot};
use tokio::time::timeout;

/// How long anything may take before a test gives up.
const PATIENCE: Duration = Duration::from_secs(20);

type Answer = Result<Box<Particle>, NotIntegrated>;
/// A connection, and the answer to its call.
type Answered = (u64, Result<Answer, Unserved>);

/// Stands in for a client that has called.
struct Caller {
    connection: u64,
    gone: Arc<AtomicBool>,
    answers: mpsc::UnboundedSender<Answered>,
}

impl Asker<Answer> for Caller {
    fn answer(self: Box<Self>, answer: Result<Answer, Unserved>, _: Option<Done>) {
        let _ = self.answers.send((self.connection, answer));
    }

    fn client(&self) -> Option<ConnectionId> {
        Some(ConnectionId(self.connection))
    }

    fn is_gone(&self) -> bool {
        self.gone.load(Ordering::Relaxed)
    }
}

struct Bench {
    pool: WorkerPool,
    integration: Addr<Integration>,
    caller: mpsc::UnboundedSender<Answered>,
    answers: mpsc::UnboundedReceiver<Answered>,
}

/// A call on its way: ends with it; and the flag that its caller has gone.
struct Called {
    ended: oneshot::Receiver<()>,
    gone: Arc<AtomicBool>,
}

impl Bench {
    /// With one worker, so that turns can be told from luck.
    fn new() -> Self {
        let (caller, answers) = mpsc::unbounded_channel();
        let pool = WorkerPool::start(1).unwrap();
        let integration = Integration::new(pool.clone()).start();
        Self {
            integration,
            pool,
            caller,
            answers,
        }
    }

    fn call(&self, connection: u64, ask: IntegrationStep) -> Called {
        let gone = Arc::new(AtomicBool::new(false));
        let caller = Caller {
            connection,
            gone: Arc::clone(&gone),
            answers: self.caller.clone(),
        };
        let (done, ended) = oneshot::channel();
        let reply = Reply::new(caller, Some(done));
        self.integration.do_send(Call { ask, reply });
        Called { ended, gone }
    }

    async fn answer(&mut self) -> Answered {
        let answer = timeout(PATIENCE, self.answers.recv()).await;
        answer.expect("an answer in time").expect("the bench lives")
    }

    async fn assert_nothing_more(&mut self) {
        // The worker would say anything else before it is done with the next call.
        let call = self.call(99, request("t", 1));
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

fn request(function: &str, steps: u64) -> IntegrationStep {
    IntegrationStep {
        function: Some(function.to_owned()),
        x0: Some(1.0),
        xdot0: Some(-1.0),
        dt: Some(0.001),
        steps: Some(steps),
        method: Some(Method::Rk4),
        ..IntegrationStep::default()
    }
}

/// Seconds of work in an unoptimised build; no test waits for its end.
fn heavy() -> IntegrationStep {
    request(&vec!["t"; 2001].join("+"), 100_000)
}

#[test]
fn the_answer_is_the_particles_own() {
    in_real_time(async {
        let mut bench = Bench::new();
        bench.call(1, request("sin(5*t)*exp(-t)", 5000));
        let (connection, answer) = bench.answer().await;
        assert_eq!(connection, 1);
        let answered = answer.unwrap().unwrap();
        let function = Expression::parse("sin(5*t)*exp(-t)").unwrap();
        let mut particle = Particle::new(function, 1.0, -1.0, 0.001, 5000, Method::Rk4).unwrap();
        particle.advance(5000);
        assert!(answered.times().eq(particle.times()));
        assert_eq!(answered.positions(), particle.positions());
        assert_eq!(answered.velocities(), particle.velocities());
    });
}

#[test]
fn a_light_call_is_done_while_a_heavy_one_takes_turns_with_it() {
    in_real_time(async {
        let mut bench = Bench::new();
        let heavy = bench.call(1, heavy());
        for connection in 2..10 {
            bench.call(connection, request("t", 100));
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
    in_real_time(async {
        let mut bench = Bench::new();
        let call = bench.call(1, heavy());
        call.gone.store(true, Ordering::Relaxed);
        // The registry drops the answer; that there is one is how every call ends.
        let (connection, answer) = bench.answer().await;
        assert_eq!(connection, 1);
        assert!(matches!(answer, Err(Unserved::CallerGone)));
        assert!(timeout(PATIENCE, call.ended).await.is_ok());
        bench.assert_nothing_more().await;
    });
}

#[test]
fn a_caller_that_leaves_at_any_moment_is_answered_once() {
    in_real_time(async {
        let mut bench = Bench::new();
        for microseconds in (0..2000).step_by(40) {
            let call = bench.call(1, request("t", 300));
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
    in_real_time(async {
        let mut bench = Bench::new();
        for connection in 1..=5 {
            bench.call(connection, heavy());
        }
        bench.pool.close("shutting down");
        bench.call(6, heavy());
        let mut refused = Vec::new();
        for _ in 1..=6 {
            let (connection, answer) = bench.answer().await;
            assert!(matches!(answer, Err(Unserved::Refused("shutting down"))));
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
    in_real_time(async {
        let mut bench = Bench::new();
        for (connection, ask) in [
            (1, IntegrationStep::default()),
            (2, request("((((", 10)),
            (3, request("t", 2_000_000)),
            (4, request("t", 10)),
        ] {
            bench.call(connection, ask);
        }
        for connection in 1..=4 {
            let (of, answer) = bench.answer().await;
            assert_eq!(of, connection);
            assert_eq!(answer.unwrap().is_ok(), connection == 4);
        }
    });
}

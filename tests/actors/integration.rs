//! `/arm_sim/integration_step` on the worker pool: turns, ends, and one answer each.

use std::sync::atomic::Ordering;
use std::time::Duration;

use crate::askers::{PATIENCE, PoolBench};
use crate::study::study;
use crate::system::in_real_time;
use pendularm::actors::compute::study::{IntegrationStep, Study};
use pendularm::actors::node::Unserved;
use pendularm::math::integrator::Method;
use tokio::time::timeout;

async fn assert_nothing_more(bench: &mut PoolBench<Study<2>>) {
    // The worker would send any other message before the end of the next call.
    let call = bench.ask_as(99, request("t", 1));
    assert_eq!(bench.next().await, 99);
    let _ = call.ended.await;
    assert!(bench.is_silent());
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
fn a_caller_that_disconnects_at_any_moment_gets_one_answer() {
    in_real_time(async {
        let mut bench = study::<2>();
        for microseconds in (0..2000).step_by(40) {
            let call = bench.ask_as(1, request("t", 300));
            tokio::time::sleep(Duration::from_micros(microseconds)).await;
            call.gone.store(true, Ordering::Relaxed);
            assert!(timeout(PATIENCE, call.ended).await.is_ok());
            assert_eq!(bench.next().await, 1);
        }
        assert_nothing_more(&mut bench).await;
    });
}

#[test]
fn the_end_of_the_pool_refuses_running_waiting_and_new_tasks() {
    in_real_time(async {
        let mut bench = study::<2>();
        let mut calls: Vec<_> = (1..=5).map(|n| bench.ask_as(n, heavy())).collect();
        bench.pool.close("shutting down");
        calls.push(bench.ask_as(6, heavy()));
        let mut refused = Vec::new();
        for call in calls {
            refused.push(bench.next().await);
            let answer = call.answer.await.unwrap();
            assert!(matches!(answer, Err(Unserved("shutting down"))));
        }
        refused.sort_unstable();
        assert_eq!(refused, [1, 2, 3, 4, 5, 6]);
        assert!(bench.is_silent());
        assert!(bench.pool.is_idle());
    });
}

#[test]
fn a_refused_call_takes_no_turn() {
    in_real_time(async {
        let mut bench = study::<2>();
        let calls = [
            (1, IntegrationStep::default()),
            (2, request("((((", 10)),
            (3, request("t", 2_000_000)),
            (4, request("t", 10)),
        ]
        .map(|(connection, ask)| (connection, bench.ask_as(connection, ask)));
        for (connection, call) in calls {
            assert_eq!(bench.next().await, connection);
            assert_eq!(call.answer.await.unwrap().unwrap().is_ok(), connection == 4);
        }
    });
}

//! Bounded memory for clients: long answers of computations wait for a share of the common memory.
//! `exchanges/memory.txt` has long frames.

use std::time::Duration;

use crate::study::settled_arm;
use crate::system::{in_real_time, in_virtual_time};
use crate::virtual_time::{Client, Gateway, WIDE, settle};
use actix::prelude::*;
use pendularm::actors::compute::study::Study;
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::gateway::limits::{CLIENT_BYTES, MAX_LONG_FORMS, MAX_MEMORY};
use pendularm::actors::gateway::registry::Nodes;
use pendularm::actors::resources::memory::{LONG_ANSWERS, LONG_FRAMES, Memory, SHORT};
use serde_json::{Value, json};
use tokio::time::sleep;

const MIB: usize = 1024 * 1024;
const STEP: &str = "/arm_sim/integration_step";

/// `limits.rs` asserts that the sum is within the limit.
#[test]
fn places_and_pools_have_the_documented_sizes() {
    const { assert!(CLIENT_BYTES == 1728 * 1024 && MAX_MEMORY == 648 * MIB) };
    const { assert!(LONG_FRAMES == 3 && LONG_ANSWERS == 96 * MIB && SHORT == 64 * 1024) };
    const { assert!(MAX_LONG_FORMS == 4) };
}

/// A gateway with real computations, on real threads: so this test is in real time.
async fn computing(answers: usize, workers: &WorkerPool) -> Gateway {
    let mut nodes = Nodes::default();
    let study = Study::new(settled_arm::<2>(), workers.clone());
    Study::attach(&study.start(), &mut nodes);
    Gateway::within(Memory::of(1, answers), nodes).await
}

async fn ask(client: &mut Client, service: &str, args: Value) {
    client
        .send(&json!({"op": "call_service", "service": service, "args": args}))
        .await;
}

fn steps(steps: usize) -> Value {
    json!({"function": "sin(t)", "x0": 1.0 / 3.0, "dt": 1e-3, "steps": steps, "integrator": "euler"})
}

#[test]
fn each_kind_of_computation_reserves_memory_before_it_begins() {
    in_virtual_time(async {
        for (service, args) in [
            (STEP, steps(9_999)),
            ("/study/rollout", json!({"samples": 2000})),
            ("/study/stability", json!({})),
            ("/study/gains", json!({})),
            ("/study/plan", json!({"error": 1e-9})),
        ] {
            let workers = WorkerPool::without_threads();
            let gateway = computing(LONG_ANSWERS, &workers).await;
            let mut client = gateway.connect(WIDE);
            ask(&mut client, service, args).await;
            settle().await;
            assert!(workers.turn());
            // A part is 16 KiB.
            assert!(gateway.gauges.memory().taken() > 1, "{service}");
            workers.close("the end");
        }
    });
}

#[test]
fn computations_that_fit_only_after_one_another_wait_for_one_another() {
    in_real_time(async {
        let workers = WorkerPool::start(2).unwrap();
        // Memory for one answer of 10,000 steps at a time, and for a short one in addition.
        let gateway = computing(MIB, &workers).await;
        // The first answer fits into no pipe, so it keeps its memory, more than 32 parts of it, until it is read.
        let pipes = [SHORT].into_iter().chain([WIDE; 11]);
        let mut clients: Vec<Client> = pipes.map(|size| gateway.connect(size)).collect();
        ask(&mut clients[0], STEP, steps(10_000)).await;
        while gateway.gauges.memory().taken() < 32 {
            sleep(Duration::from_millis(1)).await;
        }
        for client in &mut clients[1..] {
            ask(client, STEP, steps(10_000)).await;
        }
        let mut light = gateway.connect(WIDE);
        ask(&mut light, STEP, steps(10)).await;
        assert_eq!(light.receive().await["result"], true);
        for client in &mut clients {
            let response = client.receive().await;
            assert_eq!(response["result"], true, "{}", response["status"]);
            let times = response["values"]["times"].as_array().unwrap();
            assert_eq!(times.len(), 10_001);
        }
        drop(clients);
        while gateway.gauges.memory().taken() > 0 {
            sleep(Duration::from_millis(1)).await;
        }
        workers.close("the end");
    });
}

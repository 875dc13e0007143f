//! Bounded memory for clients: long answers of computations wait for a share of the common memory.
//! `exchanges/memory.txt` has long frames.

use std::time::Duration;

use crate::study::settled_arm;
use crate::system::{in_real_time, in_virtual_time};
use crate::virtual_time::{Client, Gateway, WIDE, settle};
use actix::prelude::*;
use pendularm::actors::compute::study::Study;
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::gateway::limits::{
    CLIENT_BYTES, MAX_LONG_FORMS, MAX_MEMORY, RESPONSES_TIME,
};
use pendularm::actors::gateway::registry::{Attach, Nodes};
use pendularm::actors::resources::long_work::{THREADS_OF_A_KIND, WorkKind, WorkPermit};
use pendularm::actors::resources::memory::{
    LONG_ANSWERS, LONG_FRAMES, LONGEST_ANSWER, Memory, SHORT,
};
use pendularm::actors::ros::rosapi::RosapiNode;
use serde_json::{Value, json};
use tokio::time::{sleep, timeout};

const MIB: usize = 1024 * 1024;
const STEP: &str = "/arm_sim/integration_step";

/// `limits.rs` asserts that the sum is within the limit.
#[test]
fn places_and_pools_have_the_documented_sizes() {
    const { assert!(CLIENT_BYTES == 1728 * 1024 && MAX_MEMORY == 664 * MIB) };
    const { assert!(LONG_FRAMES == 3 && SHORT == 64 * 1024) };
    const { assert!(LONG_ANSWERS == 16 * MIB && LONGEST_ANSWER == 96 * MIB) };
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
            assert!(gateway.gauges.memory().taken() > SHORT, "{service}");
            workers.close("the end");
        }
    });
}

#[test]
fn a_caller_that_leaves_waits_for_no_memory_and_holds_up_nobody() {
    in_virtual_time(async {
        let workers = WorkerPool::without_threads();
        let gateway = computing(MIB, &workers).await;
        let memory = gateway.gauges.memory().clone();
        let half = memory.answer(MIB / 2).await;
        let (mut first, mut second) = (gateway.connect(WIDE), gateway.connect(WIDE));
        ask(&mut first, STEP, steps(10_000)).await;
        settle().await;
        ask(&mut second, STEP, steps(2_000)).await;
        settle().await;
        assert!(
            workers.is_idle(),
            "the first is due, and the second waits for it"
        );
        drop(first);
        // Whether its answers are still read is found out in this time.
        sleep(RESPONSES_TIME).await;
        settle().await;
        while workers.turn() {}
        assert_eq!(second.receive().await["result"], true);
        drop((half, second));
        settle().await;
        assert_eq!(memory.taken(), 0);
        workers.close("the end");
    });
}

#[test]
fn a_long_list_that_waits_for_memory_occupies_no_thread_and_short_ones_pass() {
    in_virtual_time(async {
        let gateway = Gateway::within(Memory::of(1, MIB), Nodes::default()).await;
        let rosapi = RosapiNode::new(gateway.registry.clone().recipient()).start();
        let mut nodes = Nodes::default();
        RosapiNode::attach(&rosapi, &mut nodes);
        gateway.registry.send(Attach(nodes)).await.unwrap();
        let memory = gateway.gauges.memory().clone();
        let all = memory.answer(MIB).await;
        let mut namer = gateway.connect(WIDE);
        for n in 0..40 {
            let topic = format!("/{n}/{}", "x".repeat(800));
            namer
                .send(&json!({"op": "advertise", "topic": topic}))
                .await;
        }
        sleep(Duration::from_millis(100)).await;
        let mut clients: Vec<Client> = (0..THREADS_OF_A_KIND + 2)
            .map(|_| gateway.connect(WIDE))
            .collect();
        for client in &mut clients {
            ask(client, "/rosapi/topics", json!({})).await;
        }
        settle().await;
        let permit = timeout(Duration::from_secs(1), WorkPermit::take(WorkKind::Listing)).await;
        assert!(permit.is_ok(), "the waiting lists have all threads");
        drop(permit);
        drop(all);
        for client in &mut clients {
            let answer = client.receive().await;
            assert_eq!(answer["result"], true, "{answer}");
            let topics = answer["values"]["topics"].as_array().unwrap();
            let named = topics
                .iter()
                .filter(|name| name.as_str().unwrap().len() > 800);
            assert_eq!(named.count(), 40);
        }
        settle().await;
        assert_eq!(memory.taken(), 0);
    });
}

#[test]
fn computations_that_fit_only_after_one_another_wait_for_one_another() {
    in_real_time(async {
        let workers = WorkerPool::start(2).unwrap();
        // Memory for one answer of 10,000 steps at a time, and for a short one in addition.
        let gateway = computing(MIB, &workers).await;
        // The first answer fits into no pipe, so it keeps its memory, more than half of it, until it is read.
        let pipes = [SHORT].into_iter().chain([WIDE; 11]);
        let mut clients: Vec<Client> = pipes.map(|size| gateway.connect(size)).collect();
        ask(&mut clients[0], STEP, steps(10_000)).await;
        while gateway.gauges.memory().taken() < MIB / 2 {
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

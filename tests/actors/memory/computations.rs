//! Computations whose long answers need room before they begin.

use super::*;
use crate::system::in_real_time;
use actix::prelude::*;
use pendularm::actors::compute::integration::Integration;
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::wire::{ROOM_TIME, SMALL_ANSWER};

const STEP: &str = "/arm_sim/integration_step";

/// A gateway with real computations, on real threads: so these tests are in real time.
async fn computing(limit: usize, workers: &WorkerPool) -> Gateway {
    let mut nodes = Nodes::default();
    Integration::attach(&Integration::new(workers.clone()).start(), &mut nodes);
    Gateway::within(Memory::of(limit), nodes).await
}

async fn ask_steps(client: &mut Peer, steps: usize) {
    client
        .send(json!({"op": "call_service", "service": STEP, "id": steps,
            "args": {"function": "sin(t)", "x0": 1.0 / 3.0, "dt": 1e-3, "steps": steps,
                "integrator": "euler"}}))
        .await;
}

#[test]
fn computations_that_fit_only_after_one_another_wait_for_one_another() {
    in_real_time(async {
        let workers = WorkerPool::start(2).unwrap();
        // Room for two answers of 10,000 steps at a time, beside what 12 connections take.
        let gateway = computing(5 * MIB, &workers).await;
        let mut clients: Vec<Peer> = (0..12).map(|_| gateway.connect(WIDE)).collect();
        for client in &mut clients {
            ask_steps(client, 10_000).await;
        }
        for client in &mut clients {
            let response = client.receive().await;
            assert_eq!(response["result"], true, "{}", response["status"]);
            let times = response["values"]["times"].as_array().unwrap();
            assert_eq!(times.len(), 10_001);
        }
        drop(clients);
        while gateway.gauges.memory().held() > 0 {
            settle().await;
        }
        workers.close("the end");
    });
}

#[test]
fn computations_for_whose_answers_there_is_no_room_are_refused_and_all_others_arrive_whole() {
    in_real_time(async {
        let workers = WorkerPool::start(2).unwrap();
        let limit = 8 * MIB;
        let gateway = computing(limit, &workers).await;
        let memory = gateway.gauges.memory().clone();
        let mut deaf: Vec<Peer> = (0..20).map(|_| gateway.connect(KIB)).collect();
        for client in &mut deaf {
            ask_steps(client, 10_000).await;
        }
        let mut honest = gateway.connect(WIDE);
        let mut most = 0;
        let began = std::time::Instant::now();
        while workers.is_idle() {
            settle().await;
        }
        while !workers.is_idle() {
            ask_steps(&mut honest, 10).await;
            let response = honest.receive().await;
            assert_eq!(response["result"], true, "small ones need no room");
            most = most.max(memory.held());
        }
        assert!(most <= limit, "{most}");
        assert!(began.elapsed() >= ROOM_TIME, "none is refused before");
        let mut refused = 0;
        for client in &mut deaf {
            let response = client.receive().await;
            if response["result"] == true {
                let velocities = response["values"]["velocities"].as_array().unwrap();
                assert_eq!(velocities.len(), 10_001);
            } else {
                let status = response["status"].as_str().unwrap();
                assert!(status.contains("try again later"), "{status}");
                assert_eq!(response["values"], json!({}));
                refused += 1;
            }
        }
        assert!((3..20).contains(&refused), "{refused} of 20 refused");
        assert_eq!(memory.cut_off(), 0);
        // Now that they have been read, there is room again.
        ask_steps(&mut deaf[0], 10_000).await;
        assert_eq!(deaf[0].receive().await["result"], true);
        workers.close("the end");
    });
}

/// An answer of more than [`SMALL_ANSWER`] for a client that has little: whoever lets much more lie gives way to it.
#[test]
fn who_asks_for_less_than_others_hold_has_it() {
    in_real_time(async {
        let workers = WorkerPool::start(2).unwrap();
        let gateway = computing(4 * MIB, &workers).await;
        let hog = gateway.gauges.memory().open();
        let held = hog.take(4 * MIB - 200 * KIB);
        let mut honest = gateway.connect(WIDE);
        const { assert!(2000 * 60 > SMALL_ANSWER) };
        ask_steps(&mut honest, 2000).await;
        let response = honest.receive().await;
        assert_eq!(response["result"], true, "{}", response["status"]);
        assert!(hog.asked().await, "its connection");
        drop(held);
        workers.close("the end");
    });
}

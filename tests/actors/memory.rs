//! Memory for clients: long frames and long answers share a limit, and wait until there is room.
//!
//! **Invariant:** a client that disconnects frees its memory, and none keeps memory longer than a stalled client may
//! live.

use std::time::Duration;

use crate::system::{in_real_time, in_virtual_time};
use crate::virtual_time::{Gateway, Peer, WIDE, assert_elapsed, settle};
use actix::prelude::*;
use pendularm::actors::compute::integration::Integration;
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::gateway::limits::{CLIENT_BYTES, FRAME_TIME, MAX_MEMORY, STALL_LIMIT};
use pendularm::actors::gateway::registry::Nodes;
use pendularm::actors::resources::memory::{LONG_ANSWERS, LONG_FRAMES, Memory, SHORT};
use pendularm::protocol::limits::MEDIUM;
use serde_json::{Value, json};
use tokio::time::{Instant, sleep};

const MIB: usize = 1024 * 1024;
const STEP: &str = "/arm_sim/integration_step";

/// A gateway with room for one long frame at a time.
async fn narrow() -> Gateway {
    Gateway::within(Memory::of(1, MIB), Nodes::default()).await
}

/// A message on `topic` that takes room.
fn long(topic: &str, n: u64) -> Value {
    json!({"op": "publish", "topic": topic, "msg": {"n": n, "blob": "x".repeat(MEDIUM)}})
}

/// Whether a light call is answered at once.
async fn is_served(client: &mut Peer) -> bool {
    client
        .send(json!({"op": "call_service", "service": "/nobody", "id": "light"}))
        .await;
    client.receive().await["id"] == "light"
}

/// That all of it fits into the limit is asserted where the limits are.
#[test]
fn places_and_pools_have_the_documented_sizes() {
    const { assert!(CLIENT_BYTES == 1728 * 1024 && MAX_MEMORY == 640 * MIB) };
    const { assert!(LONG_FRAMES == 3 && LONG_ANSWERS == 96 * MIB && SHORT == 64 * 1024) };
}

#[test]
fn a_long_frame_waits_for_another_and_short_ones_do_not() {
    in_virtual_time(async {
        let gateway = narrow().await;
        let (mut slow, mut next) = (gateway.connect(WIDE), gateway.connect(WIDE));
        let mut light = gateway.connect(WIDE);
        let mut subscriber = gateway.connect(WIDE);
        subscriber.subscribe("/t").await;
        next.advertise("/t").await;
        let text = long("/t", 1).to_string();
        let (begun, end) = text.split_at(text.len() - 1);
        slow.offer(begun).await;
        settle().await;
        assert_eq!(gateway.gauges.memory().taken(), 1);
        next.send(long("/t", 2)).await;
        settle().await;
        assert!(is_served(&mut light).await);
        slow.offer(end).await;
        assert_eq!(subscriber.receive().await["msg"]["n"], 2);
        drop((slow, next, light, subscriber));
        settle().await;
        assert_eq!(gateway.gauges.memory().taken(), 0);
    });
}

#[test]
fn whoever_does_not_complete_a_long_frame_gives_its_room_back_in_time() {
    in_virtual_time(async {
        let gateway = narrow().await;
        let (mut slow, mut next) = (gateway.connect(WIDE), gateway.connect(WIDE));
        let began = Instant::now();
        slow.offer(&long("/t", 1).to_string()[..=MEDIUM]).await;
        settle().await;
        next.subscribe("/t").await;
        next.advertise("/t").await;
        next.send(long("/t", 2)).await;
        assert_eq!(next.receive().await["msg"]["n"], 2);
        assert_elapsed(began, FRAME_TIME);
    });
}

/// While one client holds all room for long frames, a published message of 256 KiB passes.
#[test]
fn a_medium_message_takes_no_room_and_waits_for_none() {
    in_virtual_time(async {
        let gateway = narrow().await;
        let (mut slow, mut talker) = (gateway.connect(WIDE), gateway.connect(WIDE));
        slow.offer(&long("/t", 1).to_string()[..=MEDIUM]).await;
        settle().await;
        assert_eq!(gateway.gauges.memory().taken(), 1);
        let began = Instant::now();
        talker.subscribe("/t").await;
        talker.advertise("/t").await;
        let blob = "x".repeat(256 * 1024);
        talker
            .send(json!({"op": "publish", "topic": "/t", "msg": {"blob": blob}}))
            .await;
        assert_eq!(talker.receive().await["msg"]["blob"], blob.as_str());
        assert!(began.elapsed() < Duration::from_secs(1));
    });
}

/// Messages wait for a subscriber that has stopped reading; the newest of a topic never becomes too old.
#[test]
fn a_subscriber_that_reads_no_long_message_is_disconnected() {
    in_virtual_time(async {
        let gateway = narrow().await;
        let (mut deaf, mut talker) = (gateway.connect(1024), gateway.connect(WIDE));
        deaf.subscribe("/t").await;
        talker.advertise("/t").await;
        talker.send(long("/t", 1)).await;
        settle().await;
        let began = Instant::now();
        talker.send(long("/other", 2)).await;
        assert!(is_served(&mut talker).await);
        let time = began.elapsed() + Duration::from_millis(100);
        assert!(
            time >= STALL_LIMIT && time < STALL_LIMIT + Duration::from_secs(1),
            "{time:?}"
        );
        assert_eq!(gateway.gauges.connections(), 1);
    });
}

#[test]
fn a_long_message_is_not_held_back_for_longer_than_a_stalled_client_lives() {
    in_virtual_time(async {
        let gateway = narrow().await;
        let mut talker = gateway.connect(WIDE);
        talker.advertise("/t").await;
        for (throttle, held) in [(19_000, 1), (21_000, 0)] {
            let mut subscriber = gateway.connect(WIDE);
            subscriber
                .send(json!({"op": "subscribe", "topic": "/t", "throttle_rate": throttle}))
                .await;
            subscriber.receive().await;
            for n in 0..2 {
                talker.send(long("/t", n)).await;
            }
            assert_eq!(subscriber.receive().await["msg"]["n"], 0);
            settle().await;
            assert_eq!(gateway.gauges.memory().taken(), held, "{throttle}");
            drop(subscriber);
            settle().await;
        }
    });
}

/// Pieces take room once they are long together, for the whole message.
#[test]
fn pieces_of_a_long_message_have_room_for_one() {
    in_virtual_time(async {
        let gateway = narrow().await;
        let mut client = gateway.connect(WIDE);
        client.subscribe("/t").await;
        client.advertise("/t").await;
        let text = long("/t", 3).to_string();
        let pieces: Vec<&str> = (0..text.len())
            .step_by(40_000)
            .map(|at| &text[at..text.len().min(at + 40_000)])
            .collect();
        let total = pieces.len();
        for (num, data) in pieces.into_iter().enumerate() {
            assert_eq!(gateway.gauges.memory().taken(), usize::from(num > 1));
            client
                .send(
                    json!({"op": "fragment", "id": "f", "data": data, "num": num, "total": total}),
                )
                .await;
            settle().await;
        }
        assert_eq!(client.receive().await["msg"]["n"], 3);
        settle().await;
        assert_eq!(gateway.gauges.memory().taken(), 0);
    });
}

/// Pieces and a long frame of one client share its room: it does not wait for itself.
#[test]
fn a_client_with_pieces_sends_a_long_frame_too() {
    in_virtual_time(async {
        let gateway = narrow().await;
        let mut client = gateway.connect(WIDE);
        client.subscribe("/t").await;
        client.advertise("/t").await;
        let data = "x".repeat(50_000);
        for num in 0..2 {
            client
                .send(json!({"op": "fragment", "id": "f", "data": data, "num": num, "total": 3}))
                .await;
        }
        settle().await;
        assert_eq!(gateway.gauges.memory().taken(), 1);
        client.send(long("/t", 4)).await;
        assert_eq!(client.receive().await["msg"]["n"], 4);
        client.half_close().await;
        client.rest().await;
        settle().await;
        assert_eq!(gateway.gauges.memory().taken(), 0);
    });
}

/// A call with a long `id` goes to another client, whose long answer comes back: each has room of its own.
#[test]
fn long_calls_and_answers_of_clients_pass() {
    in_virtual_time(async {
        let gateway = narrow().await;
        let (mut provider, mut caller) = (gateway.connect(WIDE), gateway.connect(WIDE));
        provider.provide("/s").await;
        for n in 0..3 {
            let blob = "x".repeat(2 * SHORT);
            caller
                .send(
                    json!({"op": "call_service", "service": "/s", "id": n, "args": {"blob": blob}}),
                )
                .await;
            let call = provider.receive().await;
            assert_eq!(call["args"]["blob"], blob.as_str());
            provider.answer(&call, json!({"blob": blob})).await;
            let answer = caller.receive().await;
            assert_eq!(
                (&answer["id"], &answer["values"]["blob"]),
                (&json!(n), &json!(blob))
            );
        }
        settle().await;
        assert_eq!(gateway.gauges.memory().taken(), 0);
    });
}

/// A gateway with real computations, on real threads: so this test is in real time.
async fn computing(answers: usize, workers: &WorkerPool) -> Gateway {
    let mut nodes = Nodes::default();
    Integration::attach(&Integration::new(workers.clone()).start(), &mut nodes);
    Gateway::within(Memory::of(1, answers), nodes).await
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
        // Room for one answer of 10,000 steps at a time, and for a short one in addition.
        let gateway = computing(MIB, &workers).await;
        let mut clients: Vec<Peer> = (0..12).map(|_| gateway.connect(WIDE)).collect();
        for client in &mut clients {
            ask_steps(client, 10_000).await;
        }
        let mut light = gateway.connect(WIDE);
        ask_steps(&mut light, 10).await;
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

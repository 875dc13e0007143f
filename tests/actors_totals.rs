//! What all clients together may hold: each total reached, with small totals in place of the program's own, in virtual time.
//!
//! **Invariant:** a client that asks for little and reads what it gets is served whatever the others do.

#![allow(
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a helper of a test fails by panicking, as a test does"
)]

mod virtual_time;

use std::time::Duration;

use actix::prelude::*;
use pendularm::actors::budget::{
    Budget, Claim, MAX_INPUT_TOTAL, MAX_MEMORY, MAX_MESSAGES_TOTAL, MAX_NAMES_TOTAL,
    MAX_RESPONSES_TOTAL, Totals,
};
use pendularm::actors::connection::unfinished::FREE_INPUT;
use pendularm::actors::connection::{MAX_TOPIC_BYTES_SCARCE, SMALL_FRAME, STALL_LIMIT};
use pendularm::actors::integration::Integration;
use pendularm::actors::node::{ROOM_TIME, SMALL_ANSWER};
use pendularm::actors::registry::{MAX_CONNECTIONS, Nodes, REGISTRATION_BYTES};
use pendularm::actors::workers::WorkerPool;
use pendularm::protocol::catalog::Service;
use pendularm::protocol::frame::MAX_FRAME;
use pendularm::protocol::outbox::MAX_TOPIC_BYTES;
use serde_json::json;
use tokio::time::sleep;
use virtual_time::{Gateway, Held, Node, Peer, WIDE, run, settle};

const KIB: usize = 1024;
const MIB: usize = 1024 * KIB;
const STEP: &str = "/arm_sim/integration_step";
const PAUSE: &str = "/arm_sim/pause";

/// A gateway whose `/arm_sim/pause` is answered at once, and whose computations are held.
async fn gateway(totals: Totals) -> (Gateway, Held) {
    let computations = Held::default();
    let mut nodes = Nodes::default();
    Node::holding(&computations).attach(&mut nodes, &[Service::IntegrationStep], &[]);
    let answering = Node {
        on_call: Box::new(|call| call.reply.conclude(&json!({}), "")),
        ..Node::default()
    };
    answering.attach(&mut nodes, &[Service::Pause], &[]);
    (Gateway::within(totals, nodes).await, computations)
}

fn responses(limit: usize) -> Totals {
    let responses = Budget::of(limit);
    Totals {
        responses,
        ..Totals::default()
    }
}

/// The small things that an honest client asks for are answered.
async fn is_served(client: &mut Peer) {
    for id in 0..10 {
        client.call(PAUSE, id).await;
        assert_eq!(client.receive().await["id"], id);
    }
}

#[test]
fn the_totals_are_as_the_readme_says_and_leave_room_for_every_client() {
    let totals = Totals::default();
    let limits = [
        (&totals.responses, MAX_RESPONSES_TOTAL),
        (&totals.messages, MAX_MESSAGES_TOTAL),
        (&totals.input, MAX_INPUT_TOTAL),
        (&totals.names, MAX_NAMES_TOTAL),
    ];
    for (total, limit) in limits {
        let all = total.take(limit, Claim::Last);
        assert!(all.is_some() && total.take(1, Claim::Last).is_none());
    }
    assert_eq!(
        MAX_RESPONSES_TOTAL,
        1024 * MIB,
        "all responses stay under 1 GiB"
    );
    // Of the last quarter every client can have the room for one small frame, and the answer to another.
    let modest = SMALL_FRAME + SMALL_FRAME / 2 + SMALL_ANSWER;
    assert!(2 * MAX_CONNECTIONS * modest <= MAX_RESPONSES_TOTAL / 4);
    // What is granted to every client beside the totals.
    let beside = MAX_CONNECTIONS * (2 * FREE_INPUT + MAX_TOPIC_BYTES_SCARCE + 32 * KIB);
    let totals = MAX_RESPONSES_TOTAL + MAX_MESSAGES_TOTAL + MAX_INPUT_TOTAL + MAX_NAMES_TOTAL;
    #[cfg(feature = "web")]
    let beside = beside + usize::try_from(pendularm::web::MAX_FILES_TOTAL).unwrap();
    let sum = totals + beside;
    assert!(
        sum + sum / 4 <= MAX_MEMORY,
        "a quarter for what an allocator adds: {sum}"
    );
}

#[test]
fn once_the_total_is_near_its_limit_who_has_a_backlog_is_not_read_and_others_are_served() {
    run(async {
        let limit = 8 * MIB;
        let (gateway, _) = gateway(responses(limit)).await;
        let mut deaf: Vec<Peer> = (0..20).map(|_| gateway.connect(KIB)).collect();
        let id = "x".repeat(100 * KIB);
        let frame = format!(
            "{}\n",
            json!({"op": "call_service", "service": PAUSE, "id": id})
        );
        for client in &mut deaf {
            // More than the pipe takes: sent as far as it is read.
            let send = client.send_text(&frame);
            let _ = tokio::time::timeout(Duration::from_millis(50), send).await;
        }
        let total = &gateway.gauges.totals().responses;
        settle().await;
        let mut honest = gateway.connect(WIDE);
        is_served(&mut honest).await;
        assert!(
            total.used() > limit / 8 && total.used() <= limit,
            "{total:?}"
        );
        // Who takes nothing is disconnected, and all of it is given back.
        sleep(STALL_LIMIT + Duration::from_secs(1)).await;
        drop(deaf);
        settle().await;
        assert_eq!(total.used(), 0);
    });
}

/// Each call echoes an id of its own size: deaf clients that go on calling can't have more than their part.
#[test]
fn deaf_clients_that_go_on_calling_never_hold_more_than_the_total() {
    run(async {
        let limit = 16 * MIB;
        let (gateway, _) = gateway(responses(limit)).await;
        let id = "x".repeat(300 * KIB);
        let frame = format!(
            "{}\n",
            json!({"op": "call_service", "service": PAUSE, "id": id})
        );
        let mut deaf: Vec<Peer> = (0..30).map(|_| gateway.connect(2 * MIB)).collect();
        let total = gateway.gauges.totals().responses.clone();
        let mut honest = gateway.connect(WIDE);
        let mut most = 0;
        for _ in 0..40 {
            for client in &mut deaf {
                let send = client.send_text(&frame);
                let _ = tokio::time::timeout(Duration::from_millis(1), send).await;
                most = most.max(total.used());
            }
            is_served(&mut honest).await;
        }
        assert!(most > limit / 2, "{most}: it was nearly reached");
        assert!(most <= limit, "{most} of {limit}");
    });
}

#[test]
fn a_long_frame_waits_for_room_and_is_answered_when_there_is_some() {
    run(async {
        let limit = 4 * MIB;
        let (gateway, _) = gateway(responses(limit)).await;
        let total = gateway.gauges.totals().responses.clone();
        let others = total.note(limit / 4 * 3);
        let mut client = gateway.connect(WIDE);
        let id = "y".repeat(2 * SMALL_FRAME);
        client
            .send(json!({"op": "call_service", "service": PAUSE, "id": id}))
            .await;
        assert!(client.hears_nothing_for(Duration::from_secs(300)).await);
        drop(others);
        assert_eq!(client.receive().await["id"], id);
        settle().await;
        assert_eq!(total.used(), 0);
    });
}

#[test]
fn a_long_answer_that_finds_no_room_is_a_refusal_that_says_so() {
    run(async {
        let limit = 4 * MIB;
        let (gateway, computations) = gateway(responses(limit)).await;
        let mut client = gateway.connect(WIDE);
        for (waiting, result) in [(0, true), (limit / 4 * 3, false)] {
            client.call(STEP, 1).await;
            settle().await;
            let others = gateway.gauges.totals().responses.note(waiting);
            computations.take().succeed(&"x".repeat(2 * SMALL_ANSWER));
            let response = client.receive().await;
            assert_eq!(response["result"], result, "{}", response["status"]);
            let status = response["status"].as_str().unwrap();
            assert!(result || status.contains("try again later"), "{status}");
            drop(others);
        }
    });
}

#[test]
fn what_clients_call_from_one_another_counts_too() {
    run(async {
        let limit = 4 * MIB;
        let (gateway, _) = gateway(responses(limit)).await;
        let total = gateway.gauges.totals().responses.clone();
        let (mut provider, mut caller) = (gateway.connect(WIDE), gateway.connect(WIDE));
        provider.provide("/s").await;
        caller.call("/s", 1).await;
        let call = provider.receive().await;
        settle().await;
        assert!(
            total.used() >= SMALL_ANSWER,
            "room for the answer is kept: {total:?}"
        );
        // An answer that is longer than the room left is refused; the caller is told.
        let others = total.note(limit / 4 * 3 - total.used() - 64 * KIB);
        provider
            .answer(&call, json!({"x": "x".repeat(60 * KIB)}))
            .await;
        let response = caller.receive().await;
        assert_eq!(response["result"], false);
        assert!(
            response["status"]
                .as_str()
                .unwrap()
                .contains("try again later")
        );
        // And no new call goes through.
        let more = total.note(64 * KIB);
        caller.call("/s", 2).await;
        let response = caller.receive().await;
        assert!(
            response["status"]
                .as_str()
                .unwrap()
                .contains("try again later")
        );
        drop((others, more));
        caller.call("/s", 3).await;
        let call = provider.receive().await;
        provider.answer(&call, json!({})).await;
        assert_eq!(caller.receive().await["result"], true);
        settle().await;
        assert_eq!(total.used(), 0);
    });
}

/// A gateway with real computations, on real threads: so this test is in real time.
async fn computing(limit: usize, workers: &WorkerPool) -> Gateway {
    let mut nodes = Nodes::default();
    Integration::attach(&Integration::new(workers.clone()).start(), &mut nodes);
    Gateway::within(responses(limit), nodes).await
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
    System::new().block_on(async {
        let workers = WorkerPool::start(2).unwrap();
        // Room for two answers of 10,000 steps at a time.
        let gateway = computing(3 * MIB, &workers).await;
        let mut clients: Vec<Peer> = (0..12).map(|_| gateway.connect(WIDE)).collect();
        for client in &mut clients {
            ask_steps(client, 10_000).await;
        }
        for client in &mut clients {
            let response = client.receive().await;
            assert_eq!(response["result"], true, "{}", response["status"]);
            assert_eq!(
                response["values"]["times"].as_array().unwrap().len(),
                10_001
            );
        }
        settle().await;
        assert_eq!(gateway.gauges.totals().responses.used(), 0);
        workers.close("the end");
    });
}

#[test]
fn computations_whose_answers_would_exceed_the_total_are_refused_and_all_others_arrive_whole() {
    System::new().block_on(async {
        let workers = WorkerPool::start(2).unwrap();
        let limit = 4 * MIB;
        let gateway = computing(limit, &workers).await;
        let total = gateway.gauges.totals().responses.clone();
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
            assert_eq!(
                honest.receive().await["result"],
                true,
                "small ones need no room"
            );
            most = most.max(total.used());
        }
        assert!(most <= limit, "{most}");
        assert!(began.elapsed() >= ROOM_TIME, "none is refused before");
        let mut refused = 0;
        for client in &mut deaf {
            let response = client.receive().await;
            if response["result"] == true {
                assert_eq!(
                    response["values"]["velocities"].as_array().unwrap().len(),
                    10_001
                );
            } else {
                assert!(
                    response["status"]
                        .as_str()
                        .unwrap()
                        .contains("try again later")
                );
                assert_eq!(response["values"], json!({}));
                refused += 1;
            }
        }
        assert!((5..20).contains(&refused), "{refused} of 20 refused");
        // Now that they have been read, there is room again.
        ask_steps(&mut deaf[0], 10_000).await;
        assert_eq!(deaf[0].receive().await["result"], true);
        workers.close("the end");
    });
}

#[test]
fn messages_that_all_clients_have_waiting_are_bounded_and_the_oldest_go_first() {
    run(async {
        let limit = 4 * MIB;
        let messages = Budget::of(limit);
        let totals = Totals {
            messages: messages.clone(),
            ..Totals::default()
        };
        let gateway = Gateway::within(totals, Nodes::default()).await;
        let mut publisher = gateway.connect(WIDE);
        let mut deaf = Vec::new();
        for n in 0..16 {
            let mut client = gateway.connect(KIB);
            client.subscribe(&format!("/{n}")).await;
            publisher.advertise(&format!("/{n}")).await;
            deaf.push(client);
        }
        let blob = "x".repeat(20 * KIB);
        for n in 0..100 {
            for topic in 0..16 {
                publisher
                    .send(json!({"op": "publish", "topic": format!("/{topic}"),
                        "msg": {"n": n, "blob": blob}}))
                    .await;
            }
            settle().await;
        }
        // 32 MiB were sent. Beyond the total every client keeps a little, and has one in writing.
        let most = limit + 16 * (MAX_TOPIC_BYTES_SCARCE + 21 * KIB);
        assert!(messages.used() > limit / 2, "{messages:?}");
        assert!(messages.used() <= most, "{messages:?}");
        assert!(gateway.gauges.messages_dropped() > 800);
        for (topic, client) in deaf.iter_mut().enumerate() {
            let mut received = Vec::new();
            while received.last() != Some(&99) {
                let frame = client.receive().await;
                assert_eq!(frame["topic"], format!("/{topic}"));
                received.push(frame["msg"]["n"].as_u64().unwrap());
            }
            assert!(received.is_sorted_by(|a, b| a < b), "{received:?}");
        }
        settle().await;
        assert_eq!(messages.used(), 0);
    });
}

/// The contract's 4 MiB hold for each of any number of clients, because what they share is there once.
#[test]
fn a_message_that_many_clients_wait_for_counts_once() {
    run(async {
        let messages = Budget::of(8 * MIB);
        let totals = Totals {
            messages: messages.clone(),
            ..Totals::default()
        };
        let gateway = Gateway::within(totals, Nodes::default()).await;
        let mut publisher = gateway.connect(WIDE);
        publisher.advertise("/t").await;
        let mut deaf = Vec::new();
        for _ in 0..50 {
            let mut client = gateway.connect(KIB);
            client.subscribe("/t").await;
            deaf.push(client);
        }
        let blob = "x".repeat(200 * KIB);
        for n in 0..20 {
            publisher
                .send(json!({"op": "publish", "topic": "/t", "msg": {"n": n, "blob": blob}}))
                .await;
        }
        settle().await;
        assert!(messages.used() < MAX_TOPIC_BYTES + 2 * MIB, "{messages:?}");
        assert_eq!(gateway.gauges.messages_dropped(), 0);
        for n in 0..20 {
            assert_eq!(deaf[49].receive().await["msg"]["n"], n);
        }
    });
}

#[test]
fn a_new_message_reaches_who_reads_though_others_have_much_waiting() {
    run(async {
        let limit = 2 * MIB;
        let messages = Budget::of(limit);
        let totals = Totals {
            messages: messages.clone(),
            ..Totals::default()
        };
        let gateway = Gateway::within(totals, Nodes::default()).await;
        let _others = messages.note(limit / 4 * 3);
        let (mut publisher, mut reader) = (gateway.connect(WIDE), gateway.connect(WIDE));
        publisher.advertise("/t").await;
        reader.subscribe("/t").await;
        let blob = "x".repeat(2 * MAX_TOPIC_BYTES_SCARCE);
        for n in 0..20 {
            publisher
                .send(json!({"op": "publish", "topic": "/t", "msg": {"n": n, "blob": blob}}))
                .await;
            assert_eq!(reader.receive().await["msg"]["n"], n);
        }
    });
}

#[test]
fn unfinished_frames_that_find_no_room_are_skipped_and_their_senders_told() {
    run(async {
        let input = Budget::of(2 * MIB);
        let totals = Totals {
            input: input.clone(),
            ..Totals::default()
        };
        let gateway = Gateway::within(totals, Nodes::default()).await;
        let mut clients: Vec<Peer> = (0..8).map(|_| gateway.connect(WIDE)).collect();
        let begun = format!(
            "{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{{\"x\":\"{}",
            "x".repeat(400 * KIB)
        );
        for client in &mut clients {
            client.send_text(&begun).await;
            settle().await;
        }
        assert!(input.used() > MIB && input.used() <= 2 * MIB, "{input:?}");
        // The first of them have their room, and are complete in the end; the others were told, and skipped.
        for (n, client) in clients.iter_mut().enumerate() {
            client.send_text("\"}}\n").await;
            if n >= 3 {
                let status = client.receive().await;
                assert_eq!(status["level"], "error");
                assert!(
                    status["msg"].as_str().unwrap().contains("try again later"),
                    "{status}"
                );
            }
            client.call("/none", 7).await;
            assert_eq!(client.receive().await["id"], 7, "client {n} lives on");
        }
        settle().await;
        assert_eq!(input.used(), 0);
    });
}

#[test]
fn frames_that_every_client_may_send_need_no_room() {
    run(async {
        let totals = Totals {
            input: Budget::of(0),
            ..Totals::default()
        };
        let gateway = Gateway::within(totals, Nodes::default()).await;
        let mut client = gateway.connect(WIDE);
        let half = format!(
            "{{\"op\":\"call_service\",\"service\":\"/none\",\"id\":\"{}",
            "x".repeat(FREE_INPUT / 2)
        );
        client.send_text(&half).await;
        settle().await;
        client.send_text("\"}\n").await;
        assert_eq!(client.receive().await["op"], "service_response");
    });
}

#[test]
fn pieces_of_messages_that_find_no_room_are_forgotten_and_their_sender_told() {
    run(async {
        let input = Budget::of(MIB);
        let totals = Totals {
            input: input.clone(),
            ..Totals::default()
        };
        let gateway = Gateway::within(totals, Nodes::default()).await;
        let mut client = gateway.connect(WIDE);
        let piece = |num: usize, length: usize| json!({"op": "fragment", "id": "a", "num": num, "total": 9, "data": "x".repeat(length)});
        client.send(piece(0, 450 * KIB)).await;
        settle().await;
        assert!(input.used() > 700 * KIB, "{input:?}");
        for num in 1..4 {
            client.send(piece(num, 50 * KIB)).await;
            settle().await;
        }
        let status = client.receive().await;
        let msg = status["msg"].as_str().unwrap();
        assert!(msg.contains("pieces are forgotten"), "{status}");
        settle().await;
        assert_eq!(input.used(), 0);
        // They are forgotten when they are old, too, though nothing more comes.
        client.send(piece(0, 400 * KIB)).await;
        sleep(Duration::from_secs(61)).await;
        settle().await;
        assert_eq!(input.used(), 0);
        client.call("/none", 7).await;
        assert_eq!(client.receive().await["id"], 7);
    });
}

#[test]
fn registrations_of_all_clients_are_bounded_and_withdrawn_ones_make_room() {
    run(async {
        let names = Budget::of(100 * REGISTRATION_BYTES);
        let totals = Totals {
            names: names.clone(),
            ..Totals::default()
        };
        let gateway = Gateway::within(totals, Nodes::default()).await;
        let mut greedy = gateway.connect(WIDE);
        let mut refused = 0;
        for n in 0..50 {
            for (op, field) in [("subscribe", "topic"), ("advertise_service", "service")] {
                greedy.send(json!({"op": op, field: format!("/{n}")})).await;
                let status = greedy.receive().await;
                refused += usize::from(status["level"] == "error");
            }
        }
        assert!((1..5).contains(&refused), "{refused}");
        let mut other = gateway.connect(WIDE);
        other.send(json!({"op": "advertise", "topic": "/t"})).await;
        let status = other.receive().await;
        assert!(
            status["msg"]
                .as_str()
                .unwrap()
                .contains("by all clients together"),
            "{status}"
        );
        // What is subscribed already may be subscribed again once there is room; a withdrawn one makes room.
        greedy
            .send(json!({"op": "unsubscribe", "topic": "/0"}))
            .await;
        greedy
            .send(json!({"op": "unadvertise_service", "service": "/0"}))
            .await;
        greedy.subscribe("/1").await;
        other.subscribe("/t").await;
        drop((greedy, other));
        settle().await;
        assert_eq!(names.used(), 0);
    });
}

#[test]
fn the_longest_frame_alone_always_finds_room() {
    // As a compile-time fact, beside the constants: nothing that the contract accepts is refused while nobody else is there.
    const { assert!(2 * MAX_FRAME <= MAX_INPUT_TOTAL) };
    const { assert!(MAX_FRAME + MAX_FRAME / 2 + SMALL_ANSWER <= MAX_RESPONSES_TOTAL / 4 * 3) };
    const { assert!(MAX_TOPIC_BYTES <= MAX_MESSAGES_TOTAL / 8 * 5) };
}

//! Memory that all clients together may hold, in virtual time: who gives way when it is too much, and that nobody else does.
//!
//! **Invariant:** a client that asks for little and reads what it gets is served whatever the others do.

use std::sync::Arc;
use std::time::Duration;

use crate::system::{in_real_time, in_virtual_time};
use crate::virtual_time::{Gateway, Node, Peer, WIDE, settle};
use actix::prelude::*;
use bytes::Bytes;
use pendularm::actors::compute::integration::Integration;
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::gateway::limits::MAX_CONNECTIONS;
use pendularm::actors::gateway::registry::Nodes;
use pendularm::actors::resources::aside::PLACES;
use pendularm::actors::resources::budget::{
    Account, CONNECTION_BYTES, MAX_HELD, MAX_MEMORY, MESSAGES_LEFT, MODEST, MODEST_PART, Memory,
    NoRoom,
};
use pendularm::actors::wire::{ROOM_TIME, SMALL_ANSWER};
use pendularm::protocol::catalog::Service;
use pendularm::protocol::limits::MAX_FRAME;
use pendularm::protocol::outbox::{FRAME_BYTES, MAX_TOPIC_BYTES, PLACE_BYTES};
use pendularm::protocol::ros::tree::NODE_BYTES;
use serde_json::json;
use tokio::time::{sleep, timeout};

const KIB: usize = 1024;
const MIB: usize = 1024 * KIB;
const STEP: &str = "/arm_sim/integration_step";
const PAUSE: &str = "/arm_sim/pause";

/// A gateway whose `/arm_sim/pause` is answered at once.
async fn gateway(memory: Memory) -> Gateway {
    let mut nodes = Nodes::default();
    let answering = Node {
        on_call: Box::new(|mut call| call.caller.succeed(&json!({}))),
        ..Node::default()
    };
    answering.attach(&mut nodes, &[Service::Pause], &[]);
    Gateway::within(memory, nodes).await
}

/// The small things that an honest client asks for are answered.
async fn is_served(client: &mut Peer) {
    for id in 0..10 {
        client.call(PAUSE, id).await;
        assert_eq!(client.receive().await["id"], id);
    }
}

/// Begins a frame of so many bytes and more.
async fn begin_frame(client: &mut Peer, bytes: usize) {
    let begun = format!("{{\"op\":\"publish\",\"msg\":\"{}", "x".repeat(bytes));
    client.send_text(&begun).await;
    settle().await;
}

/// Whether an account is asked for its connection (true), for its messages (false), or for nothing.
async fn asked(account: &Account) -> Option<bool> {
    timeout(Duration::from_millis(1), account.asked())
        .await
        .ok()
}

// ---- accounts -------------------------------------------------------------------------------------------------------

#[test]
fn the_limits_are_as_the_readme_says_and_leave_room_for_every_client() {
    const { assert!(MAX_HELD == 384 * MIB && MAX_MEMORY == 640 * MIB) };
    // A client that never gives way, times all that there may be.
    const { assert!(MAX_CONNECTIONS * MODEST <= MAX_HELD) };
    const { assert!(CONNECTION_BYTES + MESSAGES_LEFT < MODEST) };
    // The memory that is counted, a quarter of it for the allocator, the files of the report, and the program itself.
    #[cfg(feature = "web")]
    let files = usize::try_from(pendularm::web::MAX_FILES_TOTAL).unwrap();
    #[cfg(not(feature = "web"))]
    let files = 0;
    assert!(MAX_HELD / 4 * 5 + files + 64 * MIB <= MAX_MEMORY);
    // While nobody else is there, whatever docs/protocol.md accepts fits: a frame and all that is made of it.
    const { assert!(10 * MAX_FRAME + MAX_TOPIC_BYTES < MAX_HELD) };
    // So do the longest messages that are put into another form at a time, with their trees: 12 bytes for one, and 4.
    const { assert!(NODE_BYTES / 2 == 12 && PLACES * (12 + 4) * MAX_FRAME <= MAX_HELD / 2) };
}

#[test]
fn what_is_taken_is_given_back_with_the_last_copy() {
    let memory = Memory::of(MIB);
    let account = memory.open();
    assert_eq!(
        (memory.held(), account.held()),
        (CONNECTION_BYTES, CONNECTION_BYTES)
    );
    let frame = account.count(Bytes::from(vec![7; 400]));
    let copy = frame.slice(10..20);
    drop(frame);
    let with_frame = CONNECTION_BYTES + 400 + FRAME_BYTES;
    assert_eq!((memory.held(), account.held()), (with_frame, with_frame));
    assert_eq!(copy, [7; 10][..]);
    drop(copy);
    let mut share = account.take(100);
    for bytes in [0, 300, 200] {
        share.resize(bytes);
        assert_eq!(
            (share.bytes(), memory.held()),
            (bytes, CONNECTION_BYTES + bytes)
        );
    }
    account.queue(3, 1000, 0);
    let places = 3 * PLACE_BYTES;
    assert_eq!(account.messages(), 1000 + places + 3 * FRAME_BYTES);
    assert_eq!(
        memory.held(),
        CONNECTION_BYTES + 200 + places,
        "messages count where they are made"
    );
    // A share outlives its connection, which is charged for as long.
    drop(account);
    assert_eq!(memory.held(), CONNECTION_BYTES + 200 + places);
    drop(share);
    assert_eq!(memory.held(), 0);
}

#[test]
fn a_message_counts_once_in_all_and_whole_for_each_who_waits_for_it() {
    let memory = Memory::of(MIB);
    let (one, other) = (memory.open(), memory.open());
    let at_rest = memory.held();
    let frame = memory.count(Bytes::from(vec![0; 1000]));
    for account in [&one, &other] {
        account.queue(1, frame.len(), 0);
        // Short messages cost more than their bytes: whoever hoards a million of them is no modest client.
        let each = 1000 + FRAME_BYTES + PLACE_BYTES;
        assert_eq!(account.held(), CONNECTION_BYTES + each);
    }
    assert_eq!(
        memory.held(),
        at_rest + 1000 + FRAME_BYTES + 2 * PLACE_BYTES
    );
    drop(frame);
    for account in [&one, &other] {
        account.queue(0, 0, 0);
    }
    assert_eq!(memory.held(), at_rest);
}

#[test]
fn the_largest_gives_way_first_and_only_until_the_rest_fits() {
    in_virtual_time(async {
        let memory = Memory::of(8 * MIB);
        let accounts: Vec<Arc<Account>> = (0..4).map(|_| memory.open()).collect();
        let mut shares: Vec<_> = accounts
            .iter()
            .zip([1, 3, 2, 1])
            .map(|(account, megabytes)| account.take(megabytes * MIB))
            .collect();
        for account in &accounts {
            assert_eq!(asked(account).await, None);
        }
        // The one that asks for more may be a small one: the largest gives way.
        let more = accounts[0].take(MIB);
        for (account, gives_way) in accounts.iter().zip([None, Some(true), None, None]) {
            assert_eq!(asked(account).await, gives_way);
        }
        // A client that is leaving is not waited for twice, nor asked again; bytes on top are the next one's turn.
        let other = accounts[3].take(MIB);
        assert_eq!((asked(&accounts[2]).await, memory.cut_off()), (None, 1));
        let much = accounts[2].take(2 * MIB);
        assert_eq!(
            (asked(&accounts[2]).await, memory.cut_off()),
            (Some(true), 2)
        );
        assert_eq!(asked(&accounts[0]).await, None);
        shares.clear();
        drop((more, other, much, accounts));
        assert_eq!(memory.held(), 0);
    });
}

#[test]
fn messages_go_first_and_the_connection_if_that_is_not_enough() {
    in_virtual_time(async {
        let memory = Memory::of(4 * MIB);
        let (hog, other) = (memory.open(), memory.open());
        let frame = memory.count(Bytes::from(vec![0; 2 * MIB]));
        hog.queue(1, frame.len(), 0);
        let share = hog.take(MIB);
        let rest = other.take(MIB);
        assert_eq!(asked(&hog).await, Some(false));
        drop(frame);
        hog.queue(0, 0, 0);
        hog.gave_messages();
        assert_eq!(asked(&hog).await, None);
        let more = hog.take(3 * MIB);
        assert_eq!((asked(&hog).await, asked(&other).await), (Some(true), None));
        drop((share, rest, more));
    });
}

/// Freeing the messages of a client that is gone takes a while, on another thread.
#[test]
fn nobody_gives_way_for_what_is_being_freed() {
    in_virtual_time(async {
        let memory = Memory::of(4 * MIB);
        let (gone, other) = (memory.open(), memory.open());
        let frame = memory.count(Bytes::from(vec![0; 3 * MIB]));
        gone.queue(1, frame.len(), 0);
        let freed = gone.freeing();
        gone.queue(0, 0, 0);
        let share = other.take(2 * MIB);
        assert_eq!(asked(&other).await, None);
        drop((frame, freed));
        let more = other.take(MIB);
        assert_eq!(asked(&other).await, None);
        let too_much = other.take(MIB);
        assert_eq!(asked(&other).await, Some(true));
        drop((share, more, too_much));
    });
}

#[test]
fn who_holds_little_never_gives_way() {
    in_virtual_time(async {
        let memory = Memory::of(MIB);
        let accounts: Vec<Arc<Account>> = (0..8).map(|_| memory.open()).collect();
        let shares: Vec<_> = accounts
            .iter()
            .map(|account| account.take(MODEST - CONNECTION_BYTES))
            .collect();
        assert!(memory.held() > MIB);
        for account in &accounts {
            assert_eq!(asked(account).await, None);
        }
        let _one_more = accounts[5].take(1);
        assert_eq!(asked(&accounts[5]).await, Some(true));
        drop(shares);
    });
}

#[test]
fn who_finds_no_room_for_an_answer_is_told_whether_it_is_worth_waiting() {
    let memory = Memory::of(8 * MIB);
    let (one, other) = (memory.open(), memory.open());
    let computing = one.promise(4 * MIB, false).unwrap();
    assert_eq!(other.promise(4 * MIB, true).unwrap_err(), NoRoom::Yet);
    let never = other.promise(8 * MIB, false);
    assert_eq!(never.unwrap_err(), NoRoom::Now, "it never fits");
    let answer = computing.cover(Bytes::from(vec![0; 4 * MIB]));
    let before = memory.held();
    assert_eq!(other.promise(4 * MIB, false).unwrap_err(), NoRoom::Now);
    // The client that would hold most is refused; one that asks for less has it, and if need be the largest gives way.
    let as_much = other.promise(4 * MIB + FRAME_BYTES, true);
    assert_eq!(as_much.unwrap_err(), NoRoom::Now);
    assert_eq!(memory.held(), before, "what is refused comes off again");
    drop(other.promise(7 * MIB / 2, true).unwrap());
    drop(answer);
    drop(other.promise(4 * MIB, false).unwrap());
    assert_eq!(memory.held(), 2 * CONNECTION_BYTES);
}

/// Six answers of a million steps fill what there is for such; whoever asks for a modest one has it.
#[test]
fn a_modest_answer_finds_room_beside_long_ones() {
    let memory = Memory::default();
    let accounts: Vec<_> = (0..200).map(|_| memory.open()).collect();
    let million = 99 * 1_000_000;
    let long: Vec<_> = accounts[..6]
        .iter()
        .filter_map(|account| account.promise(million, false).ok())
        .collect();
    assert!((1..6).contains(&long.len()), "no room is left for another");
    let modest = MAX_HELD / MODEST_PART;
    let longer = accounts[6].promise(2 * modest, false);
    assert!(longer.is_err(), "the next eighth is for modest ones");
    let given: Vec<_> = accounts[6..13]
        .iter()
        .map(|account| account.promise(modest, false))
        .collect();
    assert!(given.iter().all(Result::is_ok), "{given:?}");
    // Bytes that need no promise have their part besides.
    assert!(memory.held() <= MAX_HELD / 8 * 7);
    drop((long, given));
    drop(accounts);
    assert_eq!(memory.held(), 0);
}

// ---- clients --------------------------------------------------------------------------------------------------------

#[test]
fn the_client_that_holds_most_is_told_so_and_disconnected_and_no_other() {
    in_virtual_time(async {
        let gateway = gateway(Memory::of(8 * MIB)).await;
        let mut honest = gateway.connect(WIDE);
        let mut hogs: Vec<Peer> = (0..3).map(|_| gateway.connect(WIDE)).collect();
        for (hog, bytes) in hogs.iter_mut().zip([MIB, 3 * MIB, 2 * MIB]) {
            begin_frame(hog, bytes).await;
        }
        is_served(&mut honest).await;
        let memory = gateway.gauges.memory();
        while memory.cut_off() == 0 {
            begin_frame(&mut hogs[0], MIB / 4).await;
        }
        let told = hogs[1].rest().await;
        assert_eq!((told.len(), &told[0]["level"]), (1, &json!("error")));
        let why = told[0]["msg"].as_str().unwrap();
        assert!(
            why.starts_with("memory: this connection held the most"),
            "{why}"
        );
        assert!(why.ends_with(" MB)"), "{why}");
        settle().await;
        assert_eq!((memory.cut_off(), gateway.gauges.connections()), (1, 3));
        is_served(&mut honest).await;
        drop((hogs, honest));
        settle().await;
        assert_eq!(memory.held(), 0);
    });
}

#[test]
fn a_deaf_client_that_holds_most_is_gone_at_once_and_all_that_it_had() {
    in_virtual_time(async {
        let gateway = gateway(Memory::of(4 * MIB)).await;
        let mut deaf = gateway.connect(KIB);
        let id = "x".repeat(50 * KIB);
        let call = json!({"op": "call_service", "service": PAUSE, "id": id});
        let call = format!("{call}\n");
        let mut honest = gateway.connect(WIDE);
        let memory = gateway.gauges.memory();
        let mut most = 0;
        while deaf.offer(&call).await {
            most = most.max(memory.held());
        }
        is_served(&mut honest).await;
        assert_eq!(memory.cut_off(), 1);
        assert!((3 * MIB..5 * MIB).contains(&most), "{most}");
        sleep(Duration::from_secs(2)).await;
        assert_eq!(gateway.gauges.connections(), 1);
        assert!(memory.held() < MODEST, "{memory:?}");
    });
}

#[test]
fn hogs_of_registrations_do_not_keep_newcomers_from_subscribing() {
    in_virtual_time(async {
        let gateway = gateway(Memory::of(8 * MIB)).await;
        let mut hogs = Vec::new();
        for n in 0..8 {
            let mut hog = gateway.connect(WIDE);
            hog.send(json!({"op": "set_level", "level": "none"})).await;
            for topic in 0..1024 {
                let frame = json!({"op": "subscribe", "topic": format!("/{n}/{topic}")});
                hog.send(frame).await;
            }
            settle().await;
            hogs.push(hog);
        }
        let mut newcomer = gateway.connect(WIDE);
        newcomer.subscribe("/clock").await;
        newcomer.provide("/s").await;
        is_served(&mut newcomer).await;
        assert!(gateway.gauges.memory().cut_off() >= 1);
    });
}

#[test]
fn calls_of_a_day_do_not_keep_others_from_calling() {
    in_virtual_time(async {
        let gateway = gateway(Memory::of(8 * MIB)).await;
        let mut provider = gateway.connect(WIDE);
        provider.provide("/never").await;
        provider.provide("/s").await;
        let mut hogs = Vec::new();
        let id = "x".repeat(4 * KIB);
        for _ in 0..12 {
            let mut hog = gateway.connect(WIDE);
            for n in 0..256 {
                let id = format!("{n}{id}");
                hog.send(json!({"op": "call_service", "service": "/never", "id": id,
                    "timeout": 86_400}))
                    .await;
            }
            settle().await;
            hogs.push(hog);
        }
        assert!(gateway.gauges.memory().cut_off() >= 1);
        let mut honest = gateway.connect(WIDE);
        for n in 0..10 {
            honest.call("/s", n).await;
            let call = loop {
                let call = provider.receive().await;
                if call["service"] == "/s" {
                    break call;
                }
            };
            provider.answer(&call, json!({"n": n})).await;
            let response = honest.receive().await;
            assert_eq!(
                (&response["id"], &response["result"]),
                (&json!(n), &json!(true))
            );
        }
    });
}

#[test]
fn topic_messages_go_before_any_connection_and_the_oldest_of_them_first() {
    in_virtual_time(async {
        let memory = Memory::of(8 * MIB);
        let gateway = gateway(memory.clone()).await;
        let mut publisher = gateway.connect(WIDE);
        let mut deaf = Vec::new();
        for n in 0..16 {
            let mut client = gateway.connect(KIB);
            client.subscribe(&format!("/{n}")).await;
            publisher.advertise(&format!("/{n}")).await;
            deaf.push(client);
        }
        let blob = "x".repeat(20 * KIB);
        let mut most = 0;
        for n in 0..100 {
            for topic in 0..16 {
                publisher
                    .send(json!({"op": "publish", "topic": format!("/{topic}"),
                        "msg": {"n": n, "blob": blob}}))
                    .await;
            }
            settle().await;
            most = most.max(memory.held());
        }
        // 32 MiB were sent.
        assert!((7 * MIB..9 * MIB).contains(&most), "{most}");
        assert!(gateway.gauges.messages_dropped() > 800);
        assert_eq!(memory.cut_off(), 0);
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
        assert!(
            memory.held() < 17 * MODEST,
            "all of it is given back: {memory:?}"
        );
    });
}

/// The 4 MiB of docs/protocol.md hold for each of any number of clients, because what they share is there once.
#[test]
fn a_message_that_many_clients_wait_for_is_there_once() {
    in_virtual_time(async {
        let memory = Memory::of(24 * MIB);
        let gateway = gateway(memory.clone()).await;
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
        assert_eq!(gateway.gauges.messages_dropped(), 0);
        for n in 0..20 {
            assert_eq!(deaf[49].receive().await["msg"]["n"], n);
        }
    });
}

/// A message that is being written can't be dropped any more, and stays for as long as whoever subscribed takes nothing.
#[test]
fn a_message_that_is_being_written_counts_for_who_takes_it() {
    in_virtual_time(async {
        let limit = 32 * MIB;
        let memory = Memory::of(limit);
        let gateway = gateway(memory.clone()).await;
        let mut publisher = gateway.connect(WIDE);
        let mut publish = async |topic: usize, bytes: usize| {
            let mut subscriber = gateway.connect(KIB);
            let topic = format!("/{topic}");
            subscriber.subscribe(&topic).await;
            publisher.advertise(&topic).await;
            let blob = "x".repeat(bytes);
            let message = json!({"op": "publish", "topic": topic, "msg": {"blob": blob}});
            publisher.send(message).await;
            settle().await;
            subscriber
        };
        let mut hogs = Vec::new();
        for topic in 0..5 {
            hogs.push(publish(topic, 4 * MIB - 100 * KIB).await);
        }
        assert_eq!(memory.cut_off(), 0);
        let mut modest = Vec::new();
        for topic in 5..85 {
            modest.push(publish(topic, 190 * KIB).await);
            assert!(memory.held() <= limit, "{topic}: {memory:?}");
        }
        assert_eq!(memory.cut_off(), 3, "as many hogs as need be");
        is_served(&mut publisher).await;
        for mut subscriber in modest {
            assert_eq!(subscriber.receive().await["op"], "publish");
        }
        drop((hogs, publisher));
        sleep(Duration::from_secs(60)).await;
        assert_eq!(memory.held(), 0, "{memory:?}");
    });
}

// ---- computations ---------------------------------------------------------------------------------------------------

/// A gateway with real computations, on real threads: so this test is in real time.
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

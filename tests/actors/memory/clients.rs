//! Clients of a gateway: hogs give way, and the others are served.

use super::*;
use crate::virtual_time::Node;
use pendularm::protocol::catalog::Service;
use tokio::time::sleep;

const PAUSE: &str = "/arm_sim/pause";

/// A gateway whose `/arm_sim/pause` is answered at once.
async fn gateway(memory: Memory) -> Gateway {
    let mut nodes = Nodes::default();
    Node::answering().attach(&mut nodes, &[Service::Pause], &[]);
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

/// A message that is being written can't be dropped any more, and stays for as long as whoever subscribed takes
/// nothing.
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

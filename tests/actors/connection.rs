//! A connection in virtual time: throttling, stalls, what is owed at the end, the queue of computations.
//!
//! **Invariant:** no test depends on how fast the machine is; times are read from the paused clock.

use std::cell::RefCell;
use std::io::IoSlice;
use std::pin::Pin;
use std::rc::Rc;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, Held, Node, Peer, WIDE, assert_elapsed, settle};
use pendularm::actors::gateway::connection::Connection;
use pendularm::actors::gateway::limits::{
    MAX_COMPUTATIONS_WAITING, MAX_RESPONSES_WAITING, STALL_LIMIT,
};
use pendularm::actors::gateway::messages::Publish;
use pendularm::actors::gateway::registry::Nodes;
use pendularm::protocol::catalog::{Service, Topic};
use pendularm::protocol::messages;
use serde_json::{Value, json};
use tokio::io::{AsyncRead, AsyncWrite, AsyncWriteExt, DuplexStream, ReadBuf};
use tokio::time::{Instant, sleep};

const STEP: &str = Service::IntegrationStep.name();
const PARAMS: &str = Service::SetParams.name();

/// A gateway whose computations and whose parameters wait for the test to answer.
async fn held_back() -> (Gateway, Held, Held) {
    let (computations, calls) = (Held::default(), Held::default());
    let mut nodes = Nodes::default();
    Node::holding(&computations).attach(&mut nodes, &[Service::IntegrationStep], &[]);
    Node::holding(&calls).attach(&mut nodes, &[Service::SetParams], &[]);
    (Gateway::with(nodes).await, computations, calls)
}

fn id(frame: &Value) -> u64 {
    frame["id"].as_u64().expect("an id")
}

/// A publisher and a subscriber of `/t`, which has messages every `throttle_rate` ms at most.
async fn throttled(gateway: &Gateway, throttle_rate: u64, queue_length: u64) -> (Peer, Peer) {
    let (mut publisher, mut subscriber) = (gateway.connect(WIDE), gateway.connect(WIDE));
    publisher.advertise("/t").await;
    subscriber
        .send(
            json!({"op": "subscribe", "topic": "/t", "throttle_rate": throttle_rate,
            "queue_length": queue_length}),
        )
        .await;
    subscriber.receive().await;
    (publisher, subscriber)
}

#[test]
fn a_throttled_topic_comes_at_its_rate_and_the_newest_are_kept() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut subscriber) = throttled(&gateway, 100, 2).await;
        let began = Instant::now();
        for n in 0..100 {
            publisher.publish("/t", n).await;
            sleep(Duration::from_millis(10)).await;
        }
        // Message n at 10 n ms. At 100 k ms the older of the two newest goes: 10 k - 2 or 10 k - 1, by which of two
        // timers of the same instant is first.
        let mut came = vec![];
        while came.len() < 13 {
            came.push((
                subscriber.receive().await["msg"]["n"].as_u64().unwrap(),
                began.elapsed(),
            ));
            if came.last().unwrap().0 == 99 {
                break;
            }
        }
        assert_eq!(came[0].0, 0);
        assert_eq!(came.last().unwrap().0, 99);
        assert!(came.len() >= 11, "about ten a second: {came:?}");
        for pair in came.windows(2) {
            assert!(pair[0].0 < pair[1].0, "{came:?}");
        }
        assert!(subscriber.hears_nothing_for(Duration::from_secs(5)).await);
    });
}

/// Messages can be late by what was read at once; the last of n can't come before (n - 1) intervals.
#[test]
fn no_more_messages_come_than_the_interval_allows() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut subscriber) = throttled(&gateway, 1000, 5).await;
        let began = Instant::now();
        for n in 0..10 {
            publisher.publish("/t", n).await;
        }
        for (intervals, n) in [(0, 0), (1, 5), (2, 6), (3, 7), (4, 8), (5, 9)] {
            assert_eq!(subscriber.receive().await["msg"]["n"], n);
            assert_elapsed(began, Duration::from_secs(intervals));
        }
    });
}

#[test]
fn after_an_unsubscription_nothing_that_was_held_back_comes() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut subscriber) = (gateway.connect(WIDE), gateway.connect(WIDE));
        publisher.advertise("/t").await;
        subscriber
            .send(json!({"op": "subscribe", "topic": "/t", "throttle_rate": 1000}))
            .await;
        subscriber.receive().await;
        publisher.publish("/t", 0).await;
        publisher.publish("/t", 1).await;
        assert_eq!(subscriber.receive().await["msg"]["n"], 0);
        subscriber
            .send(json!({"op": "unsubscribe", "topic": "/t"}))
            .await;
        assert!(subscriber.hears_nothing_for(Duration::from_secs(9)).await);
    });
}

#[test]
fn a_response_of_the_arm_discards_what_throttling_holds_back_of_its_state() {
    in_virtual_time(async {
        let (gateway, _, calls) = held_back().await;
        let mut client = gateway.connect(WIDE);
        client
            .send(json!({"op": "subscribe", "topic": "/joint_states", "throttle_rate": 1000}))
            .await;
        client.receive().await;
        let publish = |n: u64| Publish {
            topic: Topic::JointStates,
            frame: messages::publish("/joint_states", &json!({"n": n})).into(),
        };
        for n in 0..2 {
            gateway.registry.do_send(publish(n));
        }
        assert_eq!(client.receive().await["msg"]["n"], 0);
        client.call(PARAMS, 7).await;
        settle().await;
        calls.answer();
        assert_eq!(client.receive().await["id"], 7);
        assert!(client.hears_nothing_for(Duration::from_secs(5)).await);
        gateway.registry.do_send(publish(2));
        assert_eq!(
            client.receive().await["msg"]["n"],
            2,
            "1 is from before the response"
        );
    });
}

#[test]
fn a_response_of_the_arm_discards_what_waits_to_be_encoded_of_its_state() {
    in_virtual_time(async {
        let (gateway, _, calls) = held_back().await;
        let mut client = gateway.connect(WIDE);
        client
            .send(json!({"op": "subscribe", "topic": "/joint_states", "fragment_size": 1000}))
            .await;
        client.receive().await;
        let publish = |n: u64, pad: usize| Publish {
            topic: Topic::JointStates,
            frame: messages::publish("/joint_states", &json!({"n": n, "pad": "x".repeat(pad)}))
                .into(),
        };
        client.call(PARAMS, 7).await;
        settle().await;
        for n in 0..4 {
            gateway.registry.do_send(publish(n, 1_000_000));
        }
        calls.answer();
        while client.receive().await["id"] != 7 {}
        assert!(client.hears_nothing_for(Duration::from_secs(5)).await);
        gateway.registry.do_send(publish(4, 0));
        assert_eq!(client.receive().await["msg"]["n"], 4);
    });
}

#[test]
fn a_client_that_takes_nothing_while_responses_wait_is_disconnected_after_twenty_seconds() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut client = gateway.connect(64);
        client.call("/none", 1).await;
        settle().await;
        sleep(STALL_LIMIT - Duration::from_secs(1)).await;
        assert_eq!(gateway.gauges.connections(), 1);
        sleep(Duration::from_secs(2)).await;
        assert_eq!(gateway.gauges.connections(), 0);
        assert_eq!(STALL_LIMIT, Duration::from_secs(20));
    });
}

#[test]
fn every_byte_that_it_takes_gives_a_client_twenty_seconds_more() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut client = gateway.connect(16);
        client.call("/none", 1).await;
        for _ in 0..5 {
            sleep(STALL_LIMIT - Duration::from_secs(1)).await;
            assert_eq!(gateway.gauges.connections(), 1);
            client.take(1).await;
        }
        sleep(STALL_LIMIT + Duration::from_secs(1)).await;
        assert_eq!(gateway.gauges.connections(), 0);
    });
}

#[test]
fn a_client_that_takes_no_topic_message_is_never_disconnected() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut client) = (gateway.connect(WIDE), gateway.connect(64));
        client.subscribe("/t").await;
        publisher.advertise("/t").await;
        for n in 0..1000 {
            publisher.publish("/t", n).await;
            sleep(Duration::from_secs(1)).await;
        }
        assert_eq!(gateway.gauges.connections(), 2);
        assert_eq!(client.receive().await["msg"]["n"], 0);
    });
}

#[test]
fn the_twenty_seconds_begin_with_the_response_not_with_the_messages_before_it() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut publisher, mut client) = (gateway.connect(WIDE), gateway.connect(128));
        client.subscribe("/t").await;
        publisher.advertise("/t").await;
        for n in 0..10 {
            publisher.publish("/t", n).await;
        }
        sleep(Duration::from_secs(60)).await;
        client.call("/none", 1).await;
        sleep(STALL_LIMIT - Duration::from_secs(1)).await;
        assert_eq!(gateway.gauges.connections(), 2);
        sleep(Duration::from_secs(2)).await;
        assert_eq!(gateway.gauges.connections(), 1);
    });
}

#[test]
fn responses_and_messages_leave_in_the_order_in_which_they_were_produced() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut client = gateway.connect(WIDE);
        client.subscribe("/t").await;
        client.advertise("/t").await;
        for n in 0..50 {
            client.publish("/t", n).await;
            client.call("/none", n).await;
            client.send_text("garbage\n").await;
        }
        for n in 0..50 {
            assert_eq!(client.receive().await["msg"]["n"], n);
            assert_eq!(client.receive().await["id"], n);
            assert_eq!(client.receive().await["level"], "error");
        }
    });
}

#[test]
fn the_next_frame_is_taken_only_when_the_last_call_has_ended() {
    in_virtual_time(async {
        let (gateway, _, calls) = held_back().await;
        let mut client = gateway.connect(WIDE);
        client.call(PARAMS, 1).await;
        client.call(PARAMS, 2).await;
        client.call("/none", 3).await;
        settle().await;
        assert_eq!(calls.count(), 1);
        let mut reply = calls.take();
        reply.succeed(&json!({}));
        assert_eq!(id(&client.receive().await), 1);
        assert!(client.hears_nothing_for(Duration::from_secs(60)).await);
        assert_eq!(
            calls.count(),
            0,
            "answered, but not ended: its effects may follow"
        );
        drop(reply);
        settle().await;
        calls.answer();
        assert_eq!(id(&client.receive().await), 2);
        assert_eq!(id(&client.receive().await), 3);
    });
}

#[test]
fn a_call_that_its_node_drops_is_answered_all_the_same() {
    in_virtual_time(async {
        let (gateway, computations, calls) = held_back().await;
        let mut client = gateway.connect(WIDE);
        for (service, held) in [(PARAMS, &calls), (STEP, &computations)] {
            client.call(service, 1).await;
            settle().await;
            drop(held.take());
            let response = client.receive().await;
            assert_eq!(response["result"], false, "{response}");
            assert_eq!(response["id"], 1);
            assert_ne!(response["status"], "");
        }
    });
}

#[test]
fn one_computation_runs_sixteen_wait_and_then_nothing_more_is_read() {
    in_virtual_time(async {
        let (gateway, computations, calls) = held_back().await;
        let mut client = gateway.connect(WIDE);
        // One runs, and one place in the queue is left: another call is still taken.
        for n in 0..16 {
            client.call(STEP, n).await;
        }
        client.call(PARAMS, 100).await;
        settle().await;
        assert_eq!((computations.count(), calls.count()), (1, 1));
        calls.answer();
        assert_eq!(id(&client.receive().await), 100);
        // The queue is full: the call behind it waits in the pipe.
        client.call(STEP, 16).await;
        client.call(PARAMS, 101).await;
        sleep(Duration::from_secs(60)).await;
        assert_eq!((computations.count(), calls.count()), (1, 0));
        computations.answer();
        assert_eq!(id(&client.receive().await), 0);
        settle().await;
        assert_eq!((computations.count(), calls.count()), (1, 1));
        calls.answer();
        assert_eq!(id(&client.receive().await), 101);
        for n in 1..17 {
            computations.answer();
            assert_eq!(id(&client.receive().await), n);
            settle().await;
        }
        assert_eq!(MAX_COMPUTATIONS_WAITING, 16);
    });
}

#[test]
fn computations_of_one_connection_hold_up_no_other() {
    in_virtual_time(async {
        let (gateway, computations, calls) = held_back().await;
        let (mut heavy, mut other) = (gateway.connect(WIDE), gateway.connect(WIDE));
        for n in 0..40 {
            heavy.call(STEP, n).await;
        }
        other.call(STEP, 7).await;
        other.call(PARAMS, 8).await;
        settle().await;
        assert_eq!(
            (computations.count(), calls.count()),
            (2, 1),
            "one of each connection runs"
        );
    });
}

#[test]
fn while_more_than_32_mebibytes_wait_no_computation_starts_and_nothing_is_read() {
    in_virtual_time(async {
        let (gateway, computations, calls) = held_back().await;
        let mut client = gateway.connect(1024);
        for n in 0..2 {
            client.call(STEP, n).await;
        }
        client.call(PARAMS, 2).await;
        settle().await;
        calls.take().refuse("");
        let blob = "x".repeat(MAX_RESPONSES_WAITING + 4096);
        let mut reply = computations.take();
        reply.succeed(&blob);
        drop(reply);
        settle().await;
        client.call(PARAMS, 3).await;
        sleep(Duration::from_secs(15)).await;
        assert_eq!(
            computations.count(),
            0,
            "the next computation waits for room"
        );
        assert_eq!(calls.count(), 0, "the next frame too");
        // A little is taken: now what waits is less than 32 MiB.
        client.take(8192).await;
        settle().await;
        assert_eq!((computations.count(), calls.count()), (1, 1));
    });
}

/// A stream that notes every write as a frame count, and takes all of it.
struct Noting {
    input: DuplexStream,
    writes: Rc<RefCell<Vec<usize>>>,
}

impl AsyncRead for Noting {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.input).poll_read(context, buffer)
    }
}

impl AsyncWrite for Noting {
    fn poll_write(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<std::io::Result<usize>> {
        self.poll_write_vectored(context, &[IoSlice::new(bytes)])
    }

    fn poll_write_vectored(
        self: Pin<&mut Self>,
        _: &mut Context<'_>,
        slices: &[IoSlice<'_>],
    ) -> Poll<std::io::Result<usize>> {
        let bytes: Vec<u8> = slices.iter().flat_map(|slice| slice.to_vec()).collect();
        let frames = bytes.iter().filter(|&&byte| byte == b'\n').count();
        self.writes.borrow_mut().push(frames);
        Poll::Ready(Ok(bytes.len()))
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<std::io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<std::io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}

#[test]
fn several_frames_leave_in_one_write_but_not_to_a_client_that_ends_no_line() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        for (end, expected) in [("\n", vec![1, 5]), ("", vec![1, 1, 1, 1, 1, 1])] {
            let writes = Rc::default();
            let (mut client, input) = tokio::io::duplex(WIDE);
            let stream = Noting {
                input,
                writes: Rc::clone(&writes),
            };
            Connection::start_on(
                stream,
                gateway.registry.clone(),
                Arc::clone(&gateway.gauges),
            );
            let subscribe = format!("{{\"op\":\"subscribe\",\"topic\":\"/joint_states\"}}{end}");
            client.write_all(subscribe.as_bytes()).await.unwrap();
            settle().await;
            for n in 0..5 {
                gateway.registry.do_send(Publish {
                    topic: Topic::JointStates,
                    frame: messages::publish("/joint_states", &json!({"n": n})).into(),
                });
            }
            settle().await;
            assert_eq!(*writes.borrow(), expected);
        }
    });
}

//! The registry in virtual time: timeouts, interest, the limit of connections, what is withdrawn.
//!
//! **Invariant:** nodes are closures that record their messages; the rest is the real runtime.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, Node, WIDE, assert_elapsed, settle};
use pendularm::actors::gateway::connection::admission::{Admission, MAX_NEWCOMERS};
use pendularm::actors::gateway::connection::{Connection, Ends};
use pendularm::actors::gateway::limits::{DEFAULT_TIMEOUT, KEPT_PLACES, OPENING_TIME};
use pendularm::actors::gateway::messages::Publish;
use pendularm::actors::gateway::registry::Nodes;
use pendularm::options::DEFAULT_CLIENTS;
use pendularm::protocol::catalog::{Direction, Service, Topic};
use pendularm::protocol::messages;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, duplex};
use tokio::time::{Instant, sleep};

/// Places that any client may have.
const ORDINARY: usize = DEFAULT_CLIENTS - KEPT_PLACES;

/// Shared by a test and its nodes.
type Log<T> = Rc<RefCell<Vec<T>>>;

/// Where the process has stood still, answer and timeout are heard of at the same moment, and the answer may be the first.
#[test]
fn an_answer_after_its_time_is_too_late_even_if_nobody_has_looked_at_the_clock_since() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut provider, mut caller) = (gateway.connect(WIDE), gateway.connect(WIDE));
        provider.provide("/s").await;
        caller.call("/s", 1).await;
        let call = provider.receive().await;
        provider.answer(&call, json!({})).await;
        tokio::time::advance(DEFAULT_TIMEOUT + Duration::from_secs(1)).await;
        let response = caller.receive().await;
        assert_eq!(response["result"], false, "{response}");
        assert!(response["status"].as_str().unwrap().contains("timeout"));
        assert_eq!(provider.receive().await["level"], "error");
    });
}

#[test]
fn a_node_hears_of_the_first_subscriber_and_of_the_end_of_the_last() {
    in_virtual_time(async {
        let heard: Log<(Topic, bool)> = Rc::default();
        let log = Rc::clone(&heard);
        let node = Node {
            on_interest: Box::new(move |interest| {
                log.borrow_mut().push((interest.topic, interest.wanted));
            }),
            ..Node::default()
        };
        let mut nodes = Nodes::default();
        node.attach(&mut nodes, &[], &[Topic::JointStates, Topic::Clock]);
        let gateway = Gateway::with(nodes).await;
        let (mut first, mut second) = (gateway.connect(WIDE), gateway.connect(WIDE));
        first.subscribe("/joint_states").await;
        first.subscribe("/joint_states").await;
        second.subscribe("/joint_states").await;
        second.subscribe("/clock").await;
        second.subscribe("/somebody_elses").await;
        first
            .send(json!({"op": "unsubscribe", "topic": "/joint_states"}))
            .await;
        first
            .send(json!({"op": "unsubscribe", "topic": "/joint_states"}))
            .await;
        settle().await;
        let wanted = [(Topic::JointStates, true), (Topic::Clock, true)];
        assert_eq!(*heard.borrow(), wanted);
        heard.borrow_mut().clear();
        drop(second);
        settle().await;
        let mut ended = heard.borrow().clone();
        ended.sort_unstable();
        assert_eq!(ended, [(Topic::JointStates, false), (Topic::Clock, false)]);
    });
}

#[test]
fn a_message_of_a_node_on_a_topic_that_the_runtime_listens_to_reaches_clients_and_not_the_listener()
{
    in_virtual_time(async {
        let heard: Log<String> = Rc::default();
        let log = Rc::clone(&heard);
        let node = Node {
            on_message: Box::new(move |message| {
                log.borrow_mut().push(message.msg.get().to_owned());
            }),
            ..Node::default()
        };
        let mut nodes = Nodes::default();
        node.attach(&mut nodes, &[], &[Topic::JointTrajectory]);
        let gateway = Gateway::with(nodes).await;
        let mut client = gateway.connect(WIDE);
        client.subscribe("/joint_trajectory").await;
        let msg = json!({"points": []});
        gateway.registry.do_send(Publish {
            topic: Topic::JointTrajectory,
            frame: messages::publish("/joint_trajectory", &msg).into(),
        });
        assert_eq!(client.receive().await["msg"], msg);
        settle().await;
        let heard = heard.borrow();
        assert!(heard.is_empty(), "nodes ask one another by messages");
    });
}

/// The sender's next frame waits until the node is done with its message.
#[test]
fn a_trajectory_has_taken_effect_before_its_senders_next_frame_is_taken() {
    in_virtual_time(async {
        let held = Rc::new(RefCell::new(Vec::new()));
        let log = Rc::clone(&held);
        let node = Node {
            on_message: Box::new(move |message| log.borrow_mut().push(message)),
            ..Node::default()
        };
        let mut nodes = Nodes::default();
        node.attach(&mut nodes, &[], &[Topic::JointTrajectory]);
        let gateway = Gateway::with(nodes).await;
        let (mut client, mut other) = (gateway.connect(WIDE), gateway.connect(WIDE));
        client.publish("/joint_trajectory", 1).await;
        client.publish("/joint_trajectory", 2).await;
        client.call("/none", 1).await;
        assert!(client.hears_nothing_for(Duration::from_secs(60)).await);
        assert_eq!(held.borrow().len(), 1);
        other.call("/none", 2).await;
        assert_eq!(other.receive().await["id"], 2, "nobody else waits");
        held.borrow_mut().clear();
        settle().await;
        assert_eq!(held.borrow().len(), 1);
        held.borrow_mut().clear();
        assert_eq!(client.receive().await["id"], 1);
    });
}

#[test]
fn a_service_without_a_node_is_refused() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut client = gateway.connect(WIDE);
        for service in Service::ALL {
            client.call(service.name(), 1).await;
            let response = client.receive().await;
            assert_eq!(response["result"], false, "{response}");
            assert!(
                response["status"]
                    .as_str()
                    .unwrap()
                    .contains(service.name()),
                "{response}"
            );
        }
    });
}

/// A command finds a kept place where no other is free, and waits for one for a moment where those are taken.
#[test]
fn a_command_has_a_kept_place_and_waits_for_it() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let silent: Vec<_> = (0..ORDINARY).map(|_| gateway.connect(1024)).collect();
        settle().await;
        let mut commands = Vec::new();
        for _ in 0..KEPT_PLACES {
            let mut command = gateway.connect(WIDE);
            command.send(json!({"op": "auth", "command": true})).await;
            command.call("/none", 1).await;
            assert_eq!(command.receive().await["id"], 1);
            commands.push(command);
        }
        let began = Instant::now();
        let mut late = gateway.connect(WIDE);
        late.send(json!({"op": "auth", "command": true})).await;
        let told = late.rest().await;
        assert!(
            told[0]["msg"]
                .as_str()
                .unwrap()
                .contains("too many connections")
        );
        assert!(began.elapsed() >= OPENING_TIME && began.elapsed() < 2 * OPENING_TIME);
        let mut waiting = gateway.connect(WIDE);
        waiting.send(json!({"op": "auth", "command": true})).await;
        waiting.call("/none", 2).await;
        sleep(OPENING_TIME / 2).await;
        commands.pop();
        assert_eq!(waiting.receive().await["id"], 2);
        drop(silent);
    });
}

/// When too many silent clients wait for a place, the oldest gets a message at once.
#[test]
fn so_many_clients_wait_for_a_place_and_no_more() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let silent: Vec<_> = (0..ORDINARY).map(|_| gateway.connect(1024)).collect();
        settle().await;
        let began = Instant::now();
        // The clients of a listener share what admits them.
        let admission: Arc<Admission> = Arc::default();
        let mut waiting = Vec::new();
        for _ in 0..=MAX_NEWCOMERS {
            let (ours, theirs) = duplex(1024);
            let (registry, gauges) = (gateway.registry.clone(), Arc::clone(&gateway.gauges));
            let ends = Ends::default();
            Connection::start_with(Arc::clone(&admission), ends, theirs, registry, gauges);
            waiting.push(ours);
        }
        let mut told = String::new();
        waiting[0].read_to_string(&mut told).await.unwrap();
        assert!(told.contains("too many connections"), "{told}");
        assert!(began.elapsed() < OPENING_TIME / 2);
        told.clear();
        waiting[1].read_to_string(&mut told).await.unwrap();
        assert_elapsed(began, OPENING_TIME);
        drop(silent);
    });
}

#[test]
fn one_client_too_many_is_told_so_and_closed_and_there_is_room_again() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut clients: Vec<_> = (0..ORDINARY).map(|_| gateway.connect(1024)).collect();
        settle().await;
        assert_eq!(gateway.gauges.connections(), ORDINARY as u64);
        let began = Instant::now();
        let mut late = gateway.connect(1024);
        let frames: Vec<Value> = late.rest().await;
        assert_elapsed(began, OPENING_TIME);
        assert_eq!(frames.len(), 1);
        assert_eq!(frames[0]["level"], "error");
        let msg = frames[0]["msg"].as_str().unwrap();
        assert!(
            msg.contains(&format!("serves {DEFAULT_CLIENTS} clients")),
            "{msg}"
        );
        assert!(msg.contains("--clients"), "{msg}");
        // A client that sends a request gets the message at once.
        let began = Instant::now();
        let mut asking = gateway.connect(1024);
        asking.call("/none", 1).await;
        assert_eq!(asking.rest().await[0]["msg"], msg);
        assert_elapsed(began, Duration::ZERO);
        clients.truncate(ORDINARY - 1);
        settle().await;
        let mut next = gateway.connect(1024);
        next.call("/none", 1).await;
        assert_eq!(next.receive().await["id"], 1);
        assert_eq!(gateway.gauges.connections(), ORDINARY as u64);
    });
}

#[test]
fn a_client_that_comes_and_goes_a_thousand_times_leaves_nothing_behind() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut watcher = gateway.connect(WIDE);
        watcher.subscribe("/t").await;
        for n in 0..1000 {
            let mut client = gateway.connect(WIDE);
            client.subscribe("/t").await;
            client.advertise("/t").await;
            client.provide("/s").await;
            client.publish("/t", n).await;
            assert_eq!(watcher.receive().await["msg"]["n"], n);
        }
        settle().await;
        assert_eq!(gateway.gauges.connections(), 1);
        watcher.call("/s", 1).await;
        assert!(
            watcher.receive().await["status"]
                .as_str()
                .unwrap()
                .contains("no provider")
        );
    });
}

#[test]
fn clients_can_neither_advertise_nor_publish_a_topic_of_the_runtime() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut client = gateway.connect(WIDE);
        let ours = |topic: &Topic| topic.direction() == Direction::Published;
        for topic in Topic::ALL.into_iter().filter(ours) {
            for op in ["advertise", "publish"] {
                let frame = json!({"op": op, "topic": topic.name(), "msg": {}});
                client.send(frame).await;
                assert_eq!(client.receive().await["level"], "error", "{op} {topic:?}");
            }
        }
    });
}

//! The registry and its nodes in virtual time: interest, and messages that the runtime listens to. `exchanges/places.txt` has the limit of
//! connections.
//!
//! **Invariant:** nodes are closures that record their messages; the rest is the real runtime.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use crate::stage::Stage;
use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, WIDE, route, settle, stand_in};
use pendularm::actors::gateway::registry::{Connect, Nodes, Outlets, ToClient};
use pendularm::actors::node::{Interest, Publish, TopicMessage};
use pendularm::actors::resources::gone::Gone;
use pendularm::protocol::catalog::Topic;
use pendularm::protocol::messages;
use serde_json::json;

/// Shared by a test and its nodes.
type Log<T> = Rc<RefCell<Vec<T>>>;

#[test]
fn a_node_is_notified_of_the_first_subscriber_and_of_the_end_of_the_last() {
    in_virtual_time(async {
        let received: Log<(Topic, bool)> = Rc::default();
        let log = Rc::clone(&received);
        let node = stand_in(move |Interest { topic, wanted }| {
            log.borrow_mut().push((topic, wanted));
        });
        let mut nodes = Nodes::default();
        for topic in [Topic::JointStates, Topic::Clock] {
            nodes.publishers.insert(topic, node.clone());
        }
        let gateway = Gateway::with(nodes).await;
        let (mut first, mut second) = (gateway.connect(WIDE), gateway.connect(WIDE));
        first.subscribe("/joint_states").await;
        first.subscribe("/joint_states").await;
        second.subscribe("/joint_states").await;
        second.subscribe("/clock").await;
        second.subscribe("/somebody_elses").await;
        for _ in 0..2 {
            let unsubscribe = json!({"op": "unsubscribe", "topic": "/joint_states"});
            first.send(&unsubscribe).await;
        }
        settle().await;
        let wanted = [(Topic::JointStates, true), (Topic::Clock, true)];
        assert_eq!(*received.borrow(), wanted);
        received.borrow_mut().clear();
        drop(second);
        settle().await;
        let mut ended = received.borrow().clone();
        ended.sort_unstable();
        assert_eq!(ended, [(Topic::JointStates, false), (Topic::Clock, false)]);
    });
}

#[test]
fn a_place_that_nobody_receives_is_free_again() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let outlets = Outlets {
            mailbox: stand_in(|_: ToClient| {}),
            backlog: Arc::default(),
            gone: Gone::default(),
        };
        let answer = gateway.registry.send(Connect {
            outlets,
            from: [127, 0, 0, 1].into(),
            may_use_kept: false,
        });
        settle().await;
        assert_eq!(gateway.gauges.connections(), 1);
        drop(answer);
        settle().await;
        assert_eq!(gateway.gauges.connections(), 0);
    });
}

#[test]
fn a_nodes_message_on_a_topic_of_the_runtime_reaches_clients_but_not_the_listener() {
    in_virtual_time(async {
        let (gateway, received) = listening().await;
        let mut client = gateway.connect(WIDE);
        client.subscribe("/joint_trajectory").await;
        let msg = json!({"points": []});
        let frame = messages::publish("/joint_trajectory", &msg);
        gateway.registry.do_send(Publish {
            topic: Topic::JointTrajectory,
            frame: Box::new(move || frame),
        });
        assert_eq!(client.receive().await["msg"], msg);
        settle().await;
        let received = received.borrow();
        assert!(received.is_empty(), "nodes ask one another by messages");
    });
}

/// A gateway with a node that keeps the trajectories it gets.
async fn listening() -> (Gateway, Log<TopicMessage>) {
    let kept: Log<TopicMessage> = Rc::default();
    let log = Rc::clone(&kept);
    let keep = route(move |message| log.borrow_mut().push(message));
    let mut nodes = Nodes::default();
    nodes.subscribers.insert(Topic::JointTrajectory, keep);
    (Gateway::with(nodes).await, kept)
}

/// The sender's next frame waits until the node has handled its message.
#[test]
fn a_trajectory_has_taken_effect_before_its_senders_next_frame_is_taken() {
    in_virtual_time(async {
        let (gateway, held) = listening().await;
        let (mut client, mut other) = (gateway.connect(WIDE), gateway.connect(WIDE));
        let call = |id| json!({"op": "call_service", "service": "/none", "id": id});
        for n in 1..=2 {
            let msg = json!({"n": n});
            let publish = json!({"op": "publish", "topic": "/joint_trajectory", "msg": msg});
            client.send(&publish).await;
        }
        client.send(&call(1)).await;
        assert!(client.receives_nothing_for(Duration::from_secs(60)).await);
        assert_eq!(held.borrow().len(), 1);
        other.send(&call(2)).await;
        assert_eq!(other.receive().await["id"], 2, "nobody else waits");
        held.borrow_mut().clear();
        settle().await;
        assert_eq!(held.borrow().len(), 1);
        held.borrow_mut().clear();
        assert_eq!(client.receive().await["id"], 1);
    });
}

/// The nodes of goals leave this to the registry.
#[test]
fn a_message_of_a_node_is_made_only_if_its_topic_has_a_subscriber() {
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let mut client = stage.connect();
        let made = Arc::new(AtomicUsize::new(0));
        for expected in [0, 1] {
            let count = Arc::clone(&made);
            let message = Publish::made(Topic::IkResult, move || {
                count.fetch_add(1, Ordering::Relaxed)
            });
            stage.gateway.registry.send(message).await.unwrap();
            assert_eq!(made.load(Ordering::Relaxed), expected);
            client.subscribe(Topic::IkResult.name()).await;
        }
    });
}

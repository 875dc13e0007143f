//! Statuses, responses and topic messages that a client does not read.

use super::*;
use pendularm::actors::gateway::limits::MAX_RESPONSES_WAITING;
use pendularm::actors::gateway::messages::Publish;
use pendularm::protocol::catalog::Topic;
use pendularm::protocol::messages;
use pendularm::protocol::outbox::{FRAME_BYTES, PLACE_BYTES};

const PAUSE: &str = "/arm_sim/pause";

fn answering() -> Nodes {
    let mut nodes = Nodes::default();
    Node::answering().attach(&mut nodes, &[Service::Pause], &[]);
    nodes
}

#[test]
fn statuses_that_are_not_read() {
    in_virtual_time(async {
        let mut scene = Scene::new(WIDE, Nodes::default()).await;
        // The pipe takes more than any outbox: so the answers are counted while they are on their way.
        let mut deaf = Scene::new(KIB, Nodes::default()).await;
        deaf.flood(&"x\n".repeat(400)).await;
        let status = "{\"op\":\"status\",\"level\":\"error\",\"msg\":\"\"}\n".len();
        let held = deaf.held();
        assert!(held > 300 * (status + FRAME_BYTES), "{held}");
        deaf.end().await;
        scene.flood("x\n").await;
        assert_eq!(scene.client.receive().await["level"], "error");
        scene.end().await;
    });
}

/// The smallest answers there are: a client that reads none is not read on when they cost 32 MiB, whatever their text
/// comes to.
#[test]
fn responses_cost_what_they_take_and_a_deaf_client_is_not_read_on_at_32_mib() {
    in_virtual_time(async {
        let mut scene = Scene::new(256 * KIB, answering()).await;
        let call = format!("{{\"op\":\"call_service\",\"service\":\"{PAUSE}\"}}\n");
        let mut held = 0;
        loop {
            scene.flood(&call.repeat(20_000)).await;
            if scene.held() == held {
                break;
            }
            held = scene.held();
            assert!(held < MAX_RESPONSES_WAITING + MIB, "{held}");
        }
        assert!(held > MAX_RESPONSES_WAITING - MIB, "{held}");
        scene.end().await;
    });
}

async fn publish_small(scene: &mut Scene, publisher: &mut Peer, count: usize) {
    publisher.advertise("/t").await;
    for n in 0..count {
        publisher.publish("/t", n as u64).await;
    }
    settle().await;
    let message = "{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{\"n\":0}}\n".len();
    // Messages that were written one behind the other come as a series: one place, one frame.
    let places = (scene.held() / (message + FRAME_BYTES + PLACE_BYTES)).min(count);
    assert!(scene.held() > count * message, "{}", scene.held());
    assert!(places > 0);
}

#[test]
fn small_messages_that_are_not_read() {
    in_virtual_time(async {
        let mut scene = Scene::new(KIB, Nodes::default()).await;
        scene.client.subscribe("/t").await;
        let mut publisher = scene.gateway.connect(WIDE);
        publish_small(&mut scene, &mut publisher, 5000).await;
        drop(publisher);
        scene.end().await;
    });
}

/// A throttle holds back message by message.
#[test]
fn small_messages_that_are_held_back() {
    in_virtual_time(async {
        let mut scene = Scene::new(WIDE, Nodes::default()).await;
        let subscribe = json!({"op": "subscribe", "topic": "/t", "throttle_rate": 1_000_000, "queue_length": 10_000});
        scene.client.send(subscribe).await;
        let mut publisher = scene.gateway.connect(WIDE);
        settle().await;
        publish_small(&mut scene, &mut publisher, 5000).await;
        let message = "{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{\"n\":0}}\n".len();
        scene.holds(4999 * (message + FRAME_BYTES + PLACE_BYTES));
        drop(publisher);
        scene.end().await;
    });
}

/// Under the spelling that it has not itself, a latched message is a copy for each who hears it.
#[test]
fn latched_messages_of_another_spelling_that_are_not_read() {
    const SIZE: usize = 20_000;
    const COUNT: usize = 50;
    in_virtual_time(async {
        let mut scene = Scene::new(KIB, Nodes::default()).await;
        // There is a last message while somebody subscribes.
        let mut watcher = scene.gateway.connect(WIDE);
        watcher.subscribe("/robot_description").await;
        let msg = json!({"data": "x".repeat(SIZE)});
        scene.gateway.registry.do_send(Publish {
            topic: Topic::RobotDescription,
            frame: messages::publish("/robot_description", &msg).into(),
        });
        let name = json!("robot_description");
        let mut pairs = format!("{}\n", json!({"op": "set_level", "level": "none"}));
        for _ in 0..COUNT {
            for op in ["subscribe", "unsubscribe"] {
                pairs.push_str(&format!("{}\n", json!({"op": op, "topic": name})));
            }
        }
        scene.flood(&pairs).await;
        let held = scene.held();
        assert!(held > COUNT / 2 * SIZE, "{held}");
        drop(watcher);
        scene.end().await;
    });
}

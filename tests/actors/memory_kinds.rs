//! Each kind of memory that a client can make the program hold: all of it is counted, and all of it is given back. In virtual time.
//!
//! **Invariant:** what is counted is at least what is allocated; the test says how much that is.

use std::sync::Mutex;
use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, Held, Node, Peer, WIDE, settle};
use pendularm::actors::gateway::limits::{
    CALL_BYTES, MAX_RESPONSES_WAITING, REGISTRATION_BYTES, STALL_LIMIT,
};
use pendularm::actors::gateway::messages::Publish;
use pendularm::actors::gateway::registry::Nodes;
use pendularm::actors::resources::budget::{CONNECTION_BYTES, Memory};
use pendularm::actors::wire::action_client::{ActionClient, ActionRequest};
use pendularm::protocol::catalog::{Action, Service, Topic};
use pendularm::protocol::messages;
use pendularm::protocol::outbox::{FRAME_BYTES, PLACE_BYTES};
use pendularm::protocol::wire::fragments::PIECE_BYTES;
use serde_json::json;
use tokio::time::sleep;

const KIB: usize = 1024;
const MIB: usize = 1024 * KIB;
const PAUSE: &str = "/arm_sim/pause";

/// A gateway, what it holds, and a client whose pipe holds so much.
struct Scene {
    gateway: Gateway,
    memory: Memory,
    client: Peer,
    /// Bytes that were held before anything was done.
    before: usize,
}

impl Scene {
    async fn new(room: usize, nodes: Nodes) -> Self {
        let memory = Memory::default();
        let gateway = Gateway::within(memory.clone(), nodes).await;
        let client = gateway.connect(room);
        settle().await;
        let before = memory.held();
        Self {
            gateway,
            memory,
            client,
            before,
        }
    }

    /// Sends text as far as it is read.
    async fn flood(&mut self, text: &str) {
        self.client.offer(text).await;
        settle().await;
    }

    fn held(&self) -> usize {
        self.memory.held() - self.before
    }

    /// At least so much is counted now, and at most twice that and what a connection's buffers may take.
    fn holds(&self, bytes: usize) {
        let held = self.held();
        assert!(held >= bytes, "{held} counted of {bytes}");
        assert!(held <= 2 * bytes + MIB, "{held} counted for {bytes}");
    }

    /// The client leaves: nothing is held for it any more.
    async fn end(self) {
        let (memory, gateway) = (self.memory.clone(), self.gateway);
        drop(self.client);
        settle().await;
        for _ in 0..3 {
            if memory.held() > 0 {
                sleep(STALL_LIMIT + Duration::from_secs(20)).await;
            }
        }
        assert_eq!((gateway.gauges.connections(), memory.held()), (0, 0));
    }
}

fn answering() -> Nodes {
    let mut nodes = Nodes::default();
    let node = Node {
        on_call: Box::new(|mut call| call.caller.succeed(&json!({}))),
        ..Node::default()
    };
    node.attach(&mut nodes, &[Service::Pause], &[]);
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

/// The smallest answers there are: a client that reads none is not read on when they cost 32 MiB, whatever their text comes to.
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

#[test]
fn a_frame_that_is_not_complete() {
    in_virtual_time(async {
        let mut scene = Scene::new(WIDE, Nodes::default()).await;
        let begun = format!("{{\"op\":\"publish\",\"msg\":\"{}", "x".repeat(3 * MIB));
        scene.flood(&begun).await;
        scene.holds(3 * MIB);
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

#[test]
fn a_frame_that_is_skipped_is_not_kept() {
    in_virtual_time(async {
        let mut scene = Scene::new(WIDE, Nodes::default()).await;
        let long = format!("{{\"op\":\"publish\",\"msg\":\"{}", "x".repeat(9 * MIB));
        scene.flood(&long).await;
        assert_eq!(scene.client.receive().await["level"], "error");
        settle().await;
        assert!(scene.held() < MIB, "{}", scene.held());
        scene.end().await;
    });
}

#[test]
fn fragments_without_text() {
    in_virtual_time(async {
        let mut scene = Scene::new(WIDE, Nodes::default()).await;
        for message in 0..8 {
            for num in 0..1000 {
                let piece =
                    json!({"op": "fragment", "id": message, "num": num, "total": 4096, "data": ""});
                scene.client.send(piece).await;
            }
        }
        settle().await;
        scene.holds(8000 * PIECE_BYTES);
        // They are forgotten when they are old, though nothing more comes.
        sleep(Duration::from_secs(61)).await;
        settle().await;
        assert!(scene.held() < 200 * KIB, "{}", scene.held());
        scene.end().await;
    });
}

#[test]
fn fragments_with_text() {
    in_virtual_time(async {
        let mut scene = Scene::new(WIDE, Nodes::default()).await;
        for num in 0..6 {
            let data = "x".repeat(MIB / 2);
            let piece = json!({"op": "fragment", "id": 1, "num": num, "total": 7, "data": data});
            scene.client.send(piece).await;
        }
        settle().await;
        scene.holds(3 * MIB);
        scene.end().await;
    });
}

#[test]
fn subscriptions_topics_and_services() {
    in_virtual_time(async {
        let mut scene = Scene::new(WIDE, Nodes::default()).await;
        let quiet = json!({"op": "set_level", "level": "none"});
        scene.client.send(quiet).await;
        let long = "x".repeat(900);
        for n in 0..200 {
            let name = format!("/{n}/{long}");
            for frame in [
                // One topic under many ids, and as many topics.
                json!({"op": "subscribe", "topic": "/t", "id": name}),
                json!({"op": "subscribe", "topic": name, "type": "a/b"}),
                json!({"op": "advertise", "topic": name, "type": "a/b"}),
                json!({"op": "advertise_service", "service": name, "type": "a/b"}),
            ] {
                scene.client.send(frame).await;
            }
        }
        settle().await;
        scene.holds(800 * (REGISTRATION_BYTES + 3 * 900));
        for n in 0..200 {
            let name = format!("/{n}/{long}");
            for frame in [
                json!({"op": "unsubscribe", "topic": "/t", "id": name}),
                json!({"op": "unsubscribe", "topic": name}),
                json!({"op": "unadvertise", "topic": name}),
                json!({"op": "unadvertise_service", "service": name}),
            ] {
                scene.client.send(frame).await;
            }
        }
        settle().await;
        assert!(scene.held() < 300 * KIB, "{}", scene.held());
        scene.end().await;
    });
}

/// A service that goes to another provider is not the first one's any more.
#[test]
fn a_service_that_another_provides_is_charged_to_that_one() {
    in_virtual_time(async {
        let mut scene = Scene::new(WIDE, Nodes::default()).await;
        let mut other = scene.gateway.connect(WIDE);
        scene.client.provide("/s").await;
        other.provide("/s").await;
        drop(other);
        settle().await;
        let kept = scene.held();
        assert!(kept < REGISTRATION_BYTES + 200 * KIB, "{kept}");
        scene.end().await;
    });
}

/// Calls that wait for a day, and the answered ones, of which nothing is left.
#[test]
fn calls_that_wait() {
    in_virtual_time(async {
        let mut scene = Scene::new(WIDE, Nodes::default()).await;
        let mut provider = scene.gateway.connect(WIDE);
        provider.provide("/s").await;
        let id = "x".repeat(10_000);
        let call = |n: usize| json!({"op": "call_service", "service": "/s", "id": format!("{n}{id}"), "timeout": 86_400});
        scene.client.send(call(0)).await;
        let request = provider.receive().await;
        provider.answer(&request, json!({})).await;
        scene.client.receive().await;
        settle().await;
        // From here on buffers have their size.
        let idle = scene.held();
        for n in 0..100 {
            scene.client.send(call(n)).await;
        }
        let mut requests = Vec::new();
        for _ in 0..100 {
            requests.push(provider.receive().await);
        }
        settle().await;
        let waiting = scene.held() - idle;
        let expected = 100 * (CALL_BYTES + 10_000);
        assert!(
            (expected..expected * 2).contains(&waiting),
            "{waiting} for {expected}"
        );
        for request in &requests {
            provider.answer(request, json!({})).await;
            scene.client.receive().await;
        }
        settle().await;
        let left = scene.held() - idle;
        assert!(left < 20 * CALL_BYTES, "{left}: some are left");
        drop(provider);
        scene.end().await;
    });
}

#[test]
fn requests_of_computations_that_wait() {
    in_virtual_time(async {
        let held = Held::default();
        let mut nodes = Nodes::default();
        Node::holding(&held).attach(&mut nodes, &[Service::IntegrationStep], &[]);
        let mut scene = Scene::new(WIDE, nodes).await;
        for id in 0..8 {
            let call = json!({"op": "call_service", "service": "/arm_sim/integration_step", "id": id,
                "args": {"function": "x".repeat(MIB)}});
            scene.client.send(call).await;
        }
        settle().await;
        scene.holds(8 * MIB);
        for _ in 0..8 {
            held.answer();
            settle().await;
            scene.client.receive().await;
        }
        settle().await;
        assert!(scene.held() < MIB, "{}", scene.held());
        scene.end().await;
    });
}

/// Messages that wait have been read already: their text is gone, and beside what came there is the line that is written of it, if that is another.
#[test]
fn arguments_are_counted_as_they_are_kept() {
    // As they came and as they are written: the same; shorter by one of six; both longer than the text, six and five for four.
    for (entry, kept) in [("1000,", 5), ("1e999,", 6 + 5), ("NaN,", 6 + 5)] {
        in_virtual_time(async {
            let held = Held::default();
            let mut nodes = Nodes::default();
            Node::holding(&held).attach(&mut nodes, &[Service::IntegrationStep], &[]);
            let mut scene = Scene::new(WIDE, nodes).await;
            let count = MIB / entry.len();
            let entries = entry.repeat(count);
            for id in 0..8 {
                let call = format!(
                    r#"{{"op":"call_service","service":"/arm_sim/integration_step","id":{id},"args":{{"x":[{entries}0]}}}}"#
                );
                scene.client.send_text(&(call + "\n")).await;
            }
            settle().await;
            let (waiting, expected) = (scene.held(), 8 * kept * count);
            assert!(
                (expected..expected + MIB / 2).contains(&waiting),
                "{entry} {waiting} for {expected}"
            );
            for _ in 0..8 {
                held.answer();
                settle().await;
                scene.client.receive().await;
            }
            scene.end().await;
        });
    }
}

#[test]
fn ids_of_goals_that_are_pursued() {
    const COUNT: usize = 300;
    const ID: usize = 1000;
    in_virtual_time(async {
        // A node that sets every goal in motion and reaches none.
        let pursued = Mutex::new(Vec::<ActionClient>::new());
        let pursue = move |request| {
            let mut pursued = pursued.lock().unwrap();
            match request {
                ActionRequest::Goal { client, .. } => pursued.push(client),
                ActionRequest::Cancel { from, .. } => pursued.retain(|one| !one.is(&from.goal)),
            }
        };
        let mut nodes = Nodes::default();
        nodes.actions.insert(Action::MoveTo, Box::new(pursue));
        let mut scene = Scene::new(WIDE, nodes).await;
        let id = |n: usize| format!("{n}{}", "x".repeat(ID));
        for n in 0..COUNT {
            let goal =
                json!({"op": "send_action_goal", "action": "/ik_action", "id": id(n), "args": {}});
            scene.client.send(goal).await;
        }
        settle().await;
        let pursued = scene.held();
        let expected = COUNT * ID;
        assert!(
            (expected..2 * expected).contains(&pursued),
            "{pursued} for {expected}"
        );
        for n in 0..COUNT {
            let end = json!({"op": "cancel_action_goal", "action": "/ik_action", "id": id(n)});
            scene.client.send(end).await;
        }
        settle().await;
        assert!(scene.held() < expected / 2, "{}", scene.held());
        scene.end().await;
    });
}

/// From the first moment on: who says nothing, and who has begun a request, has a buffer as well.
#[test]
fn what_is_read_before_it_is_clear_who_comes() {
    in_virtual_time(async {
        let memory = Memory::default();
        let gateway = Gateway::within(memory.clone(), Nodes::default()).await;
        let mut clients = Vec::new();
        for head in ["", " ", "GE", "GET / HTTP/1.1\r\nX: "] {
            let before = memory.held();
            let mut client = gateway.connect(WIDE);
            client.offer(head).await;
            settle().await;
            let counted = memory.held() - before;
            assert_eq!(counted, CONNECTION_BYTES + 64 * KIB, "{head}");
            clients.push(client);
        }
        drop(clients);
        settle().await;
        assert_eq!(memory.held(), 0);
    });
}

//! A panic ends its task or the whole program: each case, with a panic that only a test can cause.
//!
//! A panic in a computation is in `src/actors/compute/workers/tests.rs`.
//!
//! **Invariant:** the panic hook belongs to the process, so these tests share one that records panics and ends nothing.

use std::sync::{Arc, Mutex, OnceLock};
use std::time::Duration;

use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, WIDE, Watched, route, settle};
use bytes::Bytes;
use pendularm::actors::gateway::connection::{self, Ends};
use pendularm::actors::gateway::registry::Nodes;
use pendularm::actors::node::Publish;
use pendularm::actors::panics::{self, contain};
use pendularm::protocol::catalog::{Service, Topic};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::time::timeout;

static ENDS: OnceLock<Mutex<Vec<String>>> = OnceLock::new();

/// Panics that would have ended the process so far.
fn ends() -> Vec<String> {
    let ends = ENDS.get_or_init(|| {
        panics::end_with(|what| {
            ENDS.get().unwrap().lock().unwrap().push(what.to_owned());
        });
        Mutex::default()
    });
    ends.lock().unwrap().clone()
}

/// A call with the id 1.
fn call(service: &str) -> Value {
    pendularm_client::call(service, &json!({}), &json!(1))
}

fn has_ended_by(words: &str) -> bool {
    ends().iter().any(|what| what.contains(words))
}

/// The client is disconnected, its registrations are withdrawn, and the others are served.
#[test]
fn a_panic_in_a_reader_or_writer_ends_that_client_alone() {
    ends();
    in_virtual_time(async {
        for in_reading in [true, false] {
            let gateway = Gateway::bare().await;
            let mut other = gateway.connect(WIDE);
            let (mut ours, stream) = tokio::io::duplex(WIDE);
            let mut trap = Watched::new(stream);
            if in_reading {
                trap.on_read = Box::new(|bytes| assert!(!bytes.ends_with(b"trap\n"), "in reading"));
            } else {
                trap.on_write = Box::new(|_| panic!("in writing"));
            }
            connection::start(
                None,
                Arc::default(),
                Ends::default(),
                trap,
                gateway.registry.clone(),
                Arc::clone(&gateway.gauges),
            );
            let frames = json!({"op": "advertise_service", "service": "/s"});
            ours.write_all(format!("{frames}\n").as_bytes())
                .await
                .unwrap();
            settle().await;
            let _ = ours.write_all(b"trap\n").await;
            let mut rest = Vec::new();
            let closed = timeout(Duration::from_secs(60), ours.read_to_end(&mut rest)).await;
            assert!(closed.is_ok(), "the stream ends");
            settle().await;
            assert_eq!(gateway.gauges.connections(), 1);
            other.send(&call("/s")).await;
            let response = other.receive().await;
            assert!(
                response["status"].as_str().unwrap().contains("no provider"),
                "{response}"
            );
        }
    });
    assert!(!has_ended_by("in reading") && !has_ended_by("in writing"));
}

/// Bytes that panic when they are dropped, which happens if an outbox is full.
struct Explosive(Vec<u8>, &'static str);

impl AsRef<[u8]> for Explosive {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

impl Drop for Explosive {
    fn drop(&mut self) {
        assert!(std::thread::panicking(), "{}", self.1);
    }
}

#[test]
fn a_panic_in_the_actor_of_a_client_ends_that_client_alone() {
    ends();
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (mut deaf, mut other) = (gateway.connect(1024), gateway.connect(WIDE));
        deaf.subscribe("/joint_states").await;
        other.subscribe("/clock").await;
        for n in 0..4 {
            // The second message is the first one to be dropped.
            let bytes = vec![b' '; 1_000_000];
            let frame = if n == 1 {
                Bytes::from_owner(Explosive(bytes, "in the actor"))
            } else {
                Bytes::from(bytes)
            };
            gateway.registry.do_send(Publish {
                topic: Topic::JointStates,
                frame: Box::new(move || frame),
            });
            settle().await;
            // One message is being written and one waits. The third replaces the waiting one.
            let connections = if n < 2 { 2 } else { 1 };
            assert_eq!(gateway.gauges.connections(), connections, "after {n}");
        }
        let mut rest = Vec::new();
        let reading = deaf.stream().read_to_end(&mut rest);
        let closed = timeout(Duration::from_secs(60), reading).await;
        assert!(closed.is_ok(), "the stream ends");
        other.send(&call("/none")).await;
        assert_eq!(other.receive().await["id"], 1);
    });
    assert!(!has_ended_by("in the actor"));
}

#[test]
fn a_panic_in_a_node_ends_the_process_with_one_line_that_says_where() {
    ends();
    in_virtual_time(async {
        let mut nodes = Nodes::default();
        let trap = route(|_| panic!("in a node\nforged line"));
        nodes.services.insert(Service::Pause, trap);
        let gateway = Gateway::with(nodes).await;
        let mut client = gateway.connect(WIDE);
        client.send(&call("/arm_sim/pause")).await;
        settle().await;
    });
    let ends = ends();
    let line = ends.iter().find(|what| what.contains("in a node")).unwrap();
    assert!(line.contains(file!()) && !line.contains('\n'), "{line}");
}

#[test]
fn a_panic_in_the_registry_ends_the_process() {
    ends();
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut client = gateway.connect(WIDE);
        client.subscribe("/joint_states").await;
        // The registry drops the last copy of a message without subscribers.
        let frame = Bytes::from_owner(Explosive(vec![b'x'; 10], "in the registry"));
        gateway.registry.do_send(Publish {
            topic: Topic::Clock,
            frame: Box::new(move || frame),
        });
        settle().await;
    });
    assert!(has_ended_by("in the registry"), "{:?}", ends());
}

#[test]
fn a_caught_panic_names_its_place() {
    ends();
    let outer = contain(|| {
        let inner = contain(|| panic!("within"));
        assert!(inner.unwrap_err().to_string().contains("within"));
        7
    });
    assert_eq!(outer.unwrap(), 7);
    assert!(!has_ended_by("within"));
}

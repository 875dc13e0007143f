//! What the actor tests share: the gateway's actors on one thread with a paused clock, clients on in-memory pipes, and
//! nodes that are closures.
//!
//! The clock moves only when everything waits for it, so a time that a test reads is exact to the timers' millisecond.

#![allow(
    dead_code,
    unreachable_pub,
    reason = "each test file uses its own part of this"
)]
#![allow(
    clippy::expect_used,
    clippy::unwrap_used,
    clippy::panic,
    reason = "a helper of a test fails by panicking, as a test does"
)]

use std::cell::RefCell;
use std::future::Future;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use pendularm::actors::budget::Totals;
use pendularm::actors::connection::Connection;
use pendularm::actors::gauges::Gauges;
use pendularm::actors::node::{Interest, Reply, ServiceCall, TopicMessage};
use pendularm::actors::registry::{Attach, Nodes, Registry};
use pendularm::protocol::catalog::{Service, Topic};
use serde_json::{Value, json};
use tokio::io::{
    AsyncBufReadExt, AsyncWriteExt, BufReader, DuplexStream, ReadHalf, WriteHalf, duplex, split,
};
use tokio::time::{Instant, sleep, timeout};

/// Longer than anything in here waits.
const LONG: Duration = Duration::from_secs(7 * 24 * 3600);
/// The timers' grain.
pub const GRAIN: Duration = Duration::from_millis(2);
/// The pipe to a client that takes everything at once.
pub const WIDE: usize = 1 << 26;

/// Runs a test on one thread, in virtual time.
pub fn run(test: impl Future<Output = ()>) {
    System::with_tokio_rt(|| {
        tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .start_paused(true)
            .build()
            .expect("a runtime")
    })
    .block_on(test);
}

/// Registry and gauges, with the nodes of a test.
pub struct Gateway {
    pub registry: Addr<Registry>,
    pub gauges: Arc<Gauges>,
}

impl Gateway {
    /// A gateway without nodes.
    pub async fn bare() -> Self {
        Self::with(Nodes::default()).await
    }

    pub async fn with(nodes: Nodes) -> Self {
        Self::within(Totals::default(), nodes).await
    }

    /// A gateway whose clients together may hold so much.
    pub async fn within(totals: Totals, nodes: Nodes) -> Self {
        let gauges = Arc::new(Gauges::with(totals));
        let registry = Registry::new(Arc::clone(&gauges)).start();
        registry.send(Attach(nodes)).await.expect("a registry");
        Self { registry, gauges }
    }

    /// A client whose pipe holds `room` bytes each way.
    pub fn connect(&self, room: usize) -> Peer {
        let (ours, theirs) = duplex(room);
        Connection::start_on(theirs, self.registry.clone(), Arc::clone(&self.gauges));
        let (input, output) = split(ours);
        Peer {
            input: BufReader::new(input),
            output,
        }
    }
}

/// A client on an in-memory pipe.
pub struct Peer {
    input: BufReader<ReadHalf<DuplexStream>>,
    output: WriteHalf<DuplexStream>,
}

impl Peer {
    pub async fn send(&mut self, frame: Value) {
        self.send_text(&format!("{frame}\n")).await;
    }

    pub async fn send_text(&mut self, text: &str) {
        self.output
            .write_all(text.as_bytes())
            .await
            .expect("an open pipe");
    }

    /// Shuts down the writing side.
    pub async fn half_close(&mut self) {
        self.output.shutdown().await.expect("an open pipe");
    }

    pub async fn receive(&mut self) -> Value {
        let mut line = String::new();
        let read = timeout(LONG, self.input.read_line(&mut line)).await;
        assert!(
            read.expect("a frame comes").expect("an open pipe") > 0,
            "the stream ended"
        );
        serde_json::from_str(&line).expect("a frame is JSON")
    }

    /// All frames up to the end of the stream.
    pub async fn rest(&mut self) -> Vec<Value> {
        let mut text = String::new();
        let reading = tokio::io::AsyncReadExt::read_to_string(&mut self.input, &mut text);
        timeout(LONG, reading)
            .await
            .expect("the stream ends")
            .expect("in order");
        text.lines()
            .map(|line| serde_json::from_str(line).expect("a frame is JSON"))
            .collect()
    }

    /// Takes what comes up to the end of the stream.
    pub async fn drain(&mut self) {
        let mut bytes = Vec::new();
        let _ = tokio::io::AsyncReadExt::read_to_end(&mut self.input, &mut bytes).await;
    }

    /// Takes just this many bytes out of the pipe.
    pub async fn take(&mut self, bytes: usize) {
        let mut buffer = vec![0; bytes];
        let reading = tokio::io::AsyncReadExt::read_exact(self.input.get_mut(), &mut buffer);
        timeout(LONG, reading)
            .await
            .expect("they come")
            .expect("an open pipe");
    }

    /// True if nothing comes, not even the end, for so long.
    pub async fn hears_nothing_for(&mut self, time: Duration) -> bool {
        timeout(time, self.input.fill_buf()).await.is_err()
    }

    pub async fn subscribe(&mut self, topic: &str) {
        self.send(json!({"op": "subscribe", "topic": topic})).await;
        assert_eq!(self.receive().await["level"], "info");
    }

    pub async fn advertise(&mut self, topic: &str) {
        self.send(json!({"op": "advertise", "topic": topic})).await;
    }

    pub async fn provide(&mut self, service: &str) {
        self.send(json!({"op": "advertise_service", "service": service}))
            .await;
        assert_eq!(self.receive().await["level"], "info");
    }

    pub async fn publish(&mut self, topic: &str, n: u64) {
        self.send(json!({"op": "publish", "topic": topic, "msg": {"n": n}}))
            .await;
    }

    pub async fn call(&mut self, service: &str, id: u64) {
        self.send(json!({"op": "call_service", "service": service, "id": id}))
            .await;
    }

    /// Answers a call that this client has received as a provider.
    pub async fn answer(&mut self, call: &Value, values: Value) {
        let (service, id) = (&call["service"], &call["id"]);
        self.send(json!({"op": "service_response", "service": service, "id": id, "values": values, "result": true}))
            .await;
    }
}

/// Lets everything happen that needs no time, and what needs next to none.
pub async fn settle() {
    sleep(Duration::from_millis(10)).await;
}

/// A node that keeps the calls that come, unanswered.
#[derive(Clone, Default)]
pub struct Held(pub Rc<RefCell<Vec<ServiceCall>>>);

impl Held {
    pub fn count(&self) -> usize {
        self.0.borrow().len()
    }

    /// The oldest call that is held.
    pub fn take(&self) -> Reply {
        self.0.borrow_mut().remove(0).reply
    }

    /// Answers the oldest call.
    pub fn answer(&self) {
        self.take().succeed(&json!({}));
    }
}

/// A node: hands what it is sent to closures.
pub struct Node {
    pub on_call: Box<dyn FnMut(ServiceCall)>,
    pub on_message: Box<dyn FnMut(TopicMessage)>,
    pub on_interest: Box<dyn FnMut(Interest)>,
}

impl Default for Node {
    fn default() -> Self {
        Self {
            on_call: Box::new(drop),
            on_message: Box::new(drop),
            on_interest: Box::new(drop),
        }
    }
}

impl Node {
    /// A node that keeps its calls.
    pub fn holding(held: &Held) -> Self {
        let held = held.clone();
        Self {
            on_call: Box::new(move |call| held.0.borrow_mut().push(call)),
            ..Self::default()
        }
    }

    /// Starts it as the one that serves `services`, takes and publishes `topics`.
    pub fn attach(self, nodes: &mut Nodes, services: &[Service], topics: &[Topic]) {
        let address = self.start();
        for service in services {
            nodes.services.insert(*service, address.clone().recipient());
        }
        for topic in topics {
            nodes.listeners.insert(*topic, address.clone().recipient());
            nodes.publishers.insert(*topic, address.clone().recipient());
        }
    }
}

impl Actor for Node {
    type Context = Context<Self>;
}

impl Handler<ServiceCall> for Node {
    type Result = ();
    fn handle(&mut self, call: ServiceCall, _: &mut Context<Self>) {
        (self.on_call)(call);
    }
}

impl Handler<TopicMessage> for Node {
    type Result = ();
    fn handle(&mut self, message: TopicMessage, _: &mut Context<Self>) {
        (self.on_message)(message);
    }
}

impl Handler<Interest> for Node {
    type Result = ();
    fn handle(&mut self, interest: Interest, _: &mut Context<Self>) {
        (self.on_interest)(interest);
    }
}

/// Asserts that `since` is `expected` ago.
pub fn assert_elapsed(since: Instant, expected: Duration) {
    let elapsed = since.elapsed();
    assert!(
        elapsed >= expected && elapsed <= expected + 10 * GRAIN,
        "{elapsed:?} instead of {expected:?}"
    );
}

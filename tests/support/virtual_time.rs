//! Parts that the actor tests share: the gateway's actors on one thread with a paused clock, clients on in-memory pipes, and
//! nodes that are closures.
//!
//! The clock moves only when everything waits for it, so a time that a test reads is exact to the timers' millisecond.

use std::cell::{Cell, RefCell};
use std::io::{self, IoSlice};
use std::net::SocketAddr;
use std::ops::{Deref, DerefMut};
use std::pin::Pin;
use std::rc::Rc;
use std::sync::Arc;
use std::task::{self, Poll};
use std::time::Duration;

use actix::prelude::*;
use pendularm::actors::gateway::connection::Connection;
use pendularm::actors::gateway::connection::admission::Admission;
use pendularm::actors::gateway::registry::{Attach, Registry};
use pendularm::actors::node::{Caller, Interest, Nodes, ServiceCall, TopicMessage};
use pendularm::actors::resources::gauges::Gauges;
use pendularm::actors::resources::memory::Memory;
use pendularm::protocol::catalog::{Service, Topic};
use pendularm_client::pipe::Client;
use serde_json::{Value, json};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, DuplexStream, ReadBuf, duplex};
use tokio::time::{Instant, sleep};

/// Longer than any wait of a test.
const LONG: Duration = Duration::from_secs(7 * 24 * 3600);
/// The timers' grain.
pub const GRAIN: Duration = Duration::from_millis(2);
/// The pipe to a client that reads everything at once.
pub const WIDE: usize = 1 << 26;

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
        Self::within(Memory::default(), nodes).await
    }

    /// A gateway whose clients share this memory for long frames and answers.
    pub async fn within(memory: Memory, nodes: Nodes) -> Self {
        let gauges = Arc::new(Gauges::with(memory));
        let registry = Registry::new(Arc::clone(&gauges)).start();
        registry.send(Attach(nodes)).await.expect("a registry");
        Self { registry, gauges }
    }

    /// The client's end of a new connection under these conditions. Its pipe holds `room` bytes each way.
    pub fn open(&self, admission: Arc<Admission>, room: usize) -> DuplexStream {
        let (ours, theirs) = duplex(room);
        let (registry, gauges) = (self.registry.clone(), Arc::clone(&self.gauges));
        let local = SocketAddr::from(([127, 0, 0, 1], 9095));
        Connection::start_with(None, admission, local, theirs, registry, gauges);
        ours
    }

    /// A client whose pipe holds `room` bytes each way.
    pub fn connect(&self, room: usize) -> Peer {
        Peer(Client::on(self.open(Arc::default(), room), LONG))
    }
}

/// A client on an in-memory pipe.
pub struct Peer(Client<DuplexStream>);

impl Deref for Peer {
    type Target = Client<DuplexStream>;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl DerefMut for Peer {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

impl Peer {
    pub async fn send(&mut self, frame: Value) {
        self.0.send(&frame).await;
    }

    pub async fn send_text(&mut self, text: &str) {
        self.send_bytes(text.as_bytes()).await;
    }

    /// Reads all frames up to the end of the stream.
    pub async fn drain(&mut self) {
        let mut bytes = Vec::new();
        let _ = self.stream().read_to_end(&mut bytes).await;
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
}

/// Runs all work that needs no virtual time, or almost none.
pub async fn settle() {
    sleep(Duration::from_millis(10)).await;
}

/// The number of turns of other tasks during `doing`, and its result.
pub async fn turns_of_others<T>(doing: impl Future<Output = T>) -> (usize, T) {
    let turns = Rc::new(Cell::new(0));
    let counted = Rc::clone(&turns);
    let others = actix_rt::spawn(async move {
        loop {
            counted.set(counted.get() + 1);
            tokio::task::yield_now().await;
        }
    });
    let done = doing.await;
    others.abort();
    (turns.get(), done)
}

type OnBytes = Box<dyn FnMut(&[u8])>;

/// A pipe that shows bytes to closures: after they are read, and before they are written.
pub struct Watched {
    stream: DuplexStream,
    pub on_read: OnBytes,
    pub on_write: OnBytes,
}

impl Watched {
    pub fn new(stream: DuplexStream) -> Self {
        Self {
            stream,
            on_read: Box::new(|_| ()),
            on_write: Box::new(|_| ()),
        }
    }
}

impl AsyncRead for Watched {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut task::Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let polled = Pin::new(&mut self.stream).poll_read(cx, buffer);
        (self.on_read)(&buffer.filled()[before..]);
        polled
    }
}

impl AsyncWrite for Watched {
    fn poll_write(
        self: Pin<&mut Self>,
        cx: &mut task::Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        self.poll_write_vectored(cx, &[IoSlice::new(bytes)])
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut task::Context<'_>,
        slices: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let bytes: Vec<u8> = slices.iter().flat_map(|slice| slice.to_vec()).collect();
        (self.on_write)(&bytes);
        Pin::new(&mut self.stream).poll_write(cx, &bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut task::Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut task::Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

/// A node that keeps received calls unanswered.
#[derive(Clone, Default)]
pub struct Held(pub Rc<RefCell<Vec<ServiceCall>>>);

impl Held {
    pub fn count(&self) -> usize {
        self.0.borrow().len()
    }

    /// The oldest call that is held.
    pub fn take(&self) -> Caller {
        self.0.borrow_mut().remove(0).caller
    }

    /// Answers the oldest call.
    pub fn answer(&self) {
        self.take().succeed(&json!({}));
    }
}

/// A node that passes its messages to closures.
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

    /// A node that answers its calls at once, with nothing.
    pub fn answering() -> Self {
        Self {
            on_call: Box::new(|mut call| call.caller.succeed(&json!({}))),
            ..Self::default()
        }
    }

    /// Starts it as the provider of `services`, and as subscriber and publisher of `topics`.
    pub fn attach(self, nodes: &mut Nodes, services: &[Service], topics: &[Topic]) {
        let address = self.start();
        for service in services {
            let node = address.clone();
            let route = Box::new(move |call| node.do_send(Called(call)));
            nodes.services.insert(*service, route);
        }
        for topic in topics {
            let node = address.clone();
            let route = Box::new(move |message| node.do_send(Sent(message)));
            nodes.subscribers.insert(*topic, route);
            nodes.publishers.insert(*topic, address.clone().recipient());
        }
    }
}

impl Actor for Node {
    type Context = Context<Self>;
}

/// A call, unread.
#[derive(Message)]
#[rtype(result = "()")]
struct Called(ServiceCall);

impl Handler<Called> for Node {
    type Result = ();
    fn handle(&mut self, Called(call): Called, _: &mut Context<Self>) {
        (self.on_call)(call);
    }
}

/// A message on a topic, unread.
#[derive(Message)]
#[rtype(result = "()")]
struct Sent(TopicMessage);

impl Handler<Sent> for Node {
    type Result = ();
    fn handle(&mut self, Sent(message): Sent, _: &mut Context<Self>) {
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

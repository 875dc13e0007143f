//! Parts that the actor tests share: the gateway's actors on one thread with a paused clock, clients on in-memory pipes, and
//! nodes that are closures.
//!
//! The clock moves only when everything waits for it, so a time that a test reads is exact to the timers' millisecond.

use std::cell::Cell;
use std::io::{self, IoSlice};
use std::net::SocketAddr;
use std::pin::Pin;
use std::rc::Rc;
use std::sync::Arc;
use std::task::{self, Poll};
use std::time::Duration;

use actix::prelude::*;
use pendularm::actors::gateway::connection::{self, admission::Admission};
use pendularm::actors::gateway::registry::{Attach, Registry};
use pendularm::actors::node::{Nodes, Route};
use pendularm::actors::resources::gauges::Gauges;
use pendularm::actors::resources::memory::Memory;
use pendularm_client::pipe;
use tokio::io::{AsyncRead, AsyncWrite, DuplexStream, ReadBuf, duplex};
use tokio::time::sleep;

/// Longest virtual time of a wait before a test fails.
const PATIENCE: Duration = Duration::from_secs(600);
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
        connection::start(None, admission, local, theirs, registry, gauges);
        ours
    }

    /// A client whose pipe holds `room` bytes each way.
    pub fn connect(&self, room: usize) -> Client {
        Client::on(self.open(Arc::default(), room), PATIENCE)
    }
}

/// A client on an in-memory pipe.
pub type Client = pipe::Client<DuplexStream>;

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

/// A substitute for a node: it answers each message by a closure.
struct StandIn<M: Message>(Box<dyn FnMut(M) -> M::Result>);

impl<M: Message + 'static> Actor for StandIn<M> {
    type Context = Context<Self>;
}

impl<M: Message<Result: 'static> + 'static> Handler<M> for StandIn<M> {
    type Result = MessageResult<M>;

    fn handle(&mut self, message: M, _: &mut Context<Self>) -> Self::Result {
        MessageResult((self.0)(message))
    }
}

/// A node that answers messages of one type by this closure.
pub fn stand_in<M>(answer: impl FnMut(M) -> M::Result + 'static) -> Recipient<M>
where
    M: Message<Result: Send + 'static> + Send + 'static,
{
    StandIn(Box::new(answer)).start().recipient()
}

/// What a route passes to its node, unread.
#[derive(Message)]
#[rtype(result = "()")]
struct Routed<T>(T);

/// A route to a node that is a closure.
pub fn route<T: Send + 'static>(mut take: impl FnMut(T) + 'static) -> Route<T> {
    let node = stand_in(move |Routed(one)| take(one));
    Box::new(move |one| node.do_send(Routed(one)))
}

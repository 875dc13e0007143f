//! Clients that call a node by typed messages, without registry and connections. So their turns on the pool can be
//! distinguished.

use std::time::Duration;

use actix::dev::ToEnvelope;
use actix::prelude::*;
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::node::{Ask, Call, Completion, Reply, Unserved};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tokio::time::timeout;

/// Longest wait before a test fails.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// A pending call: its answer, and its end. Its caller disconnects when the answer's task is aborted.
pub struct Asked<T> {
    pub answer: JoinHandle<Result<T, Unserved>>,
    pub completion: Completion,
}

/// Calls as the client of that connection, and reports when the answer has arrived.
pub fn ask_as<A: Ask>(
    node: &Recipient<Call<A>>,
    connection: u64,
    answered: &UnboundedSender<u64>,
    ask: A,
) -> Asked<A::Answer> {
    let (working, completion) = Completion::pending();
    let (give, answer) = oneshot::channel();
    let reply = Reply::to_node(give, Some(working));
    node.do_send(Call { ask, reply });
    let answered = answered.clone();
    let answer = actix_rt::spawn(async move {
        let answer = answer.await.unwrap_or(Err(Unserved::ENDED));
        let _ = answered.send(connection);
        answer
    });
    Asked { answer, completion }
}

/// A node that computes on a pool, and clients that call it.
pub struct PoolBench<T: Actor> {
    pub pool: WorkerPool,
    pub node: Addr<T>,
    answered: UnboundedSender<u64>,
    order: UnboundedReceiver<u64>,
}

impl<T: Actor<Context = Context<T>>> PoolBench<T> {
    /// With one worker, so that the order of turns is fixed.
    pub fn new(node: impl FnOnce(WorkerPool) -> T) -> Self {
        let (answered, order) = unbounded_channel();
        let pool = WorkerPool::start(1).unwrap();
        Self {
            node: node(pool.clone()).start(),
            pool,
            answered,
            order,
        }
    }

    /// Calls as the client of that connection.
    pub fn ask_as<A: Ask>(&self, connection: u64, ask: A) -> Asked<A::Answer>
    where
        T: Handler<Call<A>>,
        Context<T>: ToEnvelope<T, Call<A>>,
    {
        ask_as(
            &self.node.clone().recipient(),
            connection,
            &self.answered,
            ask,
        )
    }

    /// The connection that is answered next.
    pub async fn next(&mut self) -> u64 {
        let next = timeout(PATIENCE, self.order.recv()).await;
        next.expect("an answer in time").expect("the bench lives")
    }
}

impl<T: Actor> Drop for PoolBench<T> {
    fn drop(&mut self) {
        self.pool.close("the test is over");
    }
}

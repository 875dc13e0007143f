//! A gateway in virtual time: registry, connections on in-memory pipes, and one node that serves everything in the
//! selected way.
//!
//! One runtime serves all executions of a thread. Each has its own registry and connections, which end before the next
//! begins.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::future::Future;
use std::net::SocketAddr;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::gateway::connection::{self, admission::Admission};
use pendularm::actors::gateway::registry::{Attach, Registry};
use pendularm::actors::node::{Caller, Interest, Nodes, Publish, Route, ServiceCall, TopicMessage};
use pendularm::actors::resources::gauges::Gauges;
use pendularm::actors::resources::memory::Memory;
use pendularm::actors::start::start_in_this_thread;
use pendularm::options::Links;
use pendularm::protocol::catalog::{self, Direction, Service, Topic};
use pendularm::protocol::messages;
use pendularm::protocol::op::fields::Fields;
use serde_json::json;
use tokio::io::{DuplexStream, duplex};

/// Address for clients, which `Host` must contain.
const LOCAL: ([u8; 4], u16) = ([127, 0, 0, 1], 9095);

thread_local! {
    static SYSTEM: SystemRunner = system();
}

fn system() -> SystemRunner {
    System::with_tokio_rt(|| {
        tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .start_paused(true)
            .build()
            .expect("a runtime")
    })
}

/// Runs one execution to its end.
pub fn run<T>(execution: impl Future<Output = T>) -> T {
    SYSTEM.with(|system| system.block_on(execution))
}

/// The same in a separate runtime, which ends all running tasks, because an arm never ends by itself.
pub fn run_apart<T>(execution: impl Future<Output = T>) -> T {
    system().block_on(execution)
}

/// The node's treatments of a call.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub enum Manner {
    /// Answers at once.
    #[default]
    Prompt,
    /// Holds it until another action.
    Holding,
    /// Answers a little later.
    Late,
    /// Drops it; the reply then sends an error.
    Forgetful,
}

/// The state that script and node share.
#[derive(Default)]
struct NodeState {
    manner: Cell<Manner>,
    held: RefCell<VecDeque<Caller>>,
}

/// The runtime's side.
pub struct Stage {
    pub registry: Addr<Registry>,
    pub gauges: Arc<Gauges>,
    admission: Arc<Admission>,
    node_state: Rc<NodeState>,
}

impl Stage {
    /// A gateway whose one node answers at once. With `has_arm` it has the runtime's own nodes. Computations, which need
    /// other threads, are then left to the one node.
    pub async fn new(admission: Admission, memory: Memory, has_arm: bool) -> Self {
        let gauges = Arc::new(Gauges::with(memory));
        let registry = Registry::new(Arc::clone(&gauges)).start();
        let node_state = Rc::new(NodeState::default());
        let node = Node(Rc::clone(&node_state)).start();
        let mut nodes = Nodes::default();
        if has_arm {
            let workers = WorkerPool::without_threads();
            start_in_this_thread(Links::Two, &registry, &gauges, &workers, 1, &mut nodes);
            nodes
                .services
                .retain(|service, _| !service.is_computation());
        }
        let rosapi = catalog::Rosapi::ALL.into_iter().map(Service::Rosapi);
        for service in Service::ALL.into_iter().chain(rosapi) {
            let node = node.clone();
            let route =
                || -> Route<ServiceCall> { Box::new(move |call| node.do_send(Called(call))) };
            nodes.services.entry(service).or_insert_with(route);
        }
        for topic in Topic::ALL {
            if topic.direction() == Direction::Subscribed {
                let route = || -> Route<TopicMessage> { Box::new(|_| ()) };
                nodes.subscribers.entry(topic).or_insert_with(route);
            } else {
                let publisher = nodes.publishers.entry(topic);
                publisher.or_insert_with(|| node.clone().recipient());
            }
        }
        registry.send(Attach(nodes)).await.expect("a registry");
        Self {
            registry,
            gauges,
            admission: Arc::new(admission),
            node_state,
        }
    }

    /// A connection; gives the client's end, whose pipe holds `room` bytes each way.
    #[must_use]
    pub fn connect(&self, room: usize) -> DuplexStream {
        let (ours, theirs) = duplex(room);
        let (admission, local) = (Arc::clone(&self.admission), SocketAddr::from(LOCAL));
        let (registry, gauges) = (self.registry.clone(), Arc::clone(&self.gauges));
        connection::start(None, admission, local, theirs, registry, gauges);
        ours
    }

    /// Whether no client is connected and no memory is held.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.gauges.connections() == 0 && self.gauges.memory().taken() == 0
    }

    /// Sets the node's treatment of calls.
    pub fn behave(&self, manner: Manner) {
        self.node_state.manner.set(manner);
    }

    /// The node answers the oldest held call.
    pub fn release(&self) {
        let caller = self.node_state.held.borrow_mut().pop_front();
        if let Some(mut caller) = caller {
            caller.succeed(&json!({}));
        }
    }

    /// From now on every call is answered, including the held ones.
    pub fn release_all(&self) {
        self.behave(Manner::Prompt);
        while !self.node_state.held.borrow().is_empty() {
            self.release();
        }
    }

    /// The node publishes on a topic of the runtime.
    pub fn publish(&self, topic: Topic, number: u64) {
        let msg = json!({"data": number, "header": {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "world"}});
        let frame = messages::publish(topic.name(), &msg);
        self.registry.do_send(Publish {
            topic,
            frame: Box::new(move || frame),
        });
    }
}

/// The node.
struct Node(Rc<NodeState>);

impl Actor for Node {
    type Context = Context<Self>;
}

/// A call, not parsed yet.
#[derive(Message)]
#[rtype(result = "()")]
struct Called(ServiceCall);

impl Handler<Called> for Node {
    type Result = ();

    fn handle(&mut self, Called(call): Called, ctx: &mut Context<Self>) {
        let ServiceCall {
            service,
            arguments,
            mut caller,
        } = call;
        match self.0.manner.get() {
            Manner::Prompt => {
                let status = Fields::read(&arguments, service)
                    .map_or_else(|why| why.to_string(), |_| String::new());
                match &*status {
                    "" => caller.succeed(&json!({})),
                    why => caller.refuse(why),
                }
            }
            Manner::Holding => self.0.held.borrow_mut().push_back(caller),
            Manner::Late => {
                ctx.run_later(Duration::from_millis(700), move |_, _| {
                    caller.succeed(&json!({}))
                });
            }
            Manner::Forgetful => drop(caller),
        }
    }
}

impl Handler<Interest> for Node {
    type Result = ();

    fn handle(&mut self, _: Interest, _: &mut Context<Self>) {}
}

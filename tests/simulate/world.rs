//! The whole runtime in one thread and in virtual time: registry, connections on pipes, every node, and the pool of
//! computations. The pool runs in the turns of the simulation.

use std::cell::Cell;
use std::net::SocketAddr;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use pendularm::actors::compute::workers::{Computation, Progress, WorkerPool};
use pendularm::actors::gateway::connection;
use pendularm::actors::gateway::registry::{Attach, Nodes, Registry};
use pendularm::actors::resources::gauges::Gauges;
use pendularm::actors::resources::memory::Memory;
use pendularm::actors::resources::work_clock;
use pendularm::actors::start::start_in_this_thread;
use pendularm::options::Links;
use tokio::io::{DuplexStream, duplex};
use tokio::time::sleep;

use crate::court::Court;
use crate::pipe::{Fate, MEANT, Pipe};

/// The cost of a query of the work clock. A turn of the arm has room for a dozen of them, and a slice for three.
const LOOK: Duration = Duration::from_micros(400);
/// The server's address, which `Host` must name.
const LOCAL: ([u8; 4], u16) = ([127, 0, 0, 1], 9095);
/// Longest virtual time between two checks of received frames.
const GLANCE: Duration = Duration::from_millis(20);
/// Virtual time of one slice of a computation.
const SLICE: Duration = Duration::from_millis(1);

/// Runs a world to its end, in a runtime of its own.
pub fn in_virtual_time<T>(course: impl Future<Output = T>) -> T {
    work_clock::count(LOOK);
    let system = System::with_tokio_rt(|| {
        tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .start_paused(true)
            .build()
            .expect("a runtime")
    });
    system.block_on(course)
}

/// Limits for scarce memory: one long frame at a time, and this many bytes of long answers.
const SCARCE: (usize, usize) = (1, 1 << 20);

pub struct World {
    pub registry: Addr<Registry>,
    pub gauges: Arc<Gauges>,
    pub pool: WorkerPool,
    court: Rc<Court>,
    /// Bytes that all pipes have moved so far.
    moved: Rc<Cell<u64>>,
}

impl World {
    pub async fn start(court: &Rc<Court>, links: usize, is_scarce: bool, seed: u64) -> Self {
        let memory = if is_scarce {
            Memory::of(SCARCE.0, SCARCE.1)
        } else {
            Memory::default()
        };
        let gauges = Arc::new(Gauges::with(memory));
        let registry = Registry::new(Arc::clone(&gauges)).start();
        let pool = WorkerPool::without_threads();
        let mut nodes = Nodes::default();
        let links = if links == 2 { Links::Two } else { Links::Three };
        start_in_this_thread(links, &registry, &gauges, &pool, seed, &mut nodes);
        registry.send(Attach(nodes)).await.expect("a registry");
        Self {
            registry,
            gauges,
            pool,
            court: Rc::clone(court),
            moved: Rc::default(),
        }
    }

    /// Opens a connection. Returns the client's end, whose pipe holds `room` bytes each way, and its fate.
    pub fn connect(&self, room: usize) -> (DuplexStream, Rc<Cell<Fate>>) {
        let (ours, stream) = duplex(room);
        let fate = Rc::new(Cell::new(Fate::Sound));
        let pipe = Pipe {
            stream,
            fate: Rc::clone(&fate),
            moved: Rc::clone(&self.moved),
        };
        let local = SocketAddr::from(LOCAL);
        let (registry, gauges) = (self.registry.clone(), Arc::clone(&self.gauges));
        connection::start(None, Arc::default(), local, pipe, registry, gauges);
        (ours, fate)
    }

    /// Gives every task this many turns; no time passes.
    pub async fn turns(&self, turns: usize) {
        for _ in 0..turns {
            let _ = self.pool.turn();
            tokio::task::yield_now().await;
            self.court.turns.set(self.court.turns.get() + 1);
        }
    }

    /// Runs turns until no byte has moved in any pipe for a while: all sent frames have been read and answered.
    pub async fn until_quiet(&self) {
        // A flood of 1 MB per client takes some dozens of these rounds. One of 2 MB in pieces of 100 bytes takes 400.
        for _ in 0..1000 {
            let before = self.moved.get();
            self.turns(300).await;
            if self.moved.get() == before {
                return;
            }
        }
    }

    /// Lets time pass, at most until the next check. Returns the passed time.
    pub async fn glance(&self, time: Duration) -> Duration {
        let step = if self.pool.is_idle() { GLANCE } else { SLICE };
        let step = step.min(time);
        self.turns(2).await;
        sleep(step).await;
        self.turns(2).await;
        step
    }

    /// Makes the clock jump.
    pub async fn jump(&self, time: Duration) {
        tokio::time::advance(time).await;
        self.court.jumps.set(self.court.jumps.get() + 1);
    }

    /// A computation without an owner that panics.
    pub fn submit_panic(&self) {
        self.pool.submit(Box::new(Trap));
    }

    /// Bytes held for all clients together.
    pub fn taken(&self) -> usize {
        self.gauges.memory().taken()
    }

    /// Whether no client is connected, no memory is held for clients, and no computation runs.
    pub fn is_empty(&self) -> bool {
        self.gauges.connections() == 0 && self.taken() == 0 && self.pool.is_idle()
    }
}

struct Trap;

impl Computation for Trap {
    fn advance(&mut self, _: Duration) -> Progress {
        panic!("{MEANT}")
    }

    fn refuse(&mut self, _: &str) {}
}

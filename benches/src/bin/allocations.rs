//! Heap allocations counted: per physics step, and per delivered message.
//!
//! `cargo run --release --bin allocations`
//!
//! The counting allocator is the reason why this is not one of the package's tests: it needs `unsafe`, which the package
//! forbids.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use actix::prelude::*;
use bytes::Bytes;
use pendularm::actors::gateway::connection::{self, Ends};
use pendularm::actors::gateway::registry::Registry;
use pendularm::actors::node::Publish;
use pendularm::actors::resources::gauges::Gauges;
use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::Gains;
use pendularm::math::simulation::Simulation;
use pendularm::protocol::catalog::Topic;
use tokio::io::{AsyncReadExt, AsyncWriteExt};

struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

// SAFETY: every call goes on to the system's allocator unchanged; counting does not allocate.
#[allow(unsafe_code, reason = "an allocator can't be written without")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn counted() -> u64 {
    ALLOCATIONS.load(Ordering::Relaxed)
}

fn steps<const N: usize>() {
    for pid in [false, true] {
        for method in Method::ALL {
            let mut simulation = Simulation::<N>::new(Arm::default(), Gains::default());
            simulation.set_method(method);
            simulation.enable(pid);
            let before = counted();
            let taken = simulation.advance(1_000_000);
            let allocations = counted() - before;
            println!("{N} links, {method:8} PID {pid:5}  {taken} steps  {allocations} allocations");
            assert_eq!(allocations, 0, "a physics step must not allocate");
        }
    }
}

/// Allocations per message for `subscribers` clients on in-memory pipes, `messages` published one by one.
async fn per_message(subscribers: usize, messages: u32, size: usize) -> f64 {
    let gauges = Arc::new(Gauges::default());
    let registry = Registry::new(Arc::clone(&gauges)).start();
    let mut clients = Vec::new();
    for _ in 0..subscribers {
        let (near, mut far) = tokio::io::duplex(1 << 20);
        connection::start(
            None,
            Arc::default(),
            Ends::default(),
            near,
            registry.clone(),
            Arc::clone(&gauges),
        );
        far.write_all(b"{\"op\":\"subscribe\",\"topic\":\"/joint_states\"}\n")
            .await
            .expect("sent");
        let mut buffer = vec![0; 1 << 16];
        let _ = far.read(&mut buffer).await.expect("the status");
        clients.push((far, buffer));
    }
    let frame = Bytes::from(vec![b'x'; size]);
    let mut before = 0;
    for round in 0..messages + 100 {
        if round == 100 {
            before = counted();
        }
        let frame = frame.clone();
        let message = Publish {
            topic: Topic::JointStates,
            frame: Box::new(move || frame),
        };
        registry.do_send(message);
        for (client, buffer) in &mut clients {
            let mut read = 0;
            while read < size {
                read += client.read(buffer).await.expect("the message");
            }
        }
    }
    (counted() - before) as f64 / f64::from(messages)
}

fn main() {
    steps::<2>();
    steps::<3>();
    actix::System::new().block_on(async {
        for size in [200, 20_000] {
            let (few, many) = (
                per_message(10, 1000, size).await,
                per_message(110, 1000, size).await,
            );
            let each = (many - few) / 100.0;
            println!(
                "{size} bytes: {each:.2} allocations for each further subscriber of a message"
            );
        }
    });
}

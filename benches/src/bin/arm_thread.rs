//! How long one message of a client keeps the arm's thread from the physics, whatever is in it.
//!
//! `cargo run --release --bin arm_thread`
//!
//! A task on that thread looks at the thread's processor time whenever it has its turn: the most that passes between two
//! looks is what the longest message took. Elapsed time would tell of the scheduler instead, which gives a thread that
//! never sleeps 4 ms of rest where others want its core. The arm is paused, so that steps do not count; of several
//! rounds the quietest counts.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use actix::prelude::*;
use pendularm::actors::arm::sim::ArmSim;
use pendularm::actors::gateway::connection::Connection;
use pendularm::actors::gateway::registry::{Attach, Registry};
use pendularm::actors::resources::gauges::Gauges;
use pendularm::actors::resources::work_clock::spent;
use pendularm::actors::wire::Nodes;
use pendularm::math::arm::Arm;
use pendularm::math::pid::Gains;
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader, DuplexStream};

/// The longest time of one message, in microseconds.
const BAR: f64 = 100.0;
/// Bytes of a payload, about.
const SIZE: usize = 4_000_000;
/// The longest arguments that are handed on to a node of the runtime's own.
const LONGEST_TAKEN: usize = 16_000;
/// Each is sent so often.
const ROUNDS: usize = 10;

/// `unit` again and again, with commas in between, up to so many bytes.
fn repeated(unit: &str, bytes: usize) -> String {
    vec![unit; bytes / (unit.len() + 1)].join(",")
}

fn call(args: &str) -> String {
    format!("{{\"op\":\"call_service\",\"service\":\"/arm_sim/set_params\",\"args\":{args}}}\n")
}

fn trajectory(msg: &str) -> String {
    format!("{{\"op\":\"publish\",\"topic\":\"/joint_trajectory\",\"msg\":{msg}}}\n")
}

fn frames() -> Vec<(&'static str, String)> {
    let zeros = |bytes| repeated("0", bytes);
    let decimals = |bytes| repeated("10000000000000001268e281", bytes);
    let points = repeated("{\"positions\":[0,0]}", SIZE);
    vec![
        ("service: nothing", call("{}")),
        (
            "service: zeros in a field",
            call(&format!("{{\"masses\":[{}]}}", zeros(SIZE))),
        ),
        (
            "service: zeros in another",
            call(&format!("{{\"other\":[{}]}}", zeros(SIZE))),
        ),
        (
            "service: zeros by position",
            call(&format!("[{}]", zeros(SIZE))),
        ),
        (
            "service: slow decimals",
            call(&format!("{{\"masses\":[{}]}}", decimals(SIZE))),
        ),
        (
            "service: as long as is taken",
            call(&format!("{{\"masses\":[{}]}}", zeros(LONGEST_TAKEN))),
        ),
        (
            "service: the same, decimals",
            call(&format!("{{\"masses\":[{}]}}", decimals(LONGEST_TAKEN))),
        ),
        (
            "topic: a setpoint",
            trajectory("{\"points\":[{\"positions\":[0,0]}]}"),
        ),
        (
            "topic: many points",
            trajectory(&format!("{{\"points\":[{points}]}}")),
        ),
        (
            "topic: zeros in a point",
            trajectory(&format!(
                "{{\"points\":[{{\"positions\":[{}]}}]}}",
                zeros(SIZE)
            )),
        ),
        (
            "topic: as long as is taken",
            trajectory(&format!(
                "{{\"points\":[{{\"positions\":[{}]}}]}}",
                zeros(LONGEST_TAKEN)
            )),
        ),
    ]
}

/// A client on an in-memory pipe.
struct Client(BufReader<DuplexStream>);

impl Client {
    async fn send(&mut self, text: &str) {
        self.0.write_all(text.as_bytes()).await.expect("sent");
    }

    /// Waits until all that was sent has taken effect: a call is answered in order.
    async fn settle(&mut self) {
        self.send("{\"op\":\"call_service\",\"service\":\"/arm_sim/pause\",\"args\":{\"data\":true},\"id\":\"last\"}\n").await;
        let mut line = String::new();
        while !line.contains("\"id\":\"last\"") {
            line.clear();
            self.0.read_line(&mut line).await.expect("an answer");
        }
    }
}

async fn measure() {
    let gauges = Arc::new(Gauges::default());
    let registry = Registry::new(Arc::clone(&gauges)).start();
    let thread = Arbiter::with_tokio_rt(|| {
        tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .build()
            .expect("a runtime")
    });
    let (publish, of_arm) = (registry.clone().recipient(), Arc::clone(&gauges));
    let arm = ArmSim::<2>::start_in_arbiter(&thread.handle(), move |_| {
        ArmSim::new(Arm::default(), Gains::default(), publish, of_arm)
    });
    let mut nodes = Nodes::default();
    ArmSim::attach(&arm, &mut nodes);
    registry.send(Attach(nodes)).await.expect("a registry");

    let [longest, looks] = [(); 2].map(|()| Arc::new(AtomicU64::new(0)));
    let ended = Arc::new(AtomicBool::new(false));
    let (seen, looked, end) = (Arc::clone(&longest), Arc::clone(&looks), Arc::clone(&ended));
    thread.spawn(async move {
        let mut last = spent();
        while !end.load(Ordering::Relaxed) {
            tokio::task::yield_now().await;
            let now = spent();
            let between = u64::try_from((now - last).as_nanos()).unwrap_or(u64::MAX);
            seen.fetch_max(between, Ordering::Relaxed);
            looked.fetch_add(1, Ordering::Release);
            last = now;
        }
    });

    let (near, far) = tokio::io::duplex(2 * SIZE);
    Connection::start_on(near, registry.clone(), Arc::clone(&gauges));
    let mut client = Client(BufReader::new(far));
    client.settle().await;
    let mut missed = 0;
    for (name, frame) in frames() {
        let mut quietest = u64::MAX;
        for _ in 0..ROUNDS {
            longest.store(0, Ordering::Relaxed);
            client.send(&frame).await;
            client.settle().await;
            // The answer leaves before the look that measures it.
            let answered = looks.load(Ordering::Acquire);
            while looks.load(Ordering::Acquire) < answered + 2 {
                tokio::task::yield_now().await;
            }
            quietest = quietest.min(longest.load(Ordering::Relaxed));
        }
        let took = quietest as f64 / 1e3;
        let mark = if took >= BAR { "  MISSED" } else { "" };
        missed += usize::from(took >= BAR);
        println!("{name:32} {:9} bytes {took:8.1} us{mark}", frame.len());
    }
    ended.store(true, Ordering::Relaxed);
    thread.stop();
    println!("{missed} above the bar of {BAR} us");
}

fn main() {
    System::new().block_on(measure());
}

//! The cost of the idle runtime, and the accuracy of its clock: processor, memory, simulation time against wall time.
//!
//! `cargo run --release --bin idle -- PATH/TO/pendularm [SECONDS]`
//!
//! Default settings, no client during the measurement. Linux only: the figures are read from `/proc`. The arm wakes 60
//! times a second, so beside it there is a loop that does nothing else.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use pendularm_benches::program::{self, Program, processor, resident};
use pendularm_client::blocking::Client;

/// Simulation time on `/clock` \[s\], and the time of its arrival.
fn simulation_time(address: SocketAddr) -> (f64, Instant) {
    let mut client = Client::to(address);
    client.subscribe("/clock");
    (program::simulation_time(&mut client), Instant::now())
}

/// Wakes up 60 times a second for that time, and returns the part of a core that it takes.
fn bare_wakeups(seconds: u64) -> f64 {
    let tick = Duration::from_secs(1) / 60;
    let (busy, began) = (processor(std::process::id()), Instant::now());
    for wakeups in 1..=60 * u32::try_from(seconds).expect("an hour at most") {
        std::thread::sleep((began + wakeups * tick).saturating_duration_since(Instant::now()));
    }
    let used = (processor(std::process::id()) - busy) as f64 * 1e-9;
    used / began.elapsed().as_secs_f64()
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let program = arguments.next().expect("the path of the pendularm binary");
    let seconds: u64 = arguments
        .next()
        .map_or(10, |seconds| seconds.parse().expect("a number"));
    let running = Program::start(&program, &["--bind", "127.0.0.1:0"]).expect("the runtime starts");
    let (address, pid) = (running.address, running.pid());
    std::thread::sleep(Duration::from_secs(1));

    let (sim_before, wall_before) = simulation_time(address);
    std::thread::sleep(Duration::from_millis(100));
    let (busy, began) = (processor(pid), Instant::now());
    std::thread::sleep(Duration::from_secs(seconds));
    let used = (processor(pid) - busy) as f64 * 1e-9;
    let wall = began.elapsed().as_secs_f64();
    let memory = resident(pid);
    let (sim_after, wall_after) = simulation_time(address);

    let ratio = (sim_after - sim_before) / (wall_after - wall_before).as_secs_f64();
    println!(
        "idle, no client      {:.3} % of one core over {wall:.1} s",
        100.0 * used / wall
    );
    println!(
        "a bare loop          {:.3} % with 60 wake-ups a second",
        100.0 * bare_wakeups(seconds)
    );
    println!("resident             {memory:.1} MB");
    println!("sim time / wall time {ratio:.6}");
}

//! The cost of the idle runtime, and how well its clock keeps: processor, memory, simulation time against wall time.
//!
//! `cargo run --release --bin idle -- PATH/TO/pendularm [SECONDS]`
//!
//! Default settings, no client during the measurement. Linux only: the figures are read from `/proc`.

use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use pendularm_benches::program::Program;
use pendularm_benches::program::{processor, resident};

/// Simulation time as `/clock` has it now \[s\], and when it came.
fn simulation_time(address: SocketAddr) -> (f64, Instant) {
    let mut stream = TcpStream::connect(address).expect("accepts");
    stream
        .write_all(b"{\"op\":\"subscribe\",\"topic\":\"/clock\"}\n")
        .expect("sent");
    let mut lines = BufReader::new(stream).lines();
    let line = lines
        .find_map(|line| line.ok().filter(|line| line.contains("\"clock\":{")))
        .expect("a clock message");
    let number = |key: &str| {
        let rest = &line[line.find(key).expect("key") + key.len()..];
        let end = rest.find(|c: char| !c.is_ascii_digit()).expect("end");
        rest[..end].parse::<f64>().expect("number")
    };
    (
        number("\"sec\":") + 1e-9 * number("\"nanosec\":"),
        Instant::now(),
    )
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
    println!("resident             {memory:.1} MB");
    println!("sim time / wall time {ratio:.6}");
}

//! The cost of the idle runtime, and how well its clock keeps: processor, memory, simulation time against wall time.
//!
//! `cargo run --release --bin idle -- PATH/TO/pendularm [SECONDS]`
//!
//! Default settings, no client during the measurement. Linux only: the figures are read from `/proc`.

use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Processor time of a process \[s\], summed over its threads: the scheduler's own count, in nanoseconds.
fn processor(pid: u32) -> f64 {
    let threads = std::fs::read_dir(format!("/proc/{pid}/task")).expect("threads");
    threads
        .filter_map(|thread| std::fs::read_to_string(thread.ok()?.path().join("schedstat")).ok())
        .filter_map(|stat| stat.split_whitespace().next()?.parse::<f64>().ok())
        .sum::<f64>()
        * 1e-9
}

/// Resident memory of a process \[MB\].
fn resident(pid: u32) -> f64 {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).expect("status");
    let line = status
        .lines()
        .find(|line| line.starts_with("VmRSS:"))
        .expect("VmRSS");
    line.split_whitespace()
        .nth(1)
        .and_then(|kb| kb.parse::<f64>().ok())
        .expect("kB")
        / 1024.0
}

/// Simulation time as `/clock` has it now \[s\], and when it came.
fn simulation_time(address: &str) -> (f64, Instant) {
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
    let mut child = Command::new(program)
        .args(["--bind", "127.0.0.1:0"])
        .stdout(Stdio::piped())
        .spawn()
        .expect("the runtime starts");
    let mut line = String::new();
    BufReader::new(child.stdout.take().expect("piped"))
        .read_line(&mut line)
        .expect("a line");
    let address = line.trim().trim_start_matches("listening on ").to_owned();
    std::thread::sleep(Duration::from_secs(1));

    let (sim_before, wall_before) = simulation_time(&address);
    std::thread::sleep(Duration::from_millis(100));
    let (busy, began) = (processor(child.id()), Instant::now());
    std::thread::sleep(Duration::from_secs(seconds));
    let used = processor(child.id()) - busy;
    let wall = began.elapsed().as_secs_f64();
    let memory = resident(child.id());
    let (sim_after, wall_after) = simulation_time(&address);
    let _ = child.kill();
    let _ = child.wait();

    let ratio = (sim_after - sim_before) / (wall_after - wall_before).as_secs_f64();
    println!(
        "idle, no client      {:.3} % of one core over {wall:.1} s",
        100.0 * used / wall
    );
    println!("resident             {memory:.1} MB");
    println!("sim time / wall time {ratio:.6}");
}

//! The healthy subscriber, and beside it what the machine itself is late by.
//!
//! Each has a thread of its own with blocking calls. One reads `/joint_states`, one reads messages that a bare process
//! sends at the same rate, one sleeps at the same rate, and one calls 20 times a second. The controls do nothing else,
//! so what they are late by is the machine's doing. And the system itself says for how long threads were able to run
//! and had no processor.
//!
//! **Invariant:** every message is kept with the time at which it was read, and nothing is judged here.

use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::world::PATIENCE;
use pendularm_benches::program::{Program, queued};

/// The period of `/joint_states`.
pub const PERIOD: Duration = Duration::from_nanos(16_666_667);
/// How often the healthy caller asks.
const CALL_PERIOD: Duration = Duration::from_millis(50);
/// About as long as a message of `/joint_states` of two links.
const CONTROL_MESSAGE: usize = 330;

/// A message of `/joint_states`.
#[derive(Debug, Clone, Copy)]
pub struct Seen {
    /// When it was read.
    pub at: Instant,
    /// Simulation time of its stamp \[s\].
    pub stamp: f64,
    /// For how long the threads that it came through had waited for a processor by then, all together \[s\].
    pub queued: f64,
    /// For how long those of the program had had one \[s\].
    pub ran: f64,
}

/// When something came, and how long that took \[s\].
pub type Timed = (Instant, f64);

/// Everything that the healthy threads saw.
#[derive(Default)]
pub struct Record {
    /// Messages of `/joint_states`, in the order in which they came.
    pub states: Vec<Seen>,
    /// When the messages of the bare process were read.
    pub bare: Vec<Instant>,
    /// When the sleeper woke, and how much too late \[s\].
    pub woken: Vec<Timed>,
    /// When each call of the healthy caller was answered, and how long that took \[s\].
    pub calls: Vec<Timed>,
    /// The faults that were found.
    pub faults: Vec<String>,
}

/// The threads, running.
pub struct Watch {
    stop: Arc<AtomicBool>,
    states: JoinHandle<(Vec<Seen>, Vec<String>)>,
    bare: JoinHandle<Vec<Instant>>,
    woken: JoinHandle<Vec<Timed>>,
    calls: JoinHandle<(Vec<Timed>, Vec<String>)>,
}

impl Watch {
    /// How many connections it makes to the program.
    pub const CONNECTIONS: u64 = 2;

    /// Starts to watch the program, and the bare process at `bare`.
    pub fn start(program: &Program, bare: SocketAddr) -> Result<Self, String> {
        let (address, pid) = (program.address, program.pid());
        let stop: Arc<AtomicBool> = Arc::default();
        let open = |address| -> Result<TcpStream, String> {
            let connect = || {
                let stream = TcpStream::connect(address)?;
                stream.set_nodelay(true)?;
                stream.set_read_timeout(Some(PATIENCE))?;
                Ok::<_, std::io::Error>(stream)
            };
            connect().map_err(|error| format!("the healthy client is not accepted: {error}"))
        };
        let (watcher, caller, bare) = (open(address)?, open(address)?, open(bare)?);
        let stops = [(); 4].map(|()| Arc::clone(&stop));
        let [one, two, three, four] = stops;
        Ok(Self {
            stop,
            states: std::thread::spawn(move || watch_states(watcher, pid, &one)),
            bare: std::thread::spawn(move || watch_bare(bare, &two)),
            woken: std::thread::spawn(move || sleep_in_steps(&three)),
            calls: std::thread::spawn(move || call_now_and_then(caller, &four)),
        })
    }

    /// Stops watching; the connections are closed then.
    pub fn finish(self) -> Record {
        self.stop.store(true, Ordering::Relaxed);
        let (states, mut faults) = self.states.join().unwrap_or_default();
        let (calls, more) = self.calls.join().unwrap_or_default();
        faults.extend(more);
        let (bare, woken) = (
            self.bare.join().unwrap_or_default(),
            self.woken.join().unwrap_or_default(),
        );
        Record {
            states,
            bare,
            woken,
            calls,
            faults,
        }
    }
}

fn watch_states(stream: TcpStream, pid: u32, stop: &AtomicBool) -> (Vec<Seen>, Vec<String>) {
    let (mut seen, mut faults) = (Vec::new(), Vec::new());
    let mut writer = &stream;
    let subscribe = b"{\"op\":\"subscribe\",\"topic\":\"/joint_states\"}\n";
    if let Err(error) = writer.write_all(subscribe) {
        return (seen, vec![format!("cannot subscribe: {error}")]);
    }
    let mut reader = BufReader::new(&stream);
    let queues = queued(pid);
    let mut line = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        line.clear();
        let read = reader.read_until(b'\n', &mut line);
        let at = Instant::now();
        if !matches!(read, Ok(1..)) {
            faults.push(format!("the stream of /joint_states ended: {read:?}"));
            break;
        }
        let frame: Value = serde_json::from_slice(&line).unwrap_or_default();
        if frame["op"] == "status" && seen.is_empty() {
            continue;
        }
        match stamp(&frame) {
            Some(stamp) => {
                let (queued, ran) = queues.look();
                seen.push(Seen {
                    at,
                    stamp,
                    queued,
                    ran,
                });
            }
            None => faults.push(format!("not a joint state: {frame}")),
        }
    }
    (seen, faults)
}

/// The stamp \[s\] of a joint state that has all that it should.
fn stamp(frame: &Value) -> Option<f64> {
    let msg = &frame["msg"];
    let stamp = &msg["header"]["stamp"];
    let (sec, nanosec) = (
        stamp["sec"].as_u64()?,
        stamp["nanosec"]
            .as_u64()
            .filter(|one| *one < 1_000_000_000)?,
    );
    let joints = msg["name"].as_array()?.len();
    let finite = |key: &str| {
        msg[key]
            .as_array()
            .is_some_and(|all| all.len() == joints && all.iter().all(Value::is_f64))
    };
    let whole = frame["topic"] == "/joint_states" && joints > 0;
    let numbers = finite("position") && finite("velocity") && finite("effort");
    (whole && numbers).then_some(sec as f64 + nanosec as f64 * 1e-9)
}

fn watch_bare(stream: TcpStream, stop: &AtomicBool) -> Vec<Instant> {
    let mut reader = BufReader::new(stream);
    let (mut line, mut seen) = (Vec::new(), Vec::new());
    while !stop.load(Ordering::Relaxed) {
        line.clear();
        if !matches!(reader.read_until(b'\n', &mut line), Ok(1..)) {
            break;
        }
        seen.push(Instant::now());
    }
    seen
}

fn sleep_in_steps(stop: &AtomicBool) -> Vec<Timed> {
    let mut woken = Vec::new();
    let mut due = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        due += PERIOD;
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        let late = Instant::now().saturating_duration_since(due);
        woken.push((Instant::now(), late.as_secs_f64()));
        // A step that is missed is skipped, as by the arm.
        due += PERIOD * (late.as_nanos() / PERIOD.as_nanos()) as u32;
    }
    woken
}

fn call_now_and_then(stream: TcpStream, stop: &AtomicBool) -> (Vec<Timed>, Vec<String>) {
    let mut reader = BufReader::new(&stream);
    let mut writer = &stream;
    let (mut calls, mut line) = (Vec::new(), Vec::new());
    while !stop.load(Ordering::Relaxed) {
        let asked = Instant::now();
        let id = calls.len();
        let call = format!(
            "{{\"op\":\"call_service\",\"id\":{id},\"service\":\"/arm_sim/set_params\"}}\n"
        );
        line.clear();
        let done = writer
            .write_all(call.as_bytes())
            .and_then(|()| reader.read_until(b'\n', &mut line));
        let frame: Value = serde_json::from_slice(&line).unwrap_or_default();
        if done.is_err() || frame["id"] != id || frame["result"] != true {
            return (
                calls,
                vec![format!(
                    "the healthy caller's call {id} got {done:?}, {frame}"
                )],
            );
        }
        calls.push((Instant::now(), asked.elapsed().as_secs_f64()));
        std::thread::sleep(CALL_PERIOD.saturating_sub(asked.elapsed()));
    }
    (calls, Vec::new())
}

/// The bare process: sends a line at the rate of `/joint_states` to its one client, and does nothing else.
pub fn tick() -> std::io::Result<()> {
    let listener = TcpListener::bind("127.0.0.1:0")?;
    println!("listening on {}", listener.local_addr()?);
    let (mut stream, _) = listener.accept()?;
    stream.set_nodelay(true)?;
    let mut message = vec![b'x'; CONTROL_MESSAGE];
    message.push(b'\n');
    let mut due = Instant::now();
    loop {
        due += PERIOD;
        let now = Instant::now();
        std::thread::sleep(due.saturating_duration_since(now));
        let late = Instant::now().saturating_duration_since(due);
        due += PERIOD * (late.as_nanos() / PERIOD.as_nanos()) as u32;
        if stream.write_all(&message).is_err() {
            return Ok(());
        }
    }
}

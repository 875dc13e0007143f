//! The healthy clients: a caller, a subscriber, new clients. An attack is judged by their service.
//!
//! **Invariant:** calls are made when they are due, whether or not earlier ones have been answered. A standstill delays all of
//! them.

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use pendularm_client::Error;
use pendularm_client::blocking::Client;
use pendularm_client::codec::Framing;
use serde_json::{Value, json};

use crate::attack::TOKEN;

/// Between two calls.
const CALLS: Duration = Duration::from_millis(10);
/// Between two newcomers.
const VISITS: Duration = Duration::from_millis(250);
/// Bytes of the message that a newcomer sends to itself.
const MESSAGE: usize = 256 * 1024;
/// The same for a newcomer with long requests: the message and a call need permits.
const LONG_MESSAGE: usize = 1024 * 1024;
/// Time for a request that needs a permit: the time for which another client may hold it, and its own.
const LONG_PATIENCE: Duration = Duration::from_secs(30);

/// The attacked server, for the healthy clients.
#[derive(Clone, Copy)]
pub struct Target {
    /// Address that it listens on.
    pub address: SocketAddr,
    /// Whether it requires the token.
    pub locked: bool,
    /// Time until a call or a new client counts as not answered.
    pub patience: Duration,
    /// Whether newcomers have long requests.
    pub long: bool,
}

/// The calls, messages and connections of the healthy clients, with their delays.
#[derive(Default)]
pub struct Health {
    /// Calls made.
    pub asked: usize,
    /// Delays of the calls that were answered \[ms\], in rising order.
    pub delays: Vec<f64>,
    /// Longest time between two messages of `/joint_states`, and from the last to the end \[ms\].
    pub longest_gap: f64,
    /// Newcomers that came.
    pub visits: usize,
    /// Newcomers that were served.
    pub served: usize,
    /// The longest connection of a served new client \[ms\].
    pub longest_visit: f64,
    /// The fault of the first newcomer that was not served.
    pub visit_fault: Option<String>,
    /// Faults of the caller and of the watcher.
    pub faults: Vec<String>,
}

/// The threads, running.
pub struct Healthy {
    stop: Arc<AtomicBool>,
    threads: [JoinHandle<Health>; 3],
}

impl Healthy {
    /// Connections that stay open; newcomers have one more for a moment.
    pub const CONNECTIONS: usize = 2;

    /// Connects, and starts to call and to watch.
    pub fn start(target: Target) -> Result<Self, String> {
        let (caller, watcher) = (target.connect()?, target.connect()?);
        let stop: Arc<AtomicBool> = Arc::default();
        let [one, two, three] = [(); 3].map(|()| Arc::clone(&stop));
        let threads = [
            std::thread::spawn(move || call(caller, target, &one)),
            std::thread::spawn(move || watch(watcher, &two)),
            std::thread::spawn(move || come_and_go(target, &three)),
        ];
        Ok(Self { stop, threads })
    }

    /// Stops when the outstanding answers have arrived, or after the limit.
    pub fn finish(self) -> Health {
        self.stop.store(true, Ordering::Relaxed);
        let lost = |_| Health {
            faults: vec!["a healthy client broke".to_owned()],
            ..Health::default()
        };
        let [mut called, watched, visited] = self
            .threads
            .map(|thread| thread.join().unwrap_or_else(lost));
        called.delays.sort_unstable_by(f64::total_cmp);
        Health {
            asked: called.asked,
            delays: called.delays,
            longest_gap: watched.longest_gap,
            faults: [called.faults, watched.faults, visited.faults].concat(),
            ..visited
        }
    }
}

impl Target {
    /// A client that has sent the token if the server requires one.
    fn connect(self) -> Result<Client, String> {
        let connected = Client::connect(Framing::Lines, self.address, self.patience);
        let mut client = connected.map_err(|error| format!("connecting: {error}"))?;
        if self.locked {
            let sent = send(&mut client, &json!({"op": "auth", "token": TOKEN}));
            sent.map_err(|why| format!("connecting: {why}"))?;
        }
        Ok(client)
    }
}

fn send(client: &mut Client, frame: &Value) -> Result<(), String> {
    let sent = client.write(format!("{frame}\n").as_bytes());
    sent.map_err(|error| error.to_string())
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

fn call(mut client: Client, target: Target, stop: &AtomicBool) -> Health {
    let request = json!({"op": "call_service", "service": "/arm_sim/pause", "args": {}});
    let (mut health, mut waiting) = (Health::default(), VecDeque::new());
    let (mut due, mut until) = (Instant::now(), None);
    let mut fault = None;
    while fault.is_none() {
        let now = Instant::now();
        if until.is_none() && stop.load(Ordering::Relaxed) {
            until = Some(now + target.patience);
        }
        match until {
            Some(until) if waiting.is_empty() || now >= until => break,
            None if now >= due => {
                due = (due + CALLS).max(now);
                waiting.push_back(now);
                health.asked += 1;
                fault = send(&mut client, &request).err();
            }
            _ => {}
        }
        let wait = Instant::now() + Duration::from_micros(100);
        match client.next_frame(due.max(wait)) {
            Ok(frame) if frame["op"] == "service_response" => {
                if let Some(sent) = waiting.pop_front() {
                    health.delays.push(milliseconds(sent.elapsed()));
                }
            }
            Ok(frame) => health.faults.push(format!("the caller: {frame}")),
            Err(Error::Late) => {}
            Err(error) => fault = Some(error.to_string()),
        }
    }
    health
        .faults
        .extend(fault.map(|why| format!("the caller: {why}")));
    health
}

fn watch(mut client: Client, stop: &AtomicBool) -> Health {
    let mut health = Health::default();
    let subscribe = json!({"op": "subscribe", "topic": "/joint_states"});
    let mut fault = send(&mut client, &subscribe).err();
    let mut last = Instant::now();
    while fault.is_none() && !stop.load(Ordering::Relaxed) {
        match client.next_frame(Instant::now() + CALLS) {
            Ok(frame) if frame["op"] == "publish" => {
                health.longest_gap = health.longest_gap.max(milliseconds(last.elapsed()));
                last = Instant::now();
            }
            Ok(_) | Err(Error::Late) => {}
            Err(error) => fault = Some(error.to_string()),
        }
    }
    health.longest_gap = health.longest_gap.max(milliseconds(last.elapsed()));
    health
        .faults
        .extend(fault.map(|why| format!("the watcher: {why}")));
    health
}

/// New clients, one after the other, until `stop` is set.
fn come_and_go(target: Target, stop: &AtomicBool) -> Health {
    let mut health = Health::default();
    while !stop.load(Ordering::Relaxed) {
        let began = Instant::now();
        health.visits += 1;
        match visit(target, health.visits) {
            Ok(()) => {
                health.served += 1;
                health.longest_visit = health.longest_visit.max(milliseconds(began.elapsed()));
            }
            Err(why) => drop(health.visit_fault.get_or_insert(why)),
        }
        let pause = VISITS.saturating_sub(began.elapsed());
        std::thread::sleep(pause.max(Duration::from_millis(20)));
    }
    health
}

/// Calls its own service, sends itself a message, and requests a small computation and the page. A newcomer with long
/// requests has a long message and long answers, and asks `study` and `rosapi` too.
fn visit(target: Target, number: usize) -> Result<(), String> {
    let (message, steps, patience) = match target.long {
        true => (LONG_MESSAGE, 20_000, LONG_PATIENCE),
        false => (MESSAGE, 100, target.patience),
    };
    let mut client = target.connect()?;
    let client = &mut client;
    let service = format!("/newcomer/{number}/service");
    let topic = format!("/newcomer/{number}/topic");
    let part = |name: &'static str| move |why: String| format!("{name}: {why}");

    let mut calling = || {
        let advertise = json!({"op": "advertise_service", "service": service});
        send(client, &advertise)?;
        let call = json!({"op": "call_service", "service": service, "id": "call"});
        send(client, &call)?;
        let forwarded = next(client, "call_service", target.patience)?;
        let response = json!({"op": "service_response", "service": service, "id": forwarded["id"], "result": true, "values": {}});
        send(client, &response)?;
        succeeded(&next(client, "service_response", target.patience)?)
    };
    calling().map_err(part("a forwarded call"))?;

    let mut publishing = || {
        let content = "x".repeat(message);
        send(client, &json!({"op": "subscribe", "topic": topic}))?;
        send(client, &json!({"op": "advertise", "topic": topic}))?;
        let message = json!({"op": "publish", "topic": topic, "msg": {"data": content}});
        send(client, &message)?;
        let came = next(client, "publish", patience)?;
        let whole = came["msg"]["data"] == content;
        whole
            .then_some(())
            .ok_or_else(|| "its message came back different".to_owned())
    };
    publishing().map_err(part("a message to itself"))?;

    let mut ask = |service: &'static str, args: Value| {
        let mut asking = || {
            send(
                client,
                &pendularm_client::call(service, &args, &json!("ask")),
            )?;
            succeeded(&next(client, "service_response", patience)?)
        };
        asking().map_err(part(service))
    };
    ask(
        "/arm_sim/integration_step",
        json!({"function": "t", "x0": 0, "dt": 0.01, "steps": steps, "integrator": "rk4"}),
    )?;
    if target.long {
        // The question has more bytes than a frame without a permit.
        let padding = "x".repeat(100 * 1024);
        ask("/arm_sim/pause", json!({"padding": padding}))?;
        ask(
            "/study/stability",
            json!({"gains": {"kp": [100 + number, 50]}}),
        )?;
        ask("/rosapi/topics_and_raw_types", json!({}))?;
    }
    see_the_page(target, patience).map_err(part("the page"))
}

/// The next frame of that operation; an error status ends the wait.
fn next(client: &mut Client, op: &str, patience: Duration) -> Result<Value, String> {
    let deadline = Instant::now() + patience;
    loop {
        let frame = client
            .next_frame(deadline)
            .map_err(|error| error.to_string())?;
        if frame["op"] == op {
            return Ok(frame);
        }
        if frame["op"] == "status" && frame["level"] == "error" {
            return Err(frame["msg"].to_string());
        }
    }
}

fn succeeded(response: &Value) -> Result<(), String> {
    if response["result"] == true {
        Ok(())
    } else {
        Err(response["values"].to_string() + &response["status"].to_string())
    }
}

fn see_the_page(target: Target, patience: Duration) -> Result<(), String> {
    let query = if target.locked {
        format!("?token={TOKEN}")
    } else {
        String::new()
    };
    let fetch = || {
        let mut stream = TcpStream::connect_timeout(&target.address, patience)?;
        stream.set_read_timeout(Some(patience))?;
        stream.set_write_timeout(Some(patience))?;
        let request = format!("GET /{query} HTTP/1.1\r\nHost: {}\r\n\r\n", target.address);
        stream.write_all(request.as_bytes())?;
        let mut head = [0; 12];
        stream.read_exact(&mut head)?;
        Ok(head)
    };
    let head = fetch().map_err(|error: std::io::Error| error.to_string())?;
    // A redirection removes the token from the address.
    if head.starts_with(b"HTTP/1.1 2") || head.starts_with(b"HTTP/1.1 3") {
        return Ok(());
    }
    Err(String::from_utf8_lossy(&head).into_owned())
}

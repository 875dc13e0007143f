//! Clients that do everything to make the program hold memory, against the built program: `make test-slow` runs these.
//!
//! None of them reads a byte. Beside each attack an honest client calls and watches; it is served, and so is who comes new.
//!
//! **Invariant:** what is measured is the program's own peak, in a test build.

use std::io::{ErrorKind, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::common::{Client, Runtime};
use pendularm::actors::gateway::limits::MAX_MEMORY;
#[cfg(feature = "web")]
use pendularm_client::websocket;
use serde_json::json;

const MB: usize = 1_000_000;
/// How long each attack lasts.
const TIME: Duration = Duration::from_secs(8);

/// A client that sends and never reads: something first, then something else again and again.
struct Attacker {
    first: Vec<u8>,
    flood: Vec<u8>,
    stream: Option<TcpStream>,
    /// How much of `first`, and then of `flood`, has been sent.
    sent: usize,
}

impl Attacker {
    fn new(first: impl Into<Vec<u8>>, flood: impl Into<Vec<u8>>) -> Self {
        Self {
            first: first.into(),
            flood: flood.into(),
            stream: None,
            sent: 0,
        }
    }

    /// Sends what is taken; connects anew where it was disconnected.
    fn go_on(&mut self, runtime: &Runtime) {
        let Some(stream) = &mut self.stream else {
            let Ok(stream) = TcpStream::connect(runtime.address) else {
                return;
            };
            stream.set_nonblocking(true).unwrap();
            self.stream = Some(stream);
            self.sent = 0;
            return;
        };
        for _ in 0..8 {
            let next = match self.sent.checked_sub(self.first.len()) {
                None => &self.first[self.sent..],
                Some(_) if self.flood.is_empty() => return,
                Some(sent) => &self.flood[sent % self.flood.len()..],
            };
            match stream.write(&next[..next.len().min(256 * 1024)]) {
                Ok(written) => self.sent += written,
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(_) => {
                    self.stream = None;
                    return;
                }
            }
        }
    }
}

fn line(frame: &serde_json::Value) -> String {
    format!("{frame}\n")
}

/// Calls every 10 ms until told to stop; gives the longest wait for an answer.
fn be_honest(mut client: Client, stop: &AtomicBool) -> Duration {
    let mut longest = Duration::ZERO;
    while !stop.load(Ordering::Relaxed) {
        let began = Instant::now();
        client.settle();
        longest = longest.max(began.elapsed());
        std::thread::sleep(Duration::from_millis(10));
    }
    longest
}

/// Lets the attackers do what they do, and says what it cost.
fn attack(name: &str, attackers: Vec<Attacker>) -> usize {
    attack_on(&Runtime::with(&["--clients", "1024"]), name, attackers)
}

fn attack_on(runtime: &Runtime, name: &str, mut attackers: Vec<Attacker>) -> usize {
    let stop = AtomicBool::new(false);
    let honest = runtime.connect();
    let before = runtime.peak_memory();
    std::thread::scope(|scope| {
        let honest = scope.spawn(|| be_honest(honest, &stop));
        let end = Instant::now() + TIME;
        while Instant::now() < end && !honest.is_finished() {
            for attacker in &mut attackers {
                attacker.go_on(runtime);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        let mut newcomer = runtime.connect();
        newcomer.subscribe("/joint_states");
        newcomer.message("/joint_states");
        stop.store(true, Ordering::Relaxed);
        let longest = honest.join().unwrap();
        let peak = runtime.peak_memory();
        let sent: usize = attackers.iter().map(|one| one.sent).sum();
        println!(
            "{name}: {} MB sent by those still connected, peak {} MB, longest call {} ms",
            sent / MB,
            peak / MB,
            longest.as_millis()
        );
        assert!(peak < MAX_MEMORY, "{name}: {peak} bytes");
        peak.saturating_sub(before)
    })
}

/// The memory that the program has resident, in bytes.
fn resident_memory(runtime: &Runtime) -> usize {
    let pages = std::fs::read_to_string(format!("/proc/{}/statm", runtime.pid())).unwrap();
    4096 * pages.split(' ').nth(1).unwrap().parse::<usize>().unwrap()
}

/// Short messages are made by several threads and freed by others: a burst of them is all given back, some 200 MB.
#[test]
#[ignore = "make test-slow"]
fn memory_of_a_burst_goes_back_to_the_system() {
    let runtime = Runtime::start();
    let hoards = (0..50).map(|n| {
        let topic = format!("/{n}");
        let hoard = json!({"op": "subscribe", "topic": topic, "throttle_rate": 1_000_000_000,
            "queue_length": 100_000});
        let first = line(&hoard) + &line(&json!({"op": "advertise", "topic": topic}));
        let publish = json!({"op": "publish", "topic": topic, "msg": {"data": "held back"}});
        Attacker::new(first, line(&publish).repeat(500))
    });
    let peak = attack_on(
        &runtime,
        "50 hoards of messages held back",
        hoards.collect(),
    );
    assert!(peak > 100 * MB, "{peak}: nothing was tried");
    // The program carries out first what was sent.
    let end = Instant::now() + Duration::from_secs(60);
    while resident_memory(&runtime) > 40 * MB {
        let resident = resident_memory(&runtime);
        assert!(Instant::now() < end, "{resident} bytes are still resident");
        std::thread::sleep(Duration::from_millis(500));
    }
}

#[test]
#[ignore = "make test-slow"]
fn clients_that_read_no_statuses() {
    let short = "x\n".repeat(20_000);
    let one = attack("one deaf, statuses", vec![Attacker::new("", short)]);
    assert!(one < 64 * MB, "{one} bytes for 32 MiB");
    // A status repeats the id of the frame that it is about: those of short frames would be the work of minutes on a busy machine.
    let id = "x".repeat(10_000);
    let wrong = line(&json!({"op": "unadvertise_service", "service": "/none", "id": id}));
    let attackers = (0..40).map(|_| Attacker::new("", wrong.repeat(20)));
    let peak = attack("40 deaf, statuses", attackers.collect());
    assert!(peak > 100 * MB, "{peak}: nothing was tried");
}

#[test]
#[ignore = "make test-slow"]
fn clients_that_read_no_answers() {
    for (name, id) in [("calls", 1), ("calls with ids of 1 MB", MB)] {
        let id = "x".repeat(id);
        let call = line(&json!({"op": "call_service", "service": "/none", "id": id}));
        let flood = call.repeat(if id.len() < 10 { 1000 } else { 1 });
        let attackers = (0..40).map(|_| Attacker::new("", flood.clone()));
        attack(&format!("40 deaf, {name}"), attackers.collect());
    }
}

#[test]
#[ignore = "make test-slow"]
fn subscribers_that_read_no_messages() {
    // Long messages fill their sockets first. Then long ones, or small ones by the thousand; or held back by throttles.
    for (name, count, throttle, length) in [
        ("100 deaf, 40-byte messages", 100, 0, 1),
        ("300 throttled, 40-byte messages", 300, 1_000_000, 1),
        ("300 deaf, messages of 100 kB", 300, 0, 100_000),
    ] {
        let msg = "x".repeat(length);
        let publish = line(&json!({"op": "publish", "topic": "/t", "msg": {"data": msg}}));
        let flood = publish.repeat(if length < 10 { 2000 } else { 4 });
        let long = json!({"op": "publish", "topic": "/t", "msg": {"data": "x".repeat(3 * MB)}});
        let mut first = line(&json!({"op": "advertise", "topic": "/t"}));
        if throttle == 0 {
            first += &line(&long).repeat(3);
        }
        let mut attackers = vec![Attacker::new(first, flood)];
        for _ in 0..count {
            let subscribe = json!({"op": "subscribe", "topic": "/t", "throttle_rate": throttle,
                "queue_length": 100_000});
            attackers.push(Attacker::new(line(&subscribe), ""));
        }
        attack(name, attackers);
    }
}

/// Every subscriber has its own topic and its own publisher, so nothing is shared.
#[test]
#[ignore = "make test-slow"]
fn subscribers_that_read_no_messages_of_their_own() {
    let mut attackers = Vec::new();
    for n in 0..200 {
        let topic = format!("/{n}");
        let first = line(&json!({"op": "subscribe", "topic": topic}))
            + &line(&json!({"op": "advertise", "topic": topic}));
        let msg = "x".repeat(500_000);
        let publish = json!({"op": "publish", "topic": topic, "msg": {"data": msg}});
        attackers.push(Attacker::new(first, line(&publish)));
    }
    attack("200 deaf, 4 MiB of messages each", attackers);
}

#[test]
#[ignore = "make test-slow"]
fn frames_that_never_end() {
    let begun = format!("{{\"op\":\"publish\",\"msg\":\"{}", "x".repeat(4_190_000));
    let frames = (0..300).map(|_| Attacker::new(begun.clone(), ""));
    let peak = attack("300 unfinished frames", frames.collect());
    assert!(peak > 200 * MB, "{peak}: nothing was tried");
    let pieces: String = (0..4000)
        .map(|num| {
            let data = "x".repeat(1000);
            line(&json!({"op": "fragment", "id": 1, "num": num, "total": 4096, "data": data}))
        })
        .collect();
    let fragments = (0..300).map(|_| Attacker::new(pieces.clone(), ""));
    attack("300 unfinished messages in fragments", fragments.collect());
}

#[test]
#[ignore = "make test-slow"]
fn registrations_and_calls_of_a_day() {
    let mut attackers = Vec::new();
    for n in 0..150 {
        let mut first = line(&json!({"op": "set_level", "level": "none"}));
        for m in 0..1024 {
            let name = format!("/{n}/{m}/{}", "x".repeat(900));
            first += &line(&json!({"op": "subscribe", "topic": "/t", "id": name}));
            first += &line(&json!({"op": "advertise", "topic": name}));
            if m < 256 {
                first += &line(&json!({"op": "advertise_service", "service": name}));
            }
        }
        attackers.push(Attacker::new(first, ""));
    }
    attack("150 hogs of registrations", attackers);
    let provide = line(&json!({"op": "advertise_service", "service": "/s"}));
    let mut attackers = vec![Attacker::new(provide, "")];
    let id = "x".repeat(100_000);
    let call = line(&json!({"op": "call_service", "service": "/s", "id": id, "timeout": 86_400}));
    attackers.extend((0..60).map(|_| Attacker::new("", call.repeat(4))));
    attack("60 hogs of calls of a day", attackers);
}

/// A frame of a WebSocket.
#[cfg(feature = "web")]
fn frame(opcode: u8, payload: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    websocket::append(&mut bytes, opcode, [0; 4], payload);
    bytes
}

#[cfg(feature = "web")]
fn handshake(runtime: &Runtime) -> String {
    websocket::handshake(&runtime.address.to_string(), "/", "")
}

/// Messages whose text is read before it is written: a map and a list for each few bytes of the first, a value for
/// every two of the second; for three of the last a message of eighty.
#[cfg(feature = "web")]
#[test]
#[ignore = "make test-slow"]
fn messages_that_have_to_be_read_to_be_encoded() {
    let deep = "{\"a\":[".repeat(50) + &"]}".repeat(50) + ",";
    for (name, compression, type_name, unit) in [
        ("deep", "cbor", "demo/Deep", deep.as_str()),
        ("flat", "cbor", "demo/Flat", "1,"),
        ("short", "cbor-raw", "tf2_msgs/TFMessage", "{},"),
    ] {
        let runtime = Runtime::start();
        let all = unit.repeat(3 * MB / unit.len());
        let mut attackers = Vec::new();
        for n in 0..40 {
            let topic = format!("/{n}");
            let subscribe = json!({"op": "subscribe", "topic": topic, "compression": compression});
            let advertise = json!({"op": "advertise", "topic": topic, "type": type_name});
            let publish = format!(
                "{{\"op\":\"publish\",\"topic\":\"{topic}\",\"msg\":{{\"transforms\":[{all}{{}}]}}}}\n"
            );
            attackers.push(Attacker::new(line(&advertise), publish));
            let heard = [
                handshake(&runtime).into_bytes(),
                frame(0x81, subscribe.to_string().as_bytes()),
            ];
            attackers.push(Attacker::new(heard.concat(), ""));
        }
        attack_on(&runtime, &format!("{name} messages in binary"), attackers);
    }
}

#[cfg(feature = "web")]
#[test]
#[ignore = "make test-slow"]
fn websockets_that_read_nothing() {
    let runtime = Runtime::with(&["--clients", "1024"]);
    let open = handshake(&runtime);
    let pings = frame(0x89, &[b'x'; 125]).repeat(2000);
    let one = attack_on(
        &runtime,
        "pings whose pongs are not read",
        vec![Attacker::new(open.clone(), pings.clone())],
    );
    assert!(one < 8 * MB, "{one} bytes");
    let many = (0..100).map(|_| Attacker::new(open.clone(), pings.clone()));
    attack_on(&runtime, "the same by 100", many.collect());
    let begun = [open.clone().into_bytes(), frame(0x01, b"{")].concat();
    let empty = frame(0x00, b"").repeat(20_000);
    let many = (0..100).map(|_| Attacker::new(begun.clone(), empty.clone()));
    attack_on(&runtime, "100 with empty fragments", many.collect());
    let full = frame(0x00, &[b' '; 125]).repeat(20_000);
    let many = (0..300).map(|_| Attacker::new(begun.clone(), full.clone()));
    attack_on(&runtime, "300 with unfinished messages", many.collect());
}

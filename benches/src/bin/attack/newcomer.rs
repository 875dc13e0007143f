//! Newcomers: each connects, does a little of everything that the program is there for, and goes.
//!
//! **Invariant:** a newcomer asks for little, so that whoever is fair to all has room for it.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use pendularm_benches::attack::TOKEN;
use pendularm_benches::protocol::{Event, Protocol};
use pendularm_client::blocking::Client;
use pendularm_client::codec::Framing;
use serde_json::{Value, json};

use crate::target::Target;

/// Between two visits.
const PERIOD: Duration = Duration::from_millis(250);
/// Bytes of the message that a newcomer sends itself.
const MESSAGE: usize = 256 * 1024;

/// How they fared.
#[derive(Default)]
pub struct Visits {
    pub made: usize,
    pub served: usize,
    /// The longest of those that were served \[ms\].
    pub longest: f64,
    /// The fault of the first newcomer that was not served.
    pub fault: Option<String>,
}

/// Visits until it is told to stop.
pub fn come_and_go(target: Target, stop: &AtomicBool) -> Visits {
    let mut visits = Visits::default();
    while !stop.load(Ordering::Relaxed) {
        let began = Instant::now();
        visits.made += 1;
        let visited = match target.protocol {
            Protocol::Pendularm => visit(target, visits.made),
            Protocol::Redis | Protocol::Mosquitto => visit_peer(target, visits.made),
        };
        match visited {
            Ok(()) => {
                visits.served += 1;
                visits.longest = visits.longest.max(began.elapsed().as_secs_f64() * 1e3);
            }
            Err(why) => drop(visits.fault.get_or_insert(why)),
        }
        std::thread::sleep(
            PERIOD
                .saturating_sub(began.elapsed())
                .max(Duration::from_millis(20)),
        );
    }
    visits
}

fn connect(target: Target) -> Result<TcpStream, String> {
    let connect = || {
        let stream = TcpStream::connect_timeout(&target.address, target.patience)?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(target.patience))?;
        stream.set_write_timeout(Some(target.patience))?;
        Ok::<_, std::io::Error>(stream)
    };
    connect().map_err(|error| format!("connecting: {error}"))
}

/// A call of a service of its own, a message to itself, a small computation, the page.
fn visit(target: Target, number: usize) -> Result<(), String> {
    let client = Client::connect(Framing::Lines, target.address, target.patience);
    let mut client = Newcomer(
        client.map_err(|error| format!("connecting: {error}"))?,
        target,
    );
    if target.locked {
        client.send(&json!({"op": "auth", "token": TOKEN}))?;
    }
    let (service, topic) = (
        format!("/newcomer/{number}/service"),
        format!("/newcomer/{number}/topic"),
    );
    let part = |name: &'static str| move |why: String| format!("{name}: {why}");
    let mut calling = || {
        client.send(&json!({"op": "advertise_service", "service": service}))?;
        client.send(&json!({"op": "call_service", "service": service, "id": "call"}))?;
        let forwarded = client.next("call_service")?;
        client.send(
            &json!({"op": "service_response", "service": service, "id": forwarded["id"],
            "result": true, "values": {}}),
        )?;
        succeeded(&client.next("service_response")?)
    };
    calling().map_err(part("a forwarded call"))?;
    let mut publishing = || {
        let content = "x".repeat(MESSAGE);
        client.send(&json!({"op": "subscribe", "topic": topic}))?;
        client.send(&json!({"op": "advertise", "topic": topic}))?;
        client.send(&json!({"op": "publish", "topic": topic, "msg": {"data": content}}))?;
        let came = client.next("publish")?;
        let whole = came["msg"]["data"].as_str() == Some(content.as_str());
        if whole {
            Ok(())
        } else {
            Err("its message came back different".to_owned())
        }
    };
    publishing().map_err(part("a message to itself"))?;
    let mut computing = || {
        let args = json!({"function": "t", "x0": 0, "dt": 0.01, "steps": 100, "integrator": "rk4"});
        let service = "/arm_sim/integration_step";
        client.send(
            &json!({"op": "call_service", "service": service, "id": "compute", "args": args}),
        )?;
        succeeded(&client.next("service_response")?)
    };
    computing().map_err(part("a computation"))?;
    see_the_page(target).map_err(part("the page"))
}

fn succeeded(response: &Value) -> Result<(), String> {
    if response["result"] == true {
        Ok(())
    } else {
        Err(response["values"].to_string() + &response["status"].to_string())
    }
}

fn see_the_page(target: Target) -> Result<(), String> {
    let mut stream = connect(target)?;
    let query = if target.locked {
        format!("?token={TOKEN}")
    } else {
        String::new()
    };
    let request = format!("GET /{query} HTTP/1.1\r\nHost: {}\r\n\r\n", target.address);
    stream
        .write_all(request.as_bytes())
        .map_err(|error| error.to_string())?;
    let mut head = [0; 12];
    stream
        .read_exact(&mut head)
        .map_err(|error| error.to_string())?;
    // A redirection takes the token out of the address.
    let found = head.starts_with(b"HTTP/1.1 2") || head.starts_with(b"HTTP/1.1 3");
    if found {
        Ok(())
    } else {
        Err(String::from_utf8_lossy(&head).into_owned())
    }
}

/// A client that is told, and does not panic, when something does not come.
struct Newcomer(Client, Target);

impl Newcomer {
    fn send(&mut self, frame: &Value) -> Result<(), String> {
        let line = format!("{frame}\n");
        self.0
            .write(line.as_bytes())
            .map_err(|error| error.to_string())
    }

    /// The next frame of that operation; an error status ends the wait.
    fn next(&mut self, op: &str) -> Result<Value, String> {
        let deadline = Instant::now() + self.1.patience;
        loop {
            let frame = self
                .0
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
}

/// A session and a request.
fn visit_peer(target: Target, number: usize) -> Result<(), String> {
    let mut stream = connect(target)?;
    let mut bytes = Vec::new();
    target.protocol.greet(100_000 + number, &mut bytes);
    target.protocol.ask(&mut bytes);
    stream
        .write_all(&bytes)
        .map_err(|error| error.to_string())?;
    let mut unread = Vec::new();
    loop {
        let mut chunk = [0; 256];
        match stream.read(&mut chunk).map_err(|error| error.to_string())? {
            0 => return Err("closed".to_owned()),
            read => unread.extend_from_slice(&chunk[..read]),
        }
        while let Some((event, length)) = (!unread.is_empty())
            .then(|| target.protocol.next(&unread))
            .flatten()
        {
            match event {
                Event::Answer => return Ok(()),
                Event::Complaint(what) => return Err(String::from_utf8_lossy(what).into_owned()),
                _ => drop(unread.drain(..length)),
            }
        }
    }
}

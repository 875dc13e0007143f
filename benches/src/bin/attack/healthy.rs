//! The healthy clients: a caller, a watcher, newcomers. An attack is judged by the service that they get.
//!
//! **Invariant:** calls are made when they are due, whether or not those before them are answered, so a
//! standstill costs all of them.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use pendularm_benches::attack::TOKEN;
use pendularm_benches::protocol::{Event, Protocol};

use crate::newcomer::{self, Visits};
use crate::target::Target;

/// Between two calls.
const CALLS: Duration = Duration::from_millis(10);
/// Between two messages of a server that has no arm: the period of `/joint_states`.
const MESSAGES: Duration = Duration::from_micros(16_667);
/// The topic that is watched on a server without an arm.
const TOPIC: &str = "/healthy";

/// The healthy clients' calls and messages, and their delays.
pub struct Health {
    pub asked: usize,
    /// Delays of the calls that were answered \[ms\], in rising order.
    pub delays: Vec<f64>,
    /// Between two messages, and from the last to the end \[ms\].
    pub longest_gap: f64,
    pub visits: Visits,
    pub faults: Vec<String>,
}

/// The threads, running.
pub struct Healthy {
    stop: Arc<AtomicBool>,
    caller: JoinHandle<(usize, Vec<f64>, Option<String>)>,
    watcher: JoinHandle<(f64, Option<String>)>,
    newcomers: JoinHandle<Visits>,
}

impl Healthy {
    /// Connects, and starts to call and to watch.
    pub fn start(target: Target) -> Result<Self, String> {
        let (caller, watcher) = (Link::open(target, 99_990)?, Link::open(target, 99_991)?);
        let publisher = match target.protocol {
            Protocol::Pendularm => None,
            Protocol::Redis | Protocol::Mosquitto => Some(Link::open(target, 99_992)?),
        };
        let stop: Arc<AtomicBool> = Arc::default();
        let stops = [(); 3].map(|()| Arc::clone(&stop));
        let [one, two, three] = stops;
        Ok(Self {
            stop,
            caller: std::thread::spawn(move || call(caller, target, &one)),
            watcher: std::thread::spawn(move || watch(watcher, publisher, target, &two)),
            newcomers: std::thread::spawn(move || newcomer::come_and_go(target, &three)),
        })
    }

    /// Stops, once the answers that are on their way have come or patience ends.
    pub fn finish(self) -> Health {
        self.stop.store(true, Ordering::Relaxed);
        let (asked, mut delays, fault) = self.caller.join().unwrap_or_default();
        let (longest_gap, other) = self.watcher.join().unwrap_or_default();
        let visits = self.newcomers.join().unwrap_or_default();
        delays.sort_unstable_by(f64::total_cmp);
        Health {
            asked,
            delays,
            longest_gap,
            visits,
            faults: fault.into_iter().chain(other).collect(),
        }
    }
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

fn call(mut link: Link, target: Target, stop: &AtomicBool) -> (usize, Vec<f64>, Option<String>) {
    let mut request = Vec::new();
    target.protocol.ask(&mut request);
    let (mut asked, mut delays, mut waiting) = (0, Vec::new(), VecDeque::new());
    let mut due = Instant::now();
    let mut until = None;
    loop {
        let now = Instant::now();
        if until.is_none() && stop.load(Ordering::Relaxed) {
            until = Some(now + target.patience);
        }
        match until {
            Some(until) if waiting.is_empty() || now >= until => return (asked, delays, None),
            None if now >= due => {
                due = (due + CALLS).max(now);
                waiting.push_back(now);
                asked += 1;
                if let Err(error) = link.stream.write_all(&request) {
                    return (
                        asked,
                        delays,
                        Some(format!("a call could not be made: {error}")),
                    );
                }
            }
            _ => {}
        }
        let heard = link.hear(due.saturating_duration_since(Instant::now()), |event| {
            if let (Event::Answer, Some(sent)) = (event, waiting.front()) {
                delays.push(milliseconds(Instant::elapsed(sent)));
                waiting.pop_front();
            }
        });
        if let Err(why) = heard {
            return (asked, delays, Some(format!("the caller: {why}")));
        }
    }
}

fn watch(
    mut link: Link,
    mut publisher: Option<Link>,
    target: Target,
    stop: &AtomicBool,
) -> (f64, Option<String>) {
    let topic = if publisher.is_some() {
        TOPIC
    } else {
        "/joint_states"
    };
    let mut bytes = Vec::new();
    target.protocol.subscribe(topic, &mut bytes);
    let mut message = Vec::new();
    target.protocol.publish(topic, &[b'x'; 330], &mut message);
    let mut fault = link
        .stream
        .write_all(&bytes)
        .err()
        .map(|error| error.to_string());
    let (mut longest, mut last, mut due) = (0.0_f64, Instant::now(), Instant::now());
    while fault.is_none() && !stop.load(Ordering::Relaxed) {
        if let Some(publisher) = publisher.as_mut().filter(|_| Instant::now() >= due) {
            due = (due + MESSAGES).max(Instant::now());
            fault = publisher
                .stream
                .write_all(&message)
                .err()
                .map(|error| error.to_string());
            fault = fault.or(publisher.hear(Duration::from_micros(1), |_| {}).err());
        }
        let wait = if publisher.is_some() {
            due.saturating_duration_since(Instant::now())
        } else {
            CALLS
        };
        let heard = link.hear(wait, |event| {
            if let Event::Message(_) = event {
                longest = longest.max(milliseconds(last.elapsed()));
                last = Instant::now();
            }
        });
        fault = fault.or(heard.err());
    }
    (
        longest.max(milliseconds(last.elapsed())),
        fault.map(|why| format!("the watcher: {why}")),
    )
}

/// A plain connection to a server.
struct Link {
    protocol: Protocol,
    stream: TcpStream,
    unread: Vec<u8>,
}

impl Link {
    fn open(target: Target, number: usize) -> Result<Self, String> {
        let open = || {
            let mut stream = TcpStream::connect(target.address)?;
            stream.set_nodelay(true)?;
            let mut greeting = Vec::new();
            target.protocol.greet(number, &mut greeting);
            if target.locked {
                greeting.extend(format!("{{\"op\":\"auth\",\"token\":\"{TOKEN}\"}}\n").bytes());
            }
            stream.write_all(&greeting)?;
            Ok::<_, std::io::Error>(stream)
        };
        let stream =
            open().map_err(|error| format!("the healthy client is not accepted: {error}"))?;
        Ok(Self {
            protocol: target.protocol,
            stream,
            unread: Vec::new(),
        })
    }

    /// Takes what comes within `wait`, or what comes first.
    fn hear(&mut self, wait: Duration, mut each: impl FnMut(Event)) -> Result<(), String> {
        let mut chunk = [0; 16 * 1024];
        let _ = self
            .stream
            .set_read_timeout(Some(wait.max(Duration::from_micros(1))));
        match self.stream.read(&mut chunk) {
            Ok(0) => return Err("its connection was closed".to_owned()),
            Ok(read) => self.unread.extend_from_slice(&chunk[..read]),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(error) => return Err(error.to_string()),
        }
        while let Some((event, length)) = (!self.unread.is_empty())
            .then(|| self.protocol.next(&self.unread))
            .flatten()
        {
            if let Event::Complaint(what) = event {
                return Err(String::from_utf8_lossy(what).into_owned());
            }
            each(event);
            self.unread.drain(..length);
        }
        Ok(())
    }
}

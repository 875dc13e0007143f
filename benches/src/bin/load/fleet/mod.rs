//! The clients of one server: publishers and subscribers behind one `epoll`, on one thread, the same for every server.
//!
//! **Invariant:** every subscriber gets every message of its topic once and in order, or the run fails.

mod reading;

use std::io::{ErrorKind, Write};
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use mio::net::TcpStream;
use mio::{Events, Interest, Poll, Token};

use crate::message::Template;
use pendularm_benches::program::{ThreadWork, resident, threads, threads_since};
use pendularm_benches::protocol::Protocol;

/// Longest wait for a server. After that the run fails.
const PATIENCE: Duration = Duration::from_secs(20);
/// Duration of a scene before the measurement.
const WARM_UP: Duration = Duration::from_millis(500);
/// Messages that a flooding publisher sends in one write.
const BURST: u64 = 16;
/// Messages of a flooding publisher that its slowest subscriber may still miss. They are few enough that no server
/// drops any.
const WINDOW: u64 = 256;

/// Messages of the arm in a second.
pub const ARM_RATE: f64 = 60.0;

/// The publisher, and its rate.
#[derive(Clone, Copy, PartialEq)]
pub enum Traffic {
    /// This many times a second.
    Rate(f64),
    /// As fast as the slowest subscriber reads them.
    Flood,
    /// The arm publishes its own topic.
    Arm,
}

/// Topics, each with one publisher and `subscribers` subscribers.
#[derive(Clone, Copy)]
pub struct Scene {
    pub name: &'static str,
    pub topics: usize,
    pub subscribers: usize,
    pub traffic: Traffic,
}

impl Outcome {
    /// Processor time of the server while it was measured \[ns\].
    pub fn processor(&self) -> u64 {
        self.threads.iter().map(|one| one.processor).sum()
    }
}

impl Scene {
    /// A scene of one topic.
    pub const fn new(name: &'static str, traffic: Traffic, subscribers: usize) -> Self {
        Self {
            name,
            topics: 1,
            subscribers,
            traffic,
        }
    }

    /// The same scene as a server plays it: only pendularm has an arm. The others get messages of its length and rate.
    pub fn with(self, server: Protocol) -> Self {
        match self.traffic {
            Traffic::Arm if server != Protocol::Pendularm => Self {
                traffic: Traffic::Rate(ARM_RATE),
                ..self
            },
            _ => self,
        }
    }

    /// Whether a server at rest takes about as much processor time as its deliveries.
    pub const fn is_light(&self) -> bool {
        matches!(self.traffic, Traffic::Rate(_)) && self.subscribers <= 10
    }
}

/// The outcome of a scene.
pub struct Outcome {
    pub seconds: f64,
    pub deliveries: u64,
    /// The work of the server's threads while it was measured.
    pub threads: Vec<ThreadWork>,
    /// Time from the creation of each message to its reading \[ns\]. None if the arm publishes.
    pub latencies: Vec<u32>,
    /// Resident memory of the server at the end \[MB\].
    pub resident: f64,
}

/// One connection.
struct Link {
    stream: TcpStream,
    /// The topic that it publishes or subscribes to.
    topic: usize,
    /// The beginning of an incomplete event.
    unread: Vec<u8>,
    /// Bytes that the socket has not taken yet.
    unsent: Vec<u8>,
    ready: bool,
    received: u64,
    /// Stamps of what the arm has published.
    stamps: Vec<u64>,
}

/// All connections of a scene: subscribers first, then publishers.
pub struct Fleet {
    protocol: Protocol,
    scene: Scene,
    names: Vec<String>,
    poll: Poll,
    events: Events,
    links: Vec<Link>,
    subscribers: usize,
    /// Messages sent, by topic.
    sent: Vec<u64>,
    /// Messages received in all.
    deliveries: u64,
    latencies: Vec<u32>,
    measuring: bool,
    template: Template,
    chunk: Vec<u8>,
}

impl Fleet {
    /// Connects and subscribes all clients. Returns when every subscription is active.
    pub fn open(protocol: Protocol, address: SocketAddr, scene: Scene) -> Self {
        let names = (0..scene.topics)
            .map(|topic| match scene.traffic {
                Traffic::Arm => "/joint_states".to_owned(),
                _ => format!("/load/topic{topic}"),
            })
            .collect();
        let publishers = if scene.traffic == Traffic::Arm {
            0
        } else {
            scene.topics
        };
        let subscribers = scene.topics * scene.subscribers;
        let mut fleet = Self {
            protocol,
            scene,
            names,
            poll: Poll::new().expect("epoll"),
            events: Events::with_capacity(1024),
            links: Vec::new(),
            subscribers,
            sent: vec![0; scene.topics],
            deliveries: 0,
            latencies: Vec::new(),
            measuring: false,
            template: Template::new(),
            chunk: vec![0; 256 * 1024],
        };
        for number in 0..subscribers + publishers {
            fleet.connect(address, number);
        }
        if protocol.greets_back() {
            fleet.await_ready(0..subscribers + publishers);
        }
        for number in 0..subscribers {
            let topic = fleet.links[number].topic;
            protocol.subscribe(&fleet.names[topic], &mut fleet.links[number].unsent);
            fleet.links[number].flush();
        }
        fleet.await_ready(0..subscribers);
        for number in subscribers..subscribers + publishers {
            let topic = fleet.links[number].topic;
            protocol.advertise(&fleet.names[topic], &mut fleet.links[number].unsent);
            fleet.links[number].flush();
        }
        fleet
    }

    fn connect(&mut self, address: SocketAddr, number: usize) {
        let stream = std::net::TcpStream::connect(address).expect("the server accepts");
        stream.set_nodelay(true).expect("nodelay");
        stream.set_nonblocking(true).expect("non-blocking");
        let mut stream = TcpStream::from_std(stream);
        let interest = Interest::READABLE | Interest::WRITABLE;
        self.poll
            .registry()
            .register(&mut stream, Token(number), interest)
            .expect("epoll");
        let topic = if number < self.subscribers {
            number / self.scene.subscribers
        } else {
            number - self.subscribers
        };
        let mut link = Link {
            stream,
            topic,
            unread: Vec::new(),
            unsent: Vec::new(),
            ready: false,
            received: 0,
            stamps: Vec::new(),
        };
        self.protocol.greet(number, &mut link.unsent);
        link.flush();
        self.links.push(link);
    }

    /// Waits until each of these has been confirmed, and removes it.
    fn await_ready(&mut self, links: std::ops::Range<usize>) {
        let deadline = Instant::now() + PATIENCE;
        while self.links[links.clone()].iter().any(|link| !link.ready) {
            assert!(
                Instant::now() < deadline,
                "{:?} leaves a client waiting",
                self.protocol
            );
            self.turn(Duration::from_millis(10));
        }
        for link in &mut self.links[links] {
            link.ready = false;
        }
    }

    /// Runs the scene for `seconds` after a warm-up, then waits for all sent messages.
    pub fn run(mut self, pid: u32, seconds: f64) -> Outcome {
        let began = Instant::now();
        let (mut measured_from, mut at_start, mut before) = (None, Vec::new(), 0);
        let mut next = began;
        let (wall, deliveries, used) = loop {
            let now = Instant::now();
            match measured_from {
                None if now >= began + WARM_UP => {
                    (measured_from, before) = (Some(now), self.deliveries);
                    at_start = threads(pid);
                    self.measuring = true;
                }
                Some(from) if now >= from + Duration::from_secs_f64(seconds) => {
                    let used = threads_since(pid, &at_start);
                    break (now - from, self.deliveries - before, used);
                }
                _ => {}
            }
            let wait = self.publish(now, &mut next);
            self.turn(wait);
        };
        self.measuring = false;
        self.drain();
        Outcome {
            seconds: wall.as_secs_f64(),
            deliveries,
            threads: used,
            latencies: std::mem::take(&mut self.latencies),
            resident: resident(pid),
        }
    }

    /// Sends all due messages. Returns the time until the next ones may be due.
    fn publish(&mut self, now: Instant, next: &mut Instant) -> Duration {
        match self.scene.traffic {
            Traffic::Arm => Duration::from_millis(20),
            Traffic::Flood => {
                for topic in 0..self.scene.topics {
                    self.flood(topic);
                }
                Duration::from_millis(20)
            }
            Traffic::Rate(rate) => {
                if now >= *next {
                    let period = Duration::from_secs_f64(1.0 / rate);
                    // A tick that was missed is skipped.
                    *next = (*next + period).max(now);
                    for topic in 0..self.scene.topics {
                        self.send(topic, 1);
                    }
                }
                next.saturating_duration_since(Instant::now())
            }
        }
    }

    /// Sends bursts as long as every subscriber of the topic keeps up.
    fn flood(&mut self, topic: usize) {
        let group = topic * self.scene.subscribers..(topic + 1) * self.scene.subscribers;
        let slowest = self.links[group]
            .iter()
            .map(|link| link.received)
            .min()
            .unwrap_or(0);
        while self.sent[topic] + BURST <= slowest + WINDOW {
            self.send(topic, BURST);
        }
    }

    fn send(&mut self, topic: usize, count: u64) {
        let link = &mut self.links[self.subscribers + topic];
        for _ in 0..count {
            let payload = self.template.write(self.sent[topic]);
            self.protocol
                .publish(&self.names[topic], payload, &mut link.unsent);
            self.sent[topic] += 1;
        }
        link.flush();
    }

    /// Waits until every subscriber has all messages, and checks them.
    fn drain(&mut self) {
        let deadline = Instant::now() + PATIENCE;
        if self.scene.traffic == Traffic::Arm {
            // A subscriber may be a message ahead of another. All must reach the newest present message.
            let newest = self
                .links
                .iter()
                .filter_map(|link| link.stamps.last())
                .max()
                .copied();
            let newest = newest.expect("the arm publishes");
            while self
                .links
                .iter()
                .any(|link| link.stamps.last() < Some(&newest))
            {
                assert!(
                    Instant::now() < deadline,
                    "a subscriber never got the arm's message of {newest} ns"
                );
                self.turn(Duration::from_millis(10));
            }
            let oldest = self
                .links
                .iter()
                .filter_map(|link| link.stamps.first())
                .max()
                .copied();
            let common = oldest.expect("the arm publishes")..=newest;
            let mut all = self
                .links
                .iter()
                .map(|link| link.stamps.iter().filter(|&stamp| common.contains(stamp)));
            let first: Vec<_> = all.next().expect("a subscriber").collect();
            assert!(
                all.all(|stamps| stamps.eq(first.iter().copied())),
                "subscribers got different messages of the arm"
            );
            return;
        }
        for link in 0..self.subscribers {
            let sent = self.sent[self.links[link].topic];
            while self.links[link].received < sent {
                let received = self.links[link].received;
                assert!(
                    Instant::now() < deadline,
                    "{:?} lost messages: {received} of {sent} came to subscriber {link}",
                    self.protocol
                );
                self.turn(Duration::from_millis(10));
            }
        }
    }
}

impl Link {
    /// Writes as much as the socket accepts. `epoll` reports when it accepts more.
    fn flush(&mut self) {
        while !self.unsent.is_empty() {
            match self.stream.write(&self.unsent) {
                Ok(written) => drop(self.unsent.drain(..written)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(error) => panic!("a write fails: {error}"),
            }
        }
    }
}

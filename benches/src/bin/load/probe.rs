//! A server under load, measured by another client: the time of a light request, and whether the arm keeps real time.
//!
//! **Invariant:** each probe has its own connection and thread, and sends few requests.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::message::now;
use pendularm_benches::program::simulation_time;
use pendularm_benches::protocol::{Event, Protocol};
use pendularm_client::blocking;

/// Between two requests.
const PERIOD: Duration = Duration::from_millis(20);
/// A request that takes longer fails the run.
const PATIENCE: Duration = Duration::from_secs(20);

/// A thread that probes until `stop` is set.
pub struct Probe<T> {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<T>,
}

impl<T: Send + 'static> Probe<T> {
    fn start(work: impl FnOnce(&AtomicBool) -> T + Send + 'static) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        Self {
            stop,
            thread: std::thread::spawn(move || work(&flag)),
        }
    }

    pub fn stop(self) -> T {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().expect("the probe ends well")
    }
}

/// How long each request took, from its sending to its answer \[ns\].
pub fn caller(protocol: Protocol, address: SocketAddr) -> Probe<Vec<u32>> {
    Probe::start(move |stop| {
        let mut client = Client::connect(protocol, address);
        let mut request = Vec::new();
        protocol.ask(&mut request);
        let mut times = Vec::new();
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(PERIOD);
            let sent = Instant::now();
            client.stream.write_all(&request).expect("sent");
            client.await_event(|event| matches!(event, Event::Answer));
            times.push(u32::try_from(sent.elapsed().as_nanos()).unwrap_or(u32::MAX));
        }
        times
    })
}

/// Simulation time by wall time. A message on `/clock` may be late, but never early. So the earliest of the first second
/// and of the last are compared.
pub fn clock(address: SocketAddr) -> Probe<f64> {
    Probe::start(move |stop| {
        let mut client = blocking::Client::to(address);
        client.subscribe("/clock");
        let mut received = Vec::new();
        while !stop.load(Ordering::Relaxed) {
            received.push((simulation_time(&mut client), now() as f64 * 1e-9));
        }
        let second = received.len().min(60);
        let earliest = |part: &[(f64, f64)]| {
            let by_delay = |a: &&(f64, f64), b: &&(f64, f64)| (a.1 - a.0).total_cmp(&(b.1 - b.0));
            *part.iter().min_by(by_delay).expect("received")
        };
        let (first, last) = (
            earliest(&received[..second]),
            earliest(&received[received.len() - second..]),
        );
        (last.0 - first.0) / (last.1 - first.1)
    })
}

/// A plain connection to any of the servers.
struct Client {
    protocol: Protocol,
    stream: TcpStream,
    unread: Vec<u8>,
}

impl Client {
    fn connect(protocol: Protocol, address: SocketAddr) -> Self {
        let stream = TcpStream::connect(address).expect("the server accepts");
        stream.set_nodelay(true).expect("nodelay");
        stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
        let mut client = Self {
            protocol,
            stream,
            unread: Vec::new(),
        };
        let mut greeting = Vec::new();
        protocol.greet(99_999, &mut greeting);
        client.stream.write_all(&greeting).expect("sent");
        if protocol.greets_back() {
            client.await_event(|event| matches!(event, Event::Ready));
        }
        client
    }

    /// Reads until `is_wanted` accepts an event.
    fn await_event(&mut self, is_wanted: impl Fn(&Event) -> bool) {
        loop {
            while let Some((event, length)) = self.protocol.next(&self.unread) {
                let is_last = is_wanted(&event);
                self.unread.drain(..length);
                if is_last {
                    return;
                }
            }
            let mut chunk = [0; 4096];
            match self.stream.read(&mut chunk) {
                Ok(0) => panic!("{:?} has closed a probe's connection", self.protocol),
                Ok(read) => self.unread.extend_from_slice(&chunk[..read]),
                Err(error) => panic!("{:?} does not answer a probe: {error}", self.protocol),
            }
        }
    }
}

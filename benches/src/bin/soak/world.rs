//! The world of a soak, which all clients share: where the program listens, what was done, what went wrong.
//!
//! **Invariant:** numbers given out are never given out again, so what comes back under one belongs to one question.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

/// How long anything may take before it counts as never. It is far beyond any answer's own limit (forwarded calls have
/// 10 s), and long enough for a machine that is busy with other work.
pub const PATIENCE: Duration = Duration::from_secs(30);
/// Faults that are kept in full; the rest are counted. A program that is broken breaks for everyone.
const MAX_FAULTS: usize = 20;

/// Whether kinds of clients, or attacks, of that name come: all of them, unless `ONLY` names some, between commas.
pub fn is_wanted(name: &str) -> bool {
    let only = std::env::var("ONLY").unwrap_or_default();
    only.is_empty() || only.split(',').any(|one| one == name)
}

/// Something that must not happen, as one client saw it.
#[derive(Debug)]
pub struct Fault {
    /// The client's number.
    pub client: String,
    /// The fault itself.
    pub what: String,
    /// The last it sent, shortened, oldest first.
    pub sent: Vec<String>,
    /// The last that came, shortened, oldest first.
    pub came: Vec<String>,
}

impl Fault {
    /// A fault that no client's traffic explains.
    pub fn of(client: &str, what: impl Into<String>) -> Self {
        Self {
            client: client.to_owned(),
            what: what.into(),
            sent: Vec::new(),
            came: Vec::new(),
        }
    }
}

/// Shared by every client; one thread, so plain cells do.
pub struct World {
    /// Address that the program listens on.
    pub address: SocketAddr,
    counts: RefCell<BTreeMap<&'static str, u64>>,
    faults: RefCell<Vec<Fault>>,
    further_faults: Cell<u64>,
    numbers: Cell<u64>,
    /// When the clients that come and go should be gone.
    tide_ends: Cell<Instant>,
    /// The latest of `/diagnostics`.
    pub diagnosis: RefCell<Diagnosis>,
    /// When the operator reset or paused the arm.
    pub deeds: RefCell<Deeds>,
    /// The kinds of clients that there were, from when to when.
    pub lives: RefCell<Vec<(&'static str, Instant, Instant)>>,
}

/// The gateway's latest `/diagnostics`, and the arm's over time.
#[derive(Debug, Default, Clone)]
pub struct Diagnosis {
    /// Messages of `/diagnostics` so far.
    pub messages: u64,
    /// Clients connected.
    pub connections: u64,
    /// Topic messages dropped since the start.
    pub dropped: u64,
    /// The lowest real-time factor of a message in which the arm was running.
    pub lowest_factor: Option<f64>,
    /// The longest time per step of a batch \[s\].
    pub longest_step: f64,
    /// States other than running and paused, as they were first shown.
    pub strange_states: Vec<String>,
}

/// When the arm's clock was touched, each as the time before the call and after its answer.
#[derive(Debug, Default, Clone)]
pub struct Deeds {
    /// Resets.
    pub resets: Vec<(Instant, Instant)>,
    /// Pauses, from before the call that began it to after the answer of the call that ended it.
    pub pauses: Vec<(Instant, Instant)>,
}

impl World {
    /// A world in which nothing has happened yet.
    pub fn new(address: SocketAddr) -> Self {
        Self {
            address,
            counts: RefCell::default(),
            faults: RefCell::default(),
            further_faults: Cell::default(),
            numbers: Cell::new(1000),
            tide_ends: Cell::new(Instant::now()),
            diagnosis: RefCell::default(),
            deeds: RefCell::default(),
            lives: RefCell::default(),
        }
    }

    /// A number that nobody had before.
    pub fn number(&self) -> u64 {
        self.numbers.set(self.numbers.get() + 1);
        self.numbers.get()
    }

    /// Counts something that was done or seen.
    pub fn count(&self, what: &'static str, times: u64) {
        *self.counts.borrow_mut().entry(what).or_default() += times;
    }

    /// Everything counted, by name.
    pub fn counts(&self) -> Vec<(&'static str, u64)> {
        self.counts
            .borrow()
            .iter()
            .map(|(what, times)| (*what, *times))
            .collect()
    }

    /// Keeps a fault, and says it at once: a soak may be long.
    pub fn report(&self, fault: Fault) {
        let mut faults = self.faults.borrow_mut();
        if faults.len() >= MAX_FAULTS {
            self.further_faults.set(self.further_faults.get() + 1);
            return;
        }
        println!("FAULT {}: {}", fault.client, fault.what);
        for line in &fault.sent {
            println!("    sent {line}");
        }
        for line in &fault.came {
            println!("    came {line}");
        }
        faults.push(fault);
    }

    /// How many faults there were.
    pub fn faults(&self) -> u64 {
        self.faults.borrow().len() as u64 + self.further_faults.get()
    }

    /// Clients that come and go should be gone at that time.
    pub fn end_tide_at(&self, when: Instant) {
        self.tide_ends.set(when);
    }

    /// How long until then.
    pub fn time_left(&self) -> Duration {
        self.tide_ends
            .get()
            .saturating_duration_since(Instant::now())
    }
}

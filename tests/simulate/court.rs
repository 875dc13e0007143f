//! The one seeded generator, the log of its draws and of all received frames, and the first failure.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::fmt;
use std::hash::{DefaultHasher, Hasher};

use tokio::time::Instant;

/// Reasons to end a seed early. The number is the exit status of the process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// A frame is wrong or missing.
    Wrong = 1,
    /// A panic that the test did not cause.
    Crash = 2,
    /// An operation does not end.
    NoProgress = 3,
}

/// The failure of a seed: its kind and a description.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    pub verdict: Verdict,
    pub words: String,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.verdict {
            Verdict::Wrong => "wrong",
            Verdict::Crash => "crash",
            Verdict::NoProgress => "no progress",
        };
        write!(f, "{kind}: {}", self.words)
    }
}

/// The shared state of a simulation.
pub struct Court {
    rng: RefCell<fastrand::Rng>,
    began: Instant,
    /// Hash of everything logged so far.
    hash: RefCell<DefaultHasher>,
    /// The log itself, if it is kept.
    log: Option<RefCell<Vec<String>>>,
    failure: RefCell<Option<Failure>>,
    /// Number of rounds in which every task had a turn.
    pub turns: Cell<u64>,
    /// Number of jumps of the clock.
    pub jumps: Cell<u64>,
    /// Counts of the actions of a run.
    pub tally: RefCell<BTreeMap<&'static str, u64>>,
}

impl Court {
    /// The shared state for one seed, in the runtime whose time it logs.
    pub fn new(seed: u64, keeps_log: bool) -> Self {
        Self {
            rng: RefCell::new(fastrand::Rng::with_seed(seed)),
            began: Instant::now(),
            hash: RefCell::default(),
            log: keeps_log.then(RefCell::default),
            failure: RefCell::default(),
            turns: Cell::new(0),
            jumps: Cell::new(0),
            tally: RefCell::default(),
        }
    }

    /// Logs an event with its virtual time.
    pub fn note(&self, what: &str, detail: &[u8]) {
        let time = self.began.elapsed().as_nanos() as u64;
        let mut hash = self.hash.borrow_mut();
        hash.write_u64(time);
        hash.write(what.as_bytes());
        hash.write(detail);
        if let Some(log) = &self.log {
            let detail = String::from_utf8_lossy(&detail[..detail.len().min(300)]);
            log.borrow_mut()
                .push(format!("{:.6} {what} {detail}", time as f64 * 1e-9));
        }
    }

    /// The hash of the log, and the kept part of the log.
    pub fn record(&self) -> (u64, Vec<String>) {
        let log = self.log.as_ref().map(RefCell::take);
        (self.hash.borrow().finish(), log.unwrap_or_default())
    }

    /// Counts an action.
    pub fn count(&self, what: &'static str) {
        *self.tally.borrow_mut().entry(what).or_default() += 1;
    }

    /// The count so far.
    pub fn counted(&self, what: &'static str) -> u64 {
        self.tally.borrow().get(what).copied().unwrap_or_default()
    }

    fn drew<T: fmt::Display>(&self, value: T) -> T {
        self.note("drew", value.to_string().as_bytes());
        value
    }

    /// A number below `limit`, or 0 if that is 0.
    pub fn below(&self, limit: usize) -> usize {
        let value = self.rng.borrow_mut().usize(..limit.max(1));
        self.drew(value)
    }

    /// A number between 0 and 1.
    pub fn fraction(&self) -> f64 {
        let value = self.rng.borrow_mut().f64();
        self.drew(value)
    }

    /// True with that probability.
    pub fn chance(&self, probability: f64) -> bool {
        self.fraction() < probability
    }

    /// One of several.
    pub fn among<T: Clone>(&self, all: &[T]) -> T {
        all[self.below(all.len())].clone()
    }

    /// One of several, with probabilities proportional to the weights.
    pub fn weighed<T: Copy>(&self, all: &[(T, f64)]) -> Option<T> {
        let sum: f64 = all.iter().map(|(_, weight)| weight).sum();
        let mut left = self.fraction() * sum;
        for (one, weight) in all {
            left -= weight;
            if left < 0.0 {
                return Some(*one);
            }
        }
        all.last().map(|(one, _)| *one)
    }

    /// Only the first failure is kept.
    pub fn fail(&self, verdict: Verdict, words: String) {
        self.note("FAILED", words.as_bytes());
        let mut failure = self.failure.borrow_mut();
        if failure.is_none() {
            *failure = Some(Failure { verdict, words });
        }
    }

    pub fn wrong(&self, words: String) {
        self.fail(Verdict::Wrong, words);
    }

    pub fn failure(&self) -> Option<Failure> {
        self.failure.borrow().clone()
    }
}

//! The one seeded generator, the log of all that it drew and of all that was heard, and the first thing that went wrong.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::fmt;

use tokio::time::Instant;

/// Prefix of a count that is the largest of many, and no sum.
pub const MOST: &str = "most ";

/// Reasons that end a seed before its time. The number is the process's exit status.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Something that came, or did not come, is wrong.
    Wrong = 1,
    /// Something panicked that nobody had told to.
    Crash = 2,
    /// Something that has to end does not.
    NoProgress = 3,
}

/// How a seed failed: of which kind, and in words.
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

/// The state that all parts of a simulation share.
pub struct Court {
    rng: RefCell<fastrand::Rng>,
    began: Instant,
    /// Hash of everything logged so far.
    hash: Cell<u64>,
    /// The log itself, if it is kept.
    log: Option<RefCell<Vec<String>>>,
    failure: RefCell<Option<Failure>>,
    /// How often everybody has had a turn.
    pub turns: Cell<u64>,
    /// How often the clock has jumped.
    pub jumps: Cell<u64>,
    /// Counts of what was done, for those who want to know what a run was made of.
    pub tally: RefCell<BTreeMap<&'static str, u64>>,
}

impl Court {
    /// A court for one seed, in the runtime whose time it logs.
    pub fn new(seed: u64, keeps_log: bool) -> Self {
        Self {
            rng: RefCell::new(fastrand::Rng::with_seed(seed)),
            began: Instant::now(),
            hash: Cell::new(0xcbf2_9ce4_8422_2325),
            log: keeps_log.then(RefCell::default),
            failure: RefCell::default(),
            turns: Cell::new(0),
            jumps: Cell::new(0),
            tally: RefCell::default(),
        }
    }

    /// Notes an event with the virtual time at which it happened.
    pub fn note(&self, what: &str, detail: &[u8]) {
        let time = self.began.elapsed().as_nanos() as u64;
        let mut hash = self.hash.get();
        for byte in time
            .to_le_bytes()
            .iter()
            .chain(what.as_bytes())
            .chain(detail)
        {
            hash = (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3);
        }
        self.hash.set(hash);
        if let Some(log) = &self.log {
            let detail = String::from_utf8_lossy(&detail[..detail.len().min(300)]);
            log.borrow_mut()
                .push(format!("{:.6} {what} {detail}", time as f64 * 1e-9));
        }
    }

    /// The hash of the log, and the log as far as it was kept.
    pub fn record(&self) -> (u64, Vec<String>) {
        let log = self.log.as_ref().map(RefCell::take);
        (self.hash.get(), log.unwrap_or_default())
    }

    /// Counts something that was done.
    pub fn count(&self, what: &'static str) {
        *self.tally.borrow_mut().entry(what).or_default() += 1;
    }

    /// How often that was so far.
    pub fn counted(&self, what: &'static str) -> u64 {
        self.tally.borrow().get(what).copied().unwrap_or_default()
    }

    /// Notes the largest of something.
    pub fn at_most(&self, what: &'static str, value: u64) {
        let mut tally = self.tally.borrow_mut();
        let most = tally.entry(what).or_default();
        *most = value.max(*most);
    }

    fn drew<T: fmt::Display>(&self, value: T) -> T {
        self.note("drew", value.to_string().as_bytes());
        value
    }

    /// A number below `limit`; 0 where that is 0.
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

    /// One of several, the heavier the likelier.
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

    /// The first failure is the one that counts.
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

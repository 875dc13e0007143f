//! The whole runtime in one thread and in virtual time, driven by a seed: `make simulate`.
//!
//! | file | what |
//! | --- | --- |
//! | `plan` | the features, faults and hostile behaviours of a seed |
//! | `court` | the one generator, the log, the first failure |
//! | `world`, `pipe` | the runtime, its pool and its pipes |
//! | `workload`, `honest` | requests of clients, and their expected answers |
//! | `model` | the expected frames |
//! | `hostile` | clients that break the rules |
//! | `play` | the course of a seed, and its checks |
//!
//! Safety always holds: no received frame is wrong. Liveness holds after the faults: every required answer arrives.
//! `SEED=n` plays one seed and prints its log. `SEEDS=n` plays n seeds, and `MINUTES=n` plays seeds for that time.
//! `FROM` is the first seed, which `scripts/simulate.sh` takes from the commit.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::print_stdout,
    clippy::too_many_lines,
    clippy::unwrap_used,
    unreachable_pub,
    reason = "a simulation that panics has failed; it tells people what it does"
)]

#[path = "../../fuzz/src/cbor.rs"]
#[allow(dead_code, reason = "the fuzz targets use its other parts too")]
mod cbor;
#[path = "../../fuzz/src/client.rs"]
#[allow(dead_code, reason = "the fuzz targets use its other parts too")]
mod client;
mod court;
mod honest;
mod hostile;
#[path = "../../fuzz/src/json.rs"]
#[allow(dead_code, reason = "the fuzz targets use its other parts too")]
mod json;
mod model;
mod pipe;
mod plan;
mod play;
mod workload;
mod world;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use pendularm::actors::panics;

use crate::court::{Failure, Verdict};
use crate::play::{Outcome, play};

/// Seeds that failed once: they are always played first.
const KEPT: &str = include_str!("kept_seeds.txt");
/// Seeds of a plain `cargo test`, and how many of them are played twice and compared.
const DEFAULT_SEEDS: u64 = 60;
const TWICE: u64 = 6;
/// Interval at which a long run reports its progress.
const TOLD_EVERY: Duration = Duration::from_secs(60);
/// Longer than any seed takes, also on a busy machine: a seed that waits or works for ever is found.
const PATIENCE: Duration = Duration::from_secs(900);

/// The last panic that the test did not cause.
static PANIC: Mutex<Option<String>> = Mutex::new(None);
/// The seed that is being played, and when it began, in milliseconds since the start.
static SEED: AtomicU64 = AtomicU64::new(0);
static BEGAN: AtomicU64 = AtomicU64::new(0);

fn main() {
    let began = Instant::now();
    hear_panics();
    watch(began);
    let code = if let Some(seed) = number("SEED") {
        play_one(seed, began)
    } else {
        play_many(began)
    };
    std::process::exit(code);
}

/// A number from the environment. An empty variable counts as unset.
fn number<T: std::str::FromStr>(name: &str) -> Option<T> {
    let text = std::env::var(name).ok().filter(|text| !text.is_empty())?;
    let number = text.parse();
    Some(number.unwrap_or_else(|_| panic!("{name} must be a number, got {text}")))
}

/// Every panic is recorded, also one that is caught.
fn hear_panics() {
    panics::end_with(|_| ());
    let inner = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        let payload = info.payload();
        let text = payload.downcast_ref::<String>().map(String::as_str);
        let text = text.or(payload.downcast_ref::<&str>().copied());
        let words = text.unwrap_or_default();
        // A panic in a pipe poisons the lock that its halves share.
        let is_meant = words == pipe::MEANT || words.contains("PoisonError");
        if !is_meant {
            let place = info.location().map(ToString::to_string).unwrap_or_default();
            let mut first = PANIC.lock().unwrap();
            first.get_or_insert(format!("{place}: {words}"));
        }
        inner(info);
    }));
}

/// Ends the process where a seed does not end.
fn watch(began: Instant) {
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(Duration::from_secs(1));
            let since = Duration::from_millis(BEGAN.load(Ordering::Relaxed));
            let waits = began.elapsed().saturating_sub(since);
            if waits > PATIENCE {
                let words = format!("the seed has taken {waits:?}: some turn does not end");
                let verdict = Verdict::NoProgress;
                let failure = Failure { verdict, words };
                tell(SEED.load(Ordering::Relaxed), &failure);
                std::process::exit(failure.verdict as i32);
            }
        }
    });
}

/// The last line of a failure: the fault, and the command that repeats it.
fn tell(seed: u64, failure: &Failure) {
    println!(
        "{failure}\nmake simulate SEED={seed}: {:.160}",
        failure.to_string()
    );
}

fn kept() -> impl Iterator<Item = u64> {
    let words = KEPT.lines().map(|line| line.split_whitespace().next());
    words.filter_map(|word| word?.parse().ok())
}

/// Plays a seed; any panic is its failure.
fn attempt(seed: u64, keeps_log: bool, began: Instant) -> Outcome {
    SEED.store(seed, Ordering::Relaxed);
    BEGAN.store(began.elapsed().as_millis() as u64, Ordering::Relaxed);
    *PANIC.lock().unwrap() = None;
    let played = catch_unwind(AssertUnwindSafe(|| play(seed, keeps_log)));
    let panic = PANIC.lock().unwrap().take();
    let mut outcome = played.unwrap_or_default();
    if let Some(words) = panic {
        // Assertions of a second reader concern the received bytes, not the reader.
        let verdict = match words.starts_with("src/") {
            true => Verdict::Crash,
            false => Verdict::Wrong,
        };
        outcome.failure = Some(Failure { verdict, words });
    }
    outcome
}

/// Plays one seed twice and prints its log.
fn play_one(seed: u64, began: Instant) -> i32 {
    let first = attempt(seed, true, began);
    println!("seed {seed}: {}", first.plan);
    for line in &first.log {
        println!("{line}");
    }
    let second = attempt(seed, true, began);
    if let Some(failure) = first.failure.as_ref().or(differ(&first, &second).as_ref()) {
        tell(seed, failure);
        return failure.verdict as i32;
    }
    println!("seed {seed} holds: {:?}", first.tally);
    0
}

/// The difference of two runs of one seed, if there is one.
fn differ(first: &Outcome, second: &Outcome) -> Option<Failure> {
    if first.hash == second.hash {
        return None;
    }
    let mut pairs = first.log.iter().zip(&second.log).enumerate();
    let place = pairs.find(|(_, (one, other))| one != other);
    let words = place.map_or("in their lengths".to_owned(), |(at, (one, other))| {
        format!("at event {at}: {one:?} and {other:?}")
    });
    let words = format!("two runs of one seed differ {words}");
    let verdict = Verdict::Wrong;
    Some(Failure { verdict, words })
}

fn play_many(began: Instant) -> i32 {
    let minutes: Option<f64> = number("MINUTES");
    let from: u64 = number("FROM").unwrap_or(1);
    let count = minutes.map_or(DEFAULT_SEEDS, |_| u64::MAX);
    let count = number("SEEDS").unwrap_or(count);
    let end = minutes.map(|minutes| Duration::from_secs_f64(minutes * 60.0));
    let goes_on = std::env::var("GO_ON").is_ok_and(|text| !text.is_empty());
    let how_many = match minutes {
        Some(minutes) => format!("MINUTES={minutes}"),
        None => format!("SEEDS={count}"),
    };
    println!("make simulate FROM={from} {how_many}: those that have failed once come first");
    let mut told = Instant::now();
    let mut tally: BTreeMap<&'static str, u64> = BTreeMap::new();
    let (mut played, mut failed, mut code) = (0, 0, 0);
    for seed in kept().chain(from..from.saturating_add(count)) {
        if end.is_some_and(|end| began.elapsed() > end) {
            break;
        }
        let twice = played < TWICE;
        let outcome = attempt(seed, twice, began);
        played += 1;
        if told.elapsed() > TOLD_EVERY {
            told = Instant::now();
            println!("{played} seeds so far, {failed} failed");
        }
        for (what, count) in &outcome.tally {
            *tally.entry(what).or_default() += count;
        }
        let again = twice.then(|| attempt(seed, true, began));
        let differs = again.and_then(|again| differ(&outcome, &again));
        if let Some(failure) = outcome.failure.or(differs) {
            println!("seed {seed}: {}", outcome.plan);
            tell(seed, &failure);
            failed += 1;
            code = failure.verdict as i32;
            if !goes_on {
                break;
            }
        }
    }
    println!(
        "{played} seeds in {:.1} s, {failed} failed: {tally:?}",
        began.elapsed().as_secs_f64()
    );
    code
}

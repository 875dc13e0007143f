//! A soak test: random attacks, several at a time, for minutes, with healthy clients.
//!
//! `soak PATH/TO/pendularm`, with `MINUTES` (1), `SEED` and `ONLY` (parts of names of attacks, between commas; all) in
//! the environment. Attacks alternate with pauses. In each pause there are only the healthy clients, and the program
//! must have released descriptors and threads. Its memory is compared between pauses. Exit status 1 if a bar is missed.
//! Linux only.
//!
//! Bounded: at most [`AT_ONCE`] attackers at once, so that the default places suffice for healthy clients.

use std::process::ExitCode;
use std::time::{Duration, Instant};

use pendularm_benches::attack::script::Client;
use pendularm_benches::attack::stage::{Deeds, play};
use pendularm_benches::attack::{Attack, groups, picks};
use pendularm_benches::healthy::{Health, Healthy, Target};
use pendularm_benches::program::{Program, Vitals, peak, vitals};

/// Longest tide.
const TIDE: Duration = Duration::from_secs(40);
/// Attackers at once. The default places suffice for the healthy clients, for these, and for as many that are being closed.
const AT_ONCE: usize = 112;
/// Longest time until a call or a newcomer counts as not answered. It is far beyond any answer's own limit.
const PATIENCE: Duration = Duration::from_secs(30);
/// Longest time until the program has released its resources. Half-open clients get their answers for up to 15 s, and
/// computations continue.
const LET_GO: Duration = Duration::from_secs(60);
/// Length of a pause before memory is read.
const QUIET: Duration = Duration::from_secs(3);
/// Descriptors that the program opens for its first subscriber and keeps, to query the unread bytes of clients.
const OPENED_ONCE: usize = 1;
/// Bound of the memory at any time, as in `make attack` \[MB\].
const PEAK: f64 = 700.0;
/// Growth of the memory from the pause after the first third to the last \[MB\]. Before that the heap grows to the size
/// of the busiest moment.
const GROWTH: f64 = 8.0;
/// Makes glibc return freed memory. Without it glibc keeps up to twice the largest block that was ever freed, so that the
/// memory in a pause depends on the last attacks and hides a leak.
const RETURN_MEMORY: &str = "MALLOC_TRIM_THRESHOLD_=131072";

fn main() -> ExitCode {
    let Some(path) = std::env::args().nth(1) else {
        eprintln!("soak: which program? soak PATH/TO/pendularm");
        return ExitCode::from(2);
    };
    let minutes: Option<f64> = variable("MINUTES", 1.0);
    let seed = variable("SEED", fastrand::u64(..1_000_000));
    let (Some(minutes @ 0.0..=1440.0), Some(seed)) = (minutes, seed) else {
        eprintln!("soak: MINUTES is a number from 0 to 1440, SEED a whole number");
        return ExitCode::from(2);
    };
    println!("soak: {minutes} minutes, SEED={seed}");
    match soak(&path, Duration::from_secs_f64(60.0 * minutes), seed) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(why) => {
            eprintln!("soak: {why}");
            ExitCode::FAILURE
        }
    }
}

/// A variable of the environment; none if it is set and cannot be read.
fn variable<T: std::str::FromStr>(name: &str, default: T) -> Option<T> {
    match std::env::var(name) {
        Ok(text) if !text.is_empty() => text.parse().ok(),
        _ => Some(default),
    }
}

/// Plays the whole soak test. Returns whether every bar was met.
fn soak(path: &str, time: Duration, seed: u64) -> Result<bool, String> {
    let attacks = attacks()?;
    let gone = || "the program is gone".to_owned();
    let command = [
        RETURN_MEMORY,
        path,
        "--bind",
        "127.0.0.1:0",
        "--log",
        "warn",
    ];
    let program = Program::start("env", &command)?;
    let (pid, address) = (program.pid(), program.address);
    std::thread::sleep(Duration::from_millis(500));
    let before = vitals(pid).ok_or_else(gone)?;
    let before = Vitals {
        descriptors: before.descriptors + OPENED_ONCE,
        ..before
    };
    let healthy = Healthy::start(Target {
        address,
        locked: false,
        patience: PATIENCE,
        long: false,
    })?;
    let mut rng = fastrand::Rng::with_seed(seed);
    let (mut bars, mut ebbs) = (Bars::default(), Vec::new());
    let tides = (time.as_secs_f64() / TIDE.as_secs_f64()).ceil().max(3.0) as u32;
    let mut played = Deeds::default();
    for tide in 1..=tides {
        flood(&attacks, address, time / tides, &mut rng, &mut played);
        let held = Vitals {
            descriptors: before.descriptors + Healthy::CONNECTIONS,
            ..before
        };
        let now = settled(pid, held).ok_or_else(gone)?;
        std::thread::sleep(QUIET);
        let resident = vitals(pid).ok_or_else(gone)?.resident;
        println!(
            "ebb {tide} of {tides}: {resident:.0} MB resident, {} descriptors, {} threads",
            now.descriptors, now.threads
        );
        bars.check(
            "descriptors left at the ebb",
            now.descriptors as f64 - held.descriptors as f64,
            0.0,
        );
        bars.check(
            "threads left at the ebb",
            now.threads as f64 - held.threads as f64,
            0.0,
        );
        ebbs.push(resident);
    }
    println!(
        "\n{} connections of attackers, {:.0} MB from them",
        played.connections.into_inner(),
        played.sent.into_inner() as f64 / 1e6
    );
    bars.health(&healthy.finish());
    let after = settled(pid, before).ok_or_else(gone)?;
    bars.check(
        "descriptors left once all are gone",
        after.descriptors as f64 - before.descriptors as f64,
        0.0,
    );
    bars.check(
        "resident memory at most, MB",
        peak(pid).ok_or_else(gone)?,
        PEAK,
    );
    let growth = ebbs[ebbs.len() - 1] - ebbs[ebbs.len() / 3];
    bars.check(
        "growth from the ebb after the first third to the last, MB",
        growth,
        GROWTH,
    );
    let log = program.log();
    let panics = log.iter().filter(|line| line.contains("panic"));
    bars.check("panics in the log", panics.count() as f64, 0.0);
    let (took, status) = program.end()?;
    bars.check("exit status", status.map_or(f64::INFINITY, f64::from), 0.0);
    bars.check("seconds from SIGTERM to the end", took.as_secs_f64(), 1.5);
    for line in log.iter().take(if bars.missed == 0 { 3 } else { 20 }) {
        println!("    log: {line}");
    }
    println!(
        "\nsoak: {}",
        if bars.missed == 0 {
            "all held"
        } else {
            "NOT all held"
        }
    );
    Ok(bars.missed == 0)
}

/// Attacks on a program with default options that do not change the arm's clock and settings, and do not take all
/// places.
fn attacks() -> Result<Vec<Attack>, String> {
    let only = std::env::var("ONLY").unwrap_or_default();
    let fits = |attack: &&Attack| {
        let is_default = !attack.locked && attack.options.is_empty();
        is_default && !attack.moves && !attack.fills && picks(&only, attack.name)
    };
    let all: Vec<Attack> = groups()
        .iter()
        .flat_map(|(_, attacks)| attacks.iter())
        .filter(fits)
        .copied()
        .collect();
    if all.is_empty() {
        return Err(format!("ONLY={only} names no attack that a soak can play"));
    }
    Ok(all)
}

/// Attacks for this time, one to four at once.
fn flood(
    attacks: &[Attack],
    address: std::net::SocketAddr,
    time: Duration,
    rng: &mut fastrand::Rng,
    played: &mut Deeds,
) {
    let ends = Instant::now() + time;
    while Instant::now() < ends {
        let count = rng.usize(1..=4);
        let mut cast: Vec<Client> = Vec::new();
        for _ in 0..count {
            let attack = attacks[rng.usize(..attacks.len())];
            let clients = (attack.cast)();
            // In an attack the deaf clients are first in the list, and the flooding clients are last.
            cast.extend_from_slice(&clients[clients.len().saturating_sub(AT_ONCE / count)..]);
        }
        let over = (Instant::now() + Duration::from_millis(rng.u64(500..4000))).min(ends);
        play(&cast, address, played, || Instant::now() >= over);
    }
}

/// The state of the program when descriptors and threads are back to `held`, or after [`LET_GO`]. None if it has ended.
fn settled(pid: u32, held: Vitals) -> Option<Vitals> {
    let deadline = Instant::now() + LET_GO;
    loop {
        let now = vitals(pid)?;
        if (now.descriptors, now.threads) == (held.descriptors, held.threads)
            || Instant::now() >= deadline
        {
            return Some(now);
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Figures beside their bars.
#[derive(Default)]
struct Bars {
    missed: usize,
}

impl Bars {
    /// Prints a figure; a miss if it exceeds the bar, or is no number.
    fn check(&mut self, name: &str, figure: f64, bar: f64) {
        let holds = figure <= bar;
        self.missed += usize::from(!holds);
        println!(
            "  {name:<62} {figure:>10.2}   at most {bar:<8} {}",
            if holds { "held" } else { "MISSED" }
        );
    }

    fn health(&mut self, health: &Health) {
        let p99 = health.delays.get(health.delays.len() * 99 / 100);
        println!(
            "  {} calls, p99 {:.1} ms; longest gap of /joint_states {:.0} ms; {} newcomers, longest visit {:.0} ms",
            health.asked,
            p99.copied().unwrap_or(f64::NAN),
            health.longest_gap,
            health.visits,
            health.longest_visit,
        );
        self.check(
            "calls not answered",
            (health.asked - health.delays.len()) as f64,
            0.0,
        );
        self.check(
            "newcomers not served",
            (health.visits - health.served) as f64,
            0.0,
        );
        self.check(
            "faults of the healthy clients",
            health.faults.len() as f64,
            0.0,
        );
        for fault in health.faults.iter().chain(&health.visit_fault).take(5) {
            println!("    {}", fault.chars().take(200).collect::<String>());
        }
    }
}

//! Mixed clients coming and going for minutes, most of them badly behaved, and what the program makes of it.
//!
//! `soak PATH/TO/pendularm`, with `MINUTES` (1), `SEED` and `ONLY` (kinds of clients and names of attacks, between
//! commas; all) in the environment. Clients come in tides: a flood of them for up to 40 s, then all leave. The memory
//! of the program is measured while only the operator and the healthy clients are there. Exit status 1 if anything that
//! must hold did not.
//!
//! Bounded: at most [`AT_ONCE`] lives at once, of [`PER_SECOND`] new ones a second, so that a machine of two cores is busy
//! with the program rather than with this.

mod clients;
mod conversation;
mod judge;
mod ledger;
mod operator;
mod questions;
mod recent;
mod report;
mod statistics;
mod tides;
mod watch;
mod wire;
mod world;

use std::process::ExitCode;
use std::time::Duration;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let path = match arguments.next() {
        Some(word) if word == "tick" => {
            return if watch::tick().is_ok() {
                ExitCode::SUCCESS
            } else {
                ExitCode::FAILURE
            };
        }
        Some(path) => path,
        None => {
            eprintln!("soak: which program? soak PATH/TO/pendularm");
            return ExitCode::from(2);
        }
    };
    let minutes = variable("MINUTES", 1.0);
    let seed = variable("SEED", fastrand::u64(..1_000_000));
    let (Ok(minutes), Ok(seed)) = (minutes, seed) else {
        eprintln!("soak: MINUTES is a number of minutes, SEED a whole number");
        return ExitCode::from(2);
    };
    if !(0.0..=24.0 * 60.0).contains(&minutes) {
        eprintln!("soak: MINUTES is at most a day, got {minutes}");
        return ExitCode::from(2);
    }
    println!("soak: {minutes} minutes, SEED={seed}");
    match tides::soak(&path, Duration::from_secs_f64(60.0 * minutes), seed) {
        Ok(outcome) => {
            if report::print(&outcome) {
                ExitCode::SUCCESS
            } else {
                ExitCode::FAILURE
            }
        }
        Err(why) => {
            eprintln!("soak: {why}");
            ExitCode::FAILURE
        }
    }
}

/// A number from the environment.
fn variable<T: std::str::FromStr>(name: &str, default: T) -> Result<T, T::Err> {
    match std::env::var(name) {
        Ok(text) if !text.is_empty() => text.parse(),
        _ => Ok(default),
    }
}

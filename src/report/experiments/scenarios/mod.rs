//! Named scenes, stiff and extreme, each with an expectation, an observation, and whether they agree.
//!
//! Expectations come from theory or from the arm's own prediction, except the rates of S05 and S06, which are from
//! earlier runs: two chaotic swings have no other. Some arms are allowed by the contract, but a careful user would not
//! make them. A scene that falls short says so. `scenes.txt` has the expectations. `page/scenes.js` has the names, and
//! a live arm for each.
//!
//! **Invariant:** 43 scenes, in order, each deterministic and bounded; `slow` ones take seconds. Random values
//! come from a seed in the source.

mod extremes;
mod loops;
mod real;
mod support;

pub use support::{Observation, Scenario};

/// A line for each scene: its name, its parameters, the behaviour of a correct arm, and whether it is `slow`.
const SCENES: &str = include_str!("scenes.txt");

/// All scenes, in order.
pub fn all() -> Vec<Scenario> {
    let scene = |line: &'static str| {
        let mut columns = line.split(" | ");
        let mut next = || columns.next().unwrap_or_default();
        let id = next();
        let checks = loops::CHECKS.iter().chain(&extremes::CHECKS);
        let mut checks = checks.chain(&real::CHECKS);
        let (_, check) = checks.find(|(of, _)| *of == id)?;
        Some(Scenario {
            id,
            parameters: next(),
            expected: next(),
            slow: next() == "slow",
            check: *check,
        })
    };
    SCENES.lines().filter_map(scene).collect()
}

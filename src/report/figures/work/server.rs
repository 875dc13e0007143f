//! Rows about the server: stepping, encoding, timers, and code that a build can do without.
//!
//! **Invariant:** what was not counted for this report is called not measured.

use super::cells::{percent_saved, unmeasured};
use super::counts::Counts;
use crate::report::section::Cell;
use crate::report::svg::number;

/// All rows, in the order of the table.
pub(super) fn rows(counts: &Counts) -> [Vec<Cell>; 7] {
    [
        paused(counts),
        unheard(counts),
        encoding(counts),
        further(counts),
        timers(counts),
        estimate(counts),
        web(counts),
    ]
}

/// Messages encoded a second, and the instructions of one, if they were counted.
pub(super) fn encoded(counts: &Counts, server: &str) -> Option<(f64, f64)> {
    let messages = *counts.get(&format!("{server}-encoded"))?;
    let json = *counts.get(&format!("{server}-json"))?;
    let each = if messages > 0.0 {
        json / messages
    } else {
        json
    };
    Some((messages, each))
}

/// Instructions that the server executed per second, if they were counted.
fn per_second(counts: &Counts, name: &str) -> Option<f64> {
    counts.get(name).copied().filter(|count| *count > 0.0)
}

fn rate(count: Option<f64>, detail: &str) -> Cell {
    count.map_or_else(unmeasured, |count| {
        Cell::new(format!(
            "{} million instructions a second",
            number(count / 1e6)
        ))
        .detail(detail)
    })
}

fn paused(counts: &Counts) -> Vec<Cell> {
    let running = per_second(counts, "server-running");
    let paused = per_second(counts, "server-paused");
    vec![
        Cell::new("Stepping while paused"),
        Cell::new("actors::arm::sim asks the pacer for no steps"),
        rate(running, "running, nobody subscribed"),
        rate(paused, "paused"),
        percent_saved(running, paused),
    ]
}

fn json(seen: Option<(f64, f64)>, who: &str) -> Cell {
    seen.map_or_else(unmeasured, |(messages, each)| {
        let text = format!("{} messages encoded a second", number(messages));
        let each = if messages > 0.0 {
            format!("{who}; {} instructions of JSON each", number(each.round()))
        } else {
            format!("{who}; {} instructions of JSON", number(each))
        };
        Cell::new(text).detail(each)
    })
}

fn unheard(counts: &Counts) -> Vec<Cell> {
    let one = encoded(counts, "server-1-subscriber");
    let none = encoded(counts, "server-running");
    vec![
        Cell::new("JSON that nobody subscribes to"),
        Cell::new("the registry tells the arm which topics are wanted"),
        json(one, "one subscriber of /joint_states"),
        json(none, "none"),
        percent_saved(one.map(|seen| seen.0), none.map(|seen| seen.0)),
    ]
}

fn encoding(counts: &Counts) -> Vec<Cell> {
    let one = encoded(counts, "server-1-subscriber");
    let eleven = encoded(counts, "server-11-subscribers");
    let share = match (one, eleven) {
        (Some((_, one)), Some((_, eleven))) if one > 0.0 => Cell::new(format!(
            "per message {} times the JSON for 11 times the subscribers",
            number(eleven / one)
        )),
        _ => Cell::default(),
    };
    vec![
        Cell::new("Encoding once more for each further subscriber"),
        Cell::new("one frame of shared bytes goes to every outbox"),
        json(eleven, "eleven subscribers"),
        json(one, "one"),
        share,
    ]
}

fn further(counts: &Counts) -> Vec<Cell> {
    let each = counts.get("allocations-per-subscriber");
    vec![
        Cell::new("Allocations for each further subscriber of a message"),
        Cell::new("counting allocator, 10 against 110 subscribers"),
        each.map_or_else(unmeasured, |each| Cell::new(number(*each))),
        Cell::default(),
        Cell::default(),
    ]
}

fn timers(counts: &Counts) -> Vec<Cell> {
    let cell = |name, detail: &str| {
        counts.get(name).map_or_else(unmeasured, |count| {
            Cell::new(format!("{} wake-ups a second", number(*count))).detail(detail)
        })
    };
    vec![
        Cell::new("Goal and trial timers"),
        Cell::new(
            "a timer lives as long as its goal, or as somebody watches a trial; wake-ups of the gateway's thread",
        ),
        cell("wakes-trial", "a trial runs, its status is watched"),
        cell("wakes-idle", "nothing asked for"),
        percent_saved(
            counts.get("wakes-trial").copied(),
            counts.get("wakes-idle").copied(),
        ),
    ]
}

/// Ten estimates a second, as the arm makes them. Each is the library's own, counted apart from the server.
fn estimate(counts: &Counts) -> Vec<Cell> {
    let each = ["estimate-2-rk4", "estimate-3-rk4"].map(|name| per_second(counts, name));
    let cells = if let [Some(two), Some(three)] = each {
        let text = format!(
            "{} million instructions a second",
            number((1e-2 * two).round() / 1e3)
        );
        let detail = format!(
            "one subscriber of /arm_sim/error_estimate or a hundred: ten estimates of {} instructions (2 links, RK4; \
             {} with 3), beside what encoding takes",
            number(two.round()),
            number(three.round())
        );
        [
            Cell::new(text).detail(detail),
            Cell::new("0 instructions a second").detail("none"),
            Cell::new("100 %"),
        ]
    } else {
        [unmeasured(), Cell::default(), Cell::default()]
    };
    [
        Cell::new("Local error estimate"),
        Cell::new(
            "study::error_estimate is asked only for a subscriber of /arm_sim/error_estimate",
        ),
    ]
    .into_iter()
    .chain(cells)
    .collect()
}

fn web(counts: &Counts) -> Vec<Cell> {
    let cell = |size, symbols| {
        let (size, symbols) = (counts.get(size), counts.get(symbols));
        size.zip(symbols)
            .map_or_else(unmeasured, |(size, symbols)| {
                Cell::new(format!("{:.2} MB", size / 1e6)).detail(format!(
                    "{} symbols of HTTP and WebSocket",
                    number(*symbols)
                ))
            })
    };
    let (with, without) = ("program-size", "program-size-bare");
    vec![
        Cell::new("Web, record, report and commands without their features"),
        Cell::new("cargo build --no-default-features --features runtime"),
        cell(with, "web-symbols-whole"),
        cell(without, "web-symbols-bare"),
        percent_saved(counts.get(with).copied(), counts.get(without).copied()),
    ]
}

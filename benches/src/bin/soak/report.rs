//! The figures of a soak, and what must hold of them.
//!
//! **Invariant:** every bar has its reason beside it, and a figure is printed whether it holds or not.

use std::time::{Duration, Instant};

use crate::judge::{self, Gap, LATE, RATE};
use crate::statistics::line;
use crate::tides::Outcome;
use pendularm_benches::program::Vitals;

/// Largest rise per hour of the memory at the ebbs \[kB\], beyond two standard errors of the rise: 30 bytes for
/// each of the 140,000 clients of such an hour. A leak of one small thing per client is more.
const RISE: f64 = 4096.0;
/// Ebbs that are needed to say so: with fewer, a table that has doubled once looks like a rise.
const ENOUGH: usize = 12;
/// And by so much in all, from the ebb after the first third to the end \[kB\]. Until then the allocator's tables grow
/// to the size of the busiest moments. They have 2 MiB for each GiB of addresses that it has ever used, and 128 bytes
/// for each piece of them. A GiB more than until then, and 6 MiB of pieces, are no leak; later growth shows in the
/// rise.
const GROWTH: f64 = 8.0 * 1024.0;

/// Prints all of it; true if everything holds.
pub fn print(outcome: &Outcome) -> bool {
    println!("\ndone");
    for (what, times) in &outcome.counts {
        println!("  {times:>10}  {what}");
    }
    let diagnosis = &outcome.diagnosis;
    println!(
        "  {:>10}  topic messages dropped by full outboxes",
        diagnosis.dropped
    );
    println!("  {:>10}  lines of log", outcome.log.count);
    println!("\ncheck");
    let mut held = memory(outcome);
    held &= leaks(outcome);
    held &= joint_states(outcome);
    held &= verdict(
        "faults of clients",
        outcome.faults as f64,
        "0",
        outcome.faults == 0,
    );
    let strange = &diagnosis.strange_states;
    held &= verdict(
        "states of the arm other than running and paused",
        strange.len() as f64,
        "0",
        strange.is_empty(),
    );
    for state in strange.iter().take(3) {
        println!("    {state}");
    }
    held &= verdict(
        "panics in the log",
        outcome.log.panics as f64,
        "0",
        outcome.log.panics == 0,
    );
    held &= end(outcome);
    for line in outcome.log.lines.iter().take(if held { 3 } else { 20 }) {
        println!("    log: {line}");
    }
    println!("\nsoak: {}", if held { "all held" } else { "NOT all held" });
    held
}

fn verdict(what: &str, figure: f64, bar: &str, holds: bool) -> bool {
    let figure = if figure.fract() == 0.0 {
        format!("{figure:.0}")
    } else {
        format!("{figure:.3}")
    };
    println!(
        "  {what:<62} {figure:>12}   {bar:<24} {}",
        if holds { "held" } else { "FAILED" }
    );
    holds
}

fn note(what: &str, figure: &str) {
    println!("  {what:<62} {figure:>12}");
}

/// Memory over time.
fn memory(outcome: &Outcome) -> bool {
    let points = |all: &[(f64, Vitals)]| -> Vec<(f64, f64)> {
        all.iter()
            .map(|(at, now)| (at / 60.0, now.resident))
            .collect()
    };
    let first = outcome.ebbs.first().map_or(0.0, |(at, _)| *at);
    let warm: Vec<_> = outcome
        .course
        .iter()
        .filter(|(at, _)| *at > first)
        .copied()
        .collect();
    let resident = |now: &Vitals| format!("{:.0} kB", now.resident);
    let highest = outcome
        .course
        .iter()
        .map(|(_, now)| now.resident)
        .fold(0.0, f64::max);
    note(
        "resident before the first client",
        &resident(&outcome.before),
    );
    note("resident at most", &format!("{highest:.0} kB"));
    if let Some(all) = line(&points(&warm)) {
        let slope = format!("{:+.1} +- {:.1}", all.slope, all.error);
        note(
            "slope of every second's resident memory after the first ebb, kB/min",
            &slope,
        );
    }
    let after_first = outcome.ebbs.first().map_or(0.0, |(_, now)| now.resident);
    note("resident at the first ebb", &format!("{after_first:.0} kB"));
    note("resident once all are gone", &resident(&outcome.after));
    let third = outcome.ebbs.len() / 3;
    let settled = outcome.ebbs.get(third);
    let growth = outcome.after.resident - settled.map_or(0.0, |(_, now)| now.resident);
    let later = points(outcome.ebbs.get(third..).unwrap_or_default());
    let rise = line(&later).map(|line| {
        let slope = format!("{:+.1} +- {:.1}", line.slope, line.error);
        note("slope at the ebbs after the first third, kB/min", &slope);
        60.0 * (line.slope - 2.0 * line.error)
    });
    let what = "growth from the ebb after the first third to the end, kB";
    let mut held = verdict(what, growth, "at most 8192", growth <= GROWTH);
    match rise.filter(|_| later.len() >= ENOUGH) {
        Some(rise) => {
            held &= verdict(
                "rise that is sure, kB/h",
                rise,
                "at most 4096",
                rise <= RISE,
            )
        }
        None => note("rise that is sure, kB/h", "too short"),
    }
    held
}

/// Descriptors and threads.
fn leaks(outcome: &Outcome) -> bool {
    let (before, after) = (&outcome.before, &outcome.after);
    let descriptors = after.descriptors as f64 - before.descriptors as f64;
    let threads = after.threads as f64 - before.threads as f64;
    verdict(
        "descriptors left over",
        descriptors,
        "0",
        descriptors == 0.0,
    ) & verdict("threads left over", threads, "0", threads == 0.0)
}

/// The healthy clients' record.
fn joint_states(outcome: &Outcome) -> bool {
    let record = &outcome.record;
    let show = |name: &str, quantiles: [f64; 4]| {
        let [half, hundredth, thousandth, longest] = quantiles.map(|gap| 1e3 * gap);
        println!(
            "  {name:<40} p50 {half:>7.2}  p99 {hundredth:>7.2}  p99.9 {thousandth:>7.2}  max {longest:>8.2}"
        );
    };
    let gaps = judge::gaps(record);
    note(
        "messages of /joint_states to the healthy client",
        &record.states.len().to_string(),
    );
    show("gaps of /joint_states, ms", gaps.quantiles);
    show(
        "gaps of the bare process, ms",
        judge::quantiles(record.bare.iter().copied()),
    );
    let late = crate::statistics::sorted(record.woken.iter().map(|(_, late)| *late));
    show(
        "lateness of a sleeper, ms",
        [0.5, 0.99, 0.999, 1.0].map(|q| crate::statistics::quantile(&late, q)),
    );
    let calls = crate::statistics::sorted(record.calls.iter().map(|(_, took)| *took));
    show(
        "calls of the healthy caller, ms",
        [0.5, 0.99, 0.999, 1.0].map(|q| crate::statistics::quantile(&calls, q)),
    );
    for gap in &gaps.longest {
        show_gap(gap, &outcome.lives);
    }
    let excess = 1e3 * gaps.worst_excess;
    let bar = format!("at most {:.0}", 1e3 * LATE);
    let mut held = verdict(
        "later than its period and the machine, ms at most",
        excess,
        &bar,
        gaps.late == 0,
    );
    let wrong = judge::disorder(&record.states, &outcome.deeds);
    held &= verdict(
        "stamps out of order",
        wrong.len() as f64,
        "0",
        wrong.is_empty(),
    );
    held &= verdict(
        "faults of the healthy clients",
        record.faults.len() as f64,
        "0",
        record.faults.is_empty(),
    );
    for what in wrong.iter().chain(&record.faults).take(5) {
        println!("    {what}");
    }
    let rate = judge::rate(&record.states);
    note(
        "wall time over which the arm's rate was measured, s",
        &format!("{:.0} in {}", rate.measured, rate.runs),
    );
    note(
        "gaps of 200 ms and more, at which that is cut",
        &format!("{}, {:.2} s lost", rate.stalls, rate.lost),
    );
    let Some(ratio) = rate.ratio else {
        note("simulation time / wall time", "too short");
        return held;
    };
    note("the run farthest off", &format!("{:.5}", rate.worst));
    let off = (ratio - 1.0).abs();
    note("simulation time / wall time", &format!("{ratio:.6}"));
    held & verdict("that is off by, %", 100.0 * off, "at most 0.1", off <= RATE)
}

/// A gap, with what was going on.
fn show_gap(gap: &Gap, lives: &[(&'static str, Instant, Instant)]) {
    let [length, machine, ran] = [gap.length, gap.machine, gap.ran].map(|time| 1e3 * time);
    let began = gap.at - Duration::from_secs_f64(gap.length);
    let mut there: Vec<&str> = lives
        .iter()
        .filter(|(_, from, to)| *from <= gap.at && *to >= began)
        .map(|(name, _, _)| *name)
        .collect();
    there.sort_unstable();
    there.dedup();
    println!(
        "    gap of {length:.1} ms, machine late by {machine:.1} ms, program ran for {ran:.1} ms; there were {}",
        there.join(", ")
    );
}

/// How the program ended.
fn end(outcome: &Outcome) -> bool {
    let (program, own) = outcome.cpu;
    note(
        "processor time of the program and of the soak, s",
        &format!("{program:.0}, {own:.0}"),
    );
    match &outcome.ended {
        Ok((time, status)) => {
            let holds = *status == Some(0) && time.as_secs_f64() < 1.0;
            verdict(
                "seconds from SIGTERM to exit status 0",
                time.as_secs_f64(),
                "under 1",
                holds,
            )
        }
        Err(why) => {
            println!("  {why}");
            false
        }
    }
}

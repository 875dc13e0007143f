//! Work that a scene does not need, and the check that it is left out.
//!
//! Times and bits are measured here. Instructions, allocations and the server's own work are counted by
//! `scripts/measure-work.sh`, which writes them to `work.csv` next to the page. A missing count is shown as not
//! measured.
//!
//! **Invariant:** every number was measured for this report.

use std::collections::HashMap;
use std::hint::black_box;

use crate::math::arm::State;
use crate::math::count::in_f64;
use crate::math::dynamics::forward_dynamics;
use crate::math::expression::Expression;
use crate::math::integrator::{Method, increment};
use crate::math::particle::Particle;
use crate::math::pid::Gains;
use crate::math::simulation::{Simulation, step_under};
use crate::report::experiments::step_scene::{ready, undamped};
use crate::report::section::{Cell, Section, Table};
use crate::report::svg::{Plot, number, seconds};
use crate::report::timing::{Effort, time};
use crate::study::control_loop::no_control;

/// Steps of a run.
const STEPS: u64 = 20_000;

/// Counts by their names in `scripts/measure-work.sh`, and seconds per step by the same names.
struct Measured {
    counts: HashMap<String, f64>,
    times: Vec<(&'static str, f64)>,
}

pub(super) fn make(section: &mut Section) {
    let text = std::fs::read_to_string(section.out.join("work.csv")).unwrap_or_default();
    let counts = text.lines().skip(1).filter_map(|line| {
        let (name, rest) = line.split_once(',')?;
        Some((name.to_owned(), rest.split(',').next()?.parse().ok()?))
    });
    let effort = section.choose(Effort::new(15, 60, 0.5), Effort::new(5, 10, 0.02));
    let measured = Measured {
        counts: counts.collect(),
        times: times(effort),
    };
    measured.figure(section);
    section.table(&measured.table());
    measured.findings(section);
    measured.verdicts(section);
}

fn times(effort: Effort) -> Vec<(&'static str, f64)> {
    let mut times = Vec::new();
    let mut add = |name, work: &dyn Fn() -> f64| {
        times.push((name, time(effort, work).minimum / in_f64(STEPS)));
    };
    let free = |method| ready::<2>(9.81, true, false, method);
    add("step-2-euler-free", &|| run(&free(Method::Euler)));
    add("step-2-midpoint-free", &|| run(&free(Method::Midpoint)));
    add("step-2-verlet-free", &|| run(&free(Method::Verlet)));
    add("step-2-rk4-free", &|| run(&free(Method::Rk4)));
    let two = |gravity, integral, control| ready::<2>(gravity, integral, control, Method::Rk4);
    add("step-2-rk4-weightless", &|| run(&two(0.0, true, false)));
    add("step-2-rk4-pd", &|| run(&two(9.81, false, true)));
    let mut without_damping = two(9.81, true, true);
    without_damping.set_gains(undamped());
    add("step-2-rk4-pi", &|| run(&without_damping));
    let mut pushed = two(9.81, true, true);
    pushed.disturb([0.0; 2], 1e9);
    add("step-2-rk4-pushed", &|| run(&pushed));
    add("step-2-rk4-pid", &|| run(&two(9.81, true, true)));
    let three = |gravity, control| ready::<3>(gravity, true, control, Method::Rk4);
    add("step-3-rk4-free", &|| run(&three(9.81, false)));
    add("step-3-rk4-weightless", &|| run(&three(0.0, false)));
    add("step-3-rk4-pid", &|| run(&three(9.81, true)));
    add("particle-rk4-constant", &|| particle("1"));
    add("particle-rk4-cosine", &|| particle("cos(2*t)"));
    times
}

fn run<const N: usize>(ready: &Simulation<N>) -> f64 {
    let mut simulation = ready.clone();
    simulation.advance(STEPS);
    black_box(simulation.state().position.iter().sum())
}

fn particle(function: &str) -> f64 {
    let function = Expression::parse(function).ok();
    let particle = function
        .and_then(|function| Particle::new(function, 0.5, -0.25, 1e-4, STEPS, Method::Rk4).ok());
    particle.map_or(f64::NAN, |mut particle| {
        particle.advance(usize::MAX);
        particle.positions().last().copied().unwrap_or(f64::NAN)
    })
}

/// The work that is left out, one line per item. The columns: the work, the place in the source, the counts with and
/// without it, and whether the difference is a saving. A count may have a detail after a colon.
const LEFT_OUT: &str = include_str!("left_out.txt");

fn columns(line: &'static str) -> Vec<&'static str> {
    line.split('|').map(str::trim).collect()
}

/// The factor and the unit in which a count is shown.
fn unit(name: &str) -> (f64, &'static str) {
    const RATE: &str = "million instructions a second";
    match name {
        // Ten estimates per second.
        "estimate-2-rk4" => (1e-5, RATE),
        "program-size" | "program-size-bare" => (1e-6, "MB"),
        _ if name.ends_with("-encoded") => (1.0, "messages encoded a second"),
        _ if name.starts_with("server-") => (1e-6, RATE),
        _ if name.starts_with("wakes-") => (1.0, "wake-ups a second"),
        _ if name.starts_with("allocations-") => (1.0, "allocations"),
        _ => (1.0, "instructions"),
    }
}

/// Claims about counts, one per line: the claim, the count's name and unit, and a bound. For a whole number, a bound of
/// one half means none.
const BELOW: &str = include_str!("below.txt");

impl Measured {
    fn count(&self, name: &str) -> Option<f64> {
        self.counts.get(name).copied()
    }

    /// The cell of a count and its detail.
    fn cell(&self, told: &str) -> Cell {
        let (name, detail) = told.split_once(": ").unwrap_or((told, ""));
        if name.is_empty() {
            return Cell::default();
        }
        let Some(count) = self.count(name) else {
            return Cell::new("not measured in this run").class("soft");
        };
        let time = self.times.iter().find(|(one, _)| *one == name);
        let time = time.map(|(_, time)| seconds(*time));
        let (factor, unit) = unit(name);
        let whole = unit == "instructions";
        let count = if whole { count.round() } else { count };
        Cell::new(format!("{} {unit}", number(factor * count)))
            .detail(time.as_deref().unwrap_or(detail))
    }

    fn table(&self) -> Table {
        let mut lines = LEFT_OUT.lines().map(columns);
        let mut table = Table::new(
            "left-out",
            "Work that is left out, and its measured cost",
            "Instructions are counted by callgrind over the same number of steps on both sides, without the start of \
             the program. Times are the minimum of repeats on this machine. They depend only loosely on the \
             instructions, since a step is one chain of dependent operations.",
            lines.next().into_iter().flatten(),
        );
        let count = |told: &str| self.count(told.split(": ").next()?);
        for line in lines {
            let [work, place, with, without, saved] = line[..] else {
                continue;
            };
            let both = count(with).zip(count(without)).filter(|_| saved == "yes");
            let saved = both.map(|(with, without)| (100.0 * (1.0 - without / with)).round());
            let saved = saved.map(|percent| Cell::new(format!("{} %", number(percent))));
            table.rows.push(vec![
                Cell::new(work),
                Cell::new(place),
                self.cell(with),
                self.cell(without),
                saved.unwrap_or_default(),
            ]);
        }
        table
    }

    /// Bars of the instructions of a step and of the server, and of the time of a step.
    fn figure(&self, section: &mut Section) {
        let names = || self.times.iter().map(|(name, _)| *name);
        let counts = names().map(|name| (name, self.count(name).map(f64::round)));
        let times = self
            .times
            .iter()
            .map(|(name, time)| (*name, Some(1e9 * time)));
        let server = [
            ("paused", "server-paused"),
            ("running, nobody listens", "server-running"),
            ("1 subscriber", "server-1-subscriber"),
            ("11 subscribers", "server-11-subscribers"),
        ];
        let server = server.map(|(label, name)| (label, self.count(name).map(|n| n / 1e6)));
        let allocations = self.count("allocations-in-steps").map_or_else(
            || "Allocations were not counted.".to_owned(),
            |count| format!("Allocations in these steps: {}.", number(count)),
        );
        section.figure(
            "left-out",
            "Work of a step and of the server, scene by scene",
            &format!("Instructions by callgrind, time as the minimum of repeats. {allocations}"),
            &[
                Plot::bars("Instructions per step", "c1", counts),
                Plot::bars("Time per step [ns]", "c2", times),
                Plot::bars("The server: million instructions per second", "c3", server),
            ],
        );
    }

    /// Messages encoded per second, and the instructions per message.
    fn encoded(&self, server: &str) -> Option<(f64, f64)> {
        let messages = self.count(&format!("{server}-encoded"))?;
        let json = self.count(&format!("{server}-json"))?;
        Some((messages, (json / messages.max(1.0)).round()))
    }

    fn findings(&self, section: &mut Section) {
        if let (Some(none), Some(one), Some(eleven)) = (
            self.encoded("server-running"),
            self.encoded("server-1-subscriber"),
            self.encoded("server-11-subscribers"),
        ) {
            section.find(format!(
                "**While nobody listens the server encodes {} messages a second**. For one subscriber it encodes {} at \
                 {} instructions each, for eleven {} at {}.",
                number(none.0),
                number(one.0),
                number(one.1),
                number(eleven.0),
                number(eleven.1)
            ));
        }
        let [off, on] = ["step-2-rk4-free", "step-2-rk4-pid"].map(|name| self.count(name));
        if let (Some(off), Some(on)) = (off, on) {
            section.find(format!(
                "**The arm is the cost of a step**: without the control law a 2-link RK4 step is {} instructions \
                 instead of {}.",
                number(off.round()),
                number(on.round())
            ));
        }
    }

    fn verdicts(&self, section: &mut Section) {
        for (work, holds) in [
            (
                "the control law",
                off_is_zero_gains::<2>() && off_is_zero_gains::<3>(),
            ),
            (
                "the first angle at gravity 0",
                weightless_is_gravity_zero::<2>() && weightless_is_gravity_zero::<3>(),
            ),
        ] {
            let seen = "5000 steps of every method, 2 and 3 links";
            section.claim(format!("Leaving out {work} changes no bit"), seen, holds);
        }
        for line in BELOW.lines() {
            if let [claim, name, unit, bound] = columns(line)[..]
                && let (Some(count), Ok(bound)) = (self.count(name), bound.parse::<f64>())
            {
                section.claim(claim, format!("{} {unit}", number(count)), count < bound);
            }
        }
        let each = ["server-1-subscriber", "server-11-subscribers"].map(|name| self.encoded(name));
        if let [Some((_, one)), Some((_, eleven))] = each {
            section.claim(
                "A message is encoded once, for eleven subscribers as for one (within 1 %)",
                format!(
                    "{} and {} instructions of JSON a message",
                    number(eleven),
                    number(one)
                ),
                (eleven / one - 1.0).abs() <= 0.01,
            );
        }
        let rates = ["server-running", "server-paused"].map(|name| self.count(name));
        if let [Some(running), Some(paused)] = rates {
            section.claim(
                "A paused server executes less than half the instructions of a running one",
                format!(
                    "{} against {} million a second",
                    number(paused / 1e6),
                    number(running / 1e6)
                ),
                paused < 0.5 * running,
            );
        }
    }
}

/// Whether an arm without control takes the same steps, bit for bit, as one under control with gains of zero.
fn off_is_zero_gains<const N: usize>() -> bool
where
    Gains<N>: Default,
{
    Method::ALL.into_iter().all(|method| {
        let mut off = ready::<N>(9.81, true, false, method);
        let mut zero = ready::<N>(9.81, true, true, method);
        zero.set_gains(no_control());
        off.advance(5000);
        zero.advance(5000);
        let bits = |simulation: &Simulation<N>| simulation.state().position.map(f64::to_bits);
        bits(&off) == bits(&zero)
    })
}

/// Whether a live arm at gravity 0, which skips its first angle, gives the same bits as steps that evaluate it.
fn weightless_is_gravity_zero<const N: usize>() -> bool
where
    Gains<N>: Default,
{
    Method::ALL.into_iter().all(|method| {
        let mut live = ready::<N>(0.0, true, false, method);
        let mut state = State::at_rest([0.4; N]);
        state.velocity = [1.5; N];
        live.set_state(state);
        let (arm, h) = (*live.arm(), live.timestep());
        (0..5000).all(|_| {
            // Both from the same state, since the live arm carries its rounding error and these steps do not.
            let State { position, velocity } = &state;
            let acceleration =
                |_, q: &[f64; N], v: &[f64; N]| forward_dynamics(&arm, q, v, &[0.0; N]);
            let looked_at = increment(method, acceleration, 0.0, position, velocity, h);
            let left_out = step_under(&arm, method, &state, &[0.0; N], h);
            live.advance(1);
            state = *live.state();
            looked_at == left_out
        })
    })
}

#[cfg(test)]
mod tests {
    use super::{BELOW, LEFT_OUT, columns};

    #[test]
    fn every_line_has_the_columns_of_its_table() {
        for line in LEFT_OUT.lines() {
            assert_eq!(columns(line).len(), 5, "{line}");
        }
        for line in BELOW.lines() {
            let columns = columns(line);
            assert_eq!(columns.len(), 4, "{line}");
            assert!(columns[3].parse::<f64>().is_ok(), "{line}");
        }
    }
}

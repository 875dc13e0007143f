//! Separation from the reference in a chaotic swing, the horizon of each method and timestep, and the Lyapunov time.
//!
//! **Invariant:** an error is shown only where the reference is known better.

use crate::math::arm::{Arm, State};
use crate::math::count::{in_f64, length_in_f64};
use crate::math::integrator::Method;
use crate::report::csv::Csv;
use crate::report::experiments::chaos::{HORIZON_ERROR, horizon, lyapunov_rates, separation};
use crate::report::experiments::reference::{Law, ReferenceMotion};
use crate::report::making::Making;
use crate::report::section::{Block, Cell, Figure, Section, Table, Verdict};
use crate::report::svg::{Axis, Curve, Key, Mark, Plot, Unit, number, seconds};

/// Time between samples \[s\], a multiple of every timestep.
const SPACING: f64 = 1.0 / 16.0;

/// Steps per sample: timesteps of 1/64, 1/256, … s.
const EVERY: [u64; 5] = [4, 16, 64, 256, 1024];

/// Steps per sample of Runge-Kutta 4 alone, of 15 and 4 µs: its truncation is far below rounding there.
const FINE: [u64; 2] = [4096, 16384];

/// Steps per sample of the runs that are shown over time.
const SHOWN: u64 = 64;

/// Swings of the ensemble that the Lyapunov time is taken from, and the length of each \[s\].
const SWINGS: u32 = 48;
const SWING_TIME: f64 = 100.0;

struct Swing {
    links: usize,
    /// Samples for which the reference is known to 1 % of the horizon's error.
    known: usize,
    /// Lyapunov rates of an ensemble \[1/s\].
    rates: Vec<f64>,
    /// Method, steps per sample, errors.
    runs: Vec<(Method, u64, Vec<f64>)>,
}

pub(super) fn make(making: &mut Making<'_>) -> Section {
    let samples = making.choose(640, 192);
    let swings = [
        swing::<2>(making, samples, 0),
        swing::<3>(making, samples, 1),
    ];
    let mut csv = Csv::new("links,method,dt,t,err_rad");
    for swing in &swings {
        for (method, every, errors) in &swing.runs {
            for (index, error) in errors.iter().enumerate() {
                csv.row(&[
                    (swing.links as u64).into(),
                    method.name().into(),
                    timestep(*every).into(),
                    time(index).into(),
                    (*error).into(),
                ]);
            }
        }
    }
    making.keep("separation", csv);
    let mut section = Section {
        findings: swings.iter().filter_map(finding).collect(),
        verdicts: swings.iter().map(verdict).collect(),
        ..Section::default()
    };
    section.blocks.push(Block::Figure(figure(&swings)));
    section.blocks.push(Block::Table(table(&swings)));
    section
}

fn swing<const N: usize>(making: &mut Making<'_>, samples: usize, before: usize) -> Swing {
    let (arm, start) = (Arm::<N>::default(), State::rest());
    let reference = ReferenceMotion::of(&arm, &start, &Law::FREE, SPACING, samples);
    let known = reference
        .uncertainty()
        .iter()
        .position(|own| *own > 0.01 * HORIZON_ERROR)
        .unwrap_or(samples);
    let parts = EVERY.len() + 1;
    let mut runs = Vec::new();
    for (index, every) in EVERY.into_iter().enumerate() {
        for method in Method::ALL {
            let h = timestep(every);
            let mut errors = separation(&arm, &start, method, h, every, &reference);
            errors.truncate(known);
            runs.push((method, every, errors));
        }
        making.at(before * parts + index + 1, 2 * parts);
    }
    // They take seconds each, which a quick look does not have.
    for every in FINE.into_iter().filter(|_| !making.quick) {
        let h = timestep(every);
        let mut errors = separation(&arm, &start, Method::Rk4, h, every, &reference);
        errors.truncate(known);
        runs.push((Method::Rk4, every, errors));
    }
    let rates = lyapunov_rates(&arm, &start, making.choose(SWINGS, 4), SWING_TIME);
    making.at((before + 1) * parts, 2 * parts);
    Swing {
        links: N,
        known,
        rates,
        runs,
    }
}

fn time(index: usize) -> f64 {
    length_in_f64(index + 1) * SPACING
}

fn timestep(every: u64) -> f64 {
    SPACING / in_f64(every)
}

impl Swing {
    fn horizon(&self, method: Method, every: u64) -> Option<f64> {
        let run = self
            .runs
            .iter()
            .find(|run| run.0 == method && run.1 == every)?;
        horizon(&run.2, SPACING)
    }

    fn has(&self, method: Method, every: u64) -> bool {
        self.runs
            .iter()
            .any(|run| run.0 == method && run.1 == every)
    }

    fn known_until(&self) -> f64 {
        time(self.known.saturating_sub(1))
    }

    /// How long an error takes to grow by e, over the whole ensemble \[s\].
    fn lyapunov_time(&self) -> f64 {
        length_in_f64(self.rates.len()) / self.rates.iter().sum::<f64>()
    }

    /// The same, with the shortest and the longest of a member, one digit each.
    fn lyapunov_words(&self) -> String {
        let of = |rate: f64| format!("{:.1}", 1.0 / rate);
        let least = self.rates.iter().copied().fold(f64::INFINITY, f64::min);
        let most = self.rates.iter().copied().fold(0.0, f64::max);
        format!(
            "{:.1} s ({} to {} s in {} swings of {} s)",
            self.lyapunov_time(),
            of(most),
            of(least),
            self.rates.len(),
            number(SWING_TIME)
        )
    }
}

fn figure(swings: &[Swing]) -> Figure {
    let plots: Vec<Plot> = swings
        .iter()
        .map(|swing| {
            let x = Axis::linear("simulated time [s]", 0.0, swing.known_until().ceil());
            let y = Axis::log_between("distance to the reference [rad]", Unit::Number, 1e-17, 1e3);
            let mut plot = Plot::new(
                format!(
                    "{} links, steps of {}",
                    swing.links,
                    seconds(timestep(SHOWN))
                ),
                x,
                y,
            );
            plot.marks.push(Mark::Horizontal {
                y: HORIZON_ERROR,
                class: "soft",
                label: "horizon".to_owned(),
                right: true,
            });
            for (method, _, errors) in swing.runs.iter().filter(|run| run.1 == SHOWN) {
                let points = errors
                    .iter()
                    .enumerate()
                    .filter(|(_, error)| **error > 0.0 && error.is_finite())
                    .map(|(index, error)| (time(index), *error));
                plot.series.push(Curve::line(method.name(), points));
                if let Some(at) = swing.horizon(*method, SHOWN) {
                    plot.marks.push(Mark::Vertical {
                        x: at,
                        class: method.name(),
                        tooltip: format!("{method}: horizon {} s", number(at)),
                    });
                }
            }
            // e-fold per Lyapunov time, as far as the paper goes.
            let from = 0.25 * swing.known_until();
            let to = (from + 9.0 * std::f64::consts::LN_10 * swing.lyapunov_time())
                .min(swing.known_until());
            let growth =
                [from, to].map(|t| (t, 1e-15 * ((t - from) / swing.lyapunov_time()).exp()));
            plot.series.push(Curve {
                dashed: true,
                ..Curve::line("soft", growth)
            });
            plot
        })
        .collect();
    let mut keys: Vec<Key> = Method::ALL
        .iter()
        .map(|method| Key::line(method.name(), method.name()))
        .collect();
    keys.push(Key {
        dashed: true,
        ..Key::line("soft", "growth at the Lyapunov rate")
    });
    Figure::new(
        "separation",
        headline(swings),
        "Free swing from the horizontal. An error of 0.01 rad is the horizon (dotted upright lines); past it a swing \
         and the true one have only their energy in common. The panel ends where the reference itself is no longer \
         known, or where it was not taken further.",
        &keys,
        &plots,
    )
}

fn headline(swings: &[Swing]) -> String {
    let words: Vec<String> = swings
        .iter()
        .map(|swing| {
            let last = (EVERY.into_iter().chain(FINE))
                .filter_map(|every| swing.horizon(Method::Rk4, every))
                .fold(0.0, f64::max);
            format!("{} links: {} s", swing.links, number(last))
        })
        .collect();
    format!(
        "Doubles end every comparison: the latest horizon of RK4 at any timestep here is, with {}",
        words.join(", with ")
    )
}

fn table(swings: &[Swing]) -> Table {
    let mut head = vec!["Swing".to_owned(), "Method".to_owned()];
    let every = || EVERY.into_iter().chain(FINE);
    head.extend(every().map(|every| format!("dt {}", seconds(timestep(every)))));
    head.push("Lyapunov time".to_owned());
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let mut table = Table::new(
        "horizon",
        "Horizon: when the error passes 0.01 rad [s]",
        "The Lyapunov time is how long an error takes to grow by e, from an ensemble of swings that begin within 0.01 \
         rad; in brackets the shortest and the longest of one of them.",
        &head,
    );
    for swing in swings {
        for method in Method::ALL {
            let mut row = vec![
                Cell::new(format!("{} links", swing.links)),
                Cell::method(method),
            ];
            for every in every() {
                if !swing.has(method, every) {
                    row.push(Cell::new("not run").class("soft"));
                    continue;
                }
                row.push(match swing.horizon(method, every) {
                    Some(at) => Cell::new(number(at)),
                    None => Cell::new(format!("after {}", number(swing.known_until())))
                        .detail("where the reference ends"),
                });
            }
            row.push(if method == Method::Euler {
                Cell::new(swing.lyapunov_words())
            } else {
                Cell::default()
            });
            table.rows.push(row);
        }
    }
    table
}

fn finding(swing: &Swing) -> Option<String> {
    let coarse = swing.horizon(Method::Rk4, 64)?;
    let fine = swing.horizon(Method::Rk4, 1024)?;
    let floor = FINE
        .into_iter()
        .filter_map(|every| Some((every, swing.horizon(Method::Rk4, every)?)));
    let end = floor.max_by(|one, other| one.1.total_cmp(&other.1)).map(|(every, at)| {
        // Truncation alone would buy the fourth power of the ratio of timesteps.
        let ratio = timestep(1024) / timestep(every);
        let bought = ratio.powi(4).ln() * swing.lyapunov_time();
        format!(
            " With steps of {} it is {} s, {} s later, where truncation alone would have bought some {:.0} s: \
             rounding ends it.",
            seconds(timestep(every)),
            number(at),
            number(at - fine),
            bought
        )
    });
    Some(format!(
        "**A free {}-link swing can be followed for {} s with RK4 at {}, and for {} s at {}**: errors grow by e every \
         {}, so sixteen times the work buys {} s.{}",
        swing.links,
        number(coarse),
        seconds(timestep(64)),
        number(fine),
        seconds(timestep(1024)),
        swing.lyapunov_words(),
        number(fine - coarse),
        end.unwrap_or_default()
    ))
}

fn verdict(swing: &Swing) -> Verdict {
    let horizons: Vec<f64> = Method::ALL
        .into_iter()
        .map(|method| swing.horizon(method, SHOWN).unwrap_or(f64::INFINITY))
        .collect();
    let shown = |at: &f64| {
        if at.is_finite() {
            format!("{} s", number(*at))
        } else {
            format!("after {} s", number(swing.known_until()))
        }
    };
    let text: Vec<String> = horizons.iter().map(shown).collect();
    let of_orders = || Method::ALL.map(Method::order).into_iter().zip(&horizons);
    let holds = of_orders()
        .all(|(order, at)| of_orders().all(|(higher, later)| order >= higher || at < later));
    Verdict {
        claim: format!(
            "{} links: a method of higher order has a later horizon at {}",
            swing.links,
            seconds(timestep(SHOWN))
        ),
        seen: text.join(", "),
        holds,
    }
}

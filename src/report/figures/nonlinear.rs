//! Stability beyond small deviations: by amplitude of a move and by speed of a swing.
//!
//! **Invariant:** every cell is measured; predictions are drawn over them and nothing is filled in.

use super::cells::{centres, edges};
use super::floquet::Floquet;
use crate::math::arm::{Arm, State};
use crate::math::integrator::Method;
use crate::report::csv::Csv;
use crate::report::experiments::nonlinear::{are_carried, arrive, move_of, spun};
use crate::report::making::Making;
use crate::report::section::{Block, Figure, Section, Verdict};
use crate::report::svg::{Axis, Curve, Heat, Key, Plot, Unit};
use crate::study::control_loop::ControlLoop;
use crate::study::motion::Motion;
use crate::study::stability::{limit_held, limits};

/// Ends of the axes: timestep \[s\], amplitude \[rad\] and spin \[rad/s\].
const MOVE_STEPS: (f64, f64) = (5e-4, 2e-2);
const AMPLITUDES: (f64, f64) = (0.1, 100.0);
const SWING_STEPS: (f64, f64) = (1e-3, 0.5);
const SPINS: (f64, f64) = (0.3, 300.0);

/// A map of one method: cells that fail, and the predicted line.
struct MotionMap {
    method: Method,
    /// Predicted limit \[s\] and measured verdict, row by row.
    rows: Vec<(f64, Vec<bool>)>,
}

impl MotionMap {
    /// Cells below the prediction, and those of them that fail.
    fn below(&self, columns: &[f64], part: f64) -> (usize, usize) {
        let mut counts = (0, 0);
        for (limit, row) in &self.rows {
            for (h, holds) in columns.iter().zip(row) {
                if *h <= part * limit {
                    counts.0 += 1;
                    counts.1 += usize::from(!holds);
                }
            }
        }
        counts
    }
}

pub(super) fn make(making: &mut Making<'_>) -> Section {
    let columns = making.choose(32, 12);
    let (moves, swings) = (moves(columns), spins(columns));
    let mut csv = Csv::new("kind,method,dt,amplitude_or_spin,holds,predicted_limit");
    for (kind, maps, steps, values) in [
        ("move", &moves, MOVE_STEPS, AMPLITUDES),
        ("spin", &swings, SWING_STEPS, SPINS),
    ] {
        for map in maps {
            for (value, (limit, row)) in centres_between(values, columns).iter().zip(&map.rows) {
                for (h, holds) in centres_between(steps, columns).iter().zip(row) {
                    csv.row(&[
                        kind.into(),
                        map.method.name().into(),
                        (*h).into(),
                        (*value).into(),
                        u64::from(*holds).into(),
                        (*limit).into(),
                    ]);
                }
            }
        }
    }
    making.keep("nonlinear-map", csv);
    let floquet = Floquet::of_swings();
    let advised = within(&moves, MOVE_STEPS, columns, 0.8);
    let carried = within(&swings, SWING_STEPS, columns, 0.8);
    Section {
        findings: vec![floquet.finding()],
        verdicts: vec![
            verdict("moves of every amplitude arrive", advised),
            verdict(
                "swings of every speed keep their energy to a factor of two for 4 s",
                carried,
            ),
            floquet.verdict(),
        ],
        blocks: vec![Block::Figure(map_figure(&moves, &swings, columns))],
        ..Section::default()
    }
}

fn verdict(what: &str, (cells, lost): (usize, usize)) -> Verdict {
    Verdict {
        claim: format!("Within 0.8 of the predicted limit {what} (in 98 of 100 cells)"),
        seen: format!("{} of {cells} cells", cells - lost),
        holds: cells > 0 && 50 * lost <= cells,
    }
}

fn within(maps: &[MotionMap], steps: (f64, f64), columns: usize, part: f64) -> (usize, usize) {
    let steps = centres_between(steps, columns);
    maps.iter()
        .map(|map| map.below(&steps, part))
        .fold((0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1))
}

fn centres_between(ends: (f64, f64), count: usize) -> Vec<f64> {
    centres(&edges(ends, count))
}

/// Moves under the default gains: limited by the pose with the smallest limit, and by their own speed.
fn moves(columns: usize) -> Vec<MotionMap> {
    let mut maps = Vec::new();
    for method in Method::ALL {
        let poses = limits(&move_of(1.0, method, 1e-3))
            .trusted()
            .unwrap_or(f64::INFINITY);
        let amplitudes = centres_between(AMPLITUDES, columns);
        let steps = centres_between(MOVE_STEPS, columns);
        let cells = amplitudes.iter().flat_map(|amplitude| {
            let steps = steps.iter();
            steps.map(|h| move_of(*amplitude, method, *h))
        });
        let verdicts = arrive(&cells.collect::<Vec<_>>());
        let row = |(amplitude, verdicts): (&f64, &[bool])| {
            let motion = Motion::ahead(&move_of(*amplitude, method, 1e-3), &State::rest());
            (motion.timestep.min(poses), verdicts.to_vec())
        };
        let rows = amplitudes.iter().zip(verdicts.chunks(columns));
        let rows = rows.map(row).collect();
        maps.push(MotionMap { method, rows });
    }
    maps
}

/// Free swings: limited by the frequency of small ones, and by their speed. A method that lets small swings grow at
/// every timestep is limited by the speed alone here, for in four seconds little comes of that.
fn spins(columns: usize) -> Vec<MotionMap> {
    let mut maps = Vec::new();
    for method in Method::ALL {
        let free = ControlLoop::free(Arm::<2>::default()).with_method(method);
        let small = limit_held(&free)
            .filter(|limit| *limit > 0.0)
            .unwrap_or(f64::INFINITY);
        let speeds = centres_between(SPINS, columns);
        let steps = centres_between(SWING_STEPS, columns);
        let cells = speeds.iter().flat_map(|spin| {
            let steps = steps.iter();
            steps.map(|h| (free.with_timestep(*h), spun(*spin)))
        });
        let verdicts = are_carried(&cells.collect::<Vec<_>>());
        let row = |(spin, verdicts): (&f64, &[bool])| {
            let motion = Motion::ahead(&free, &spun(*spin));
            (motion.timestep.min(small), verdicts.to_vec())
        };
        let rows = speeds.iter().zip(verdicts.chunks(columns));
        let rows = rows.map(row).collect();
        maps.push(MotionMap { method, rows });
    }
    maps
}

fn map_figure(moves: &[MotionMap], swings: &[MotionMap], columns: usize) -> Figure {
    let mut plots = Vec::new();
    for (maps, steps, values, label, title) in [
        (
            moves,
            MOVE_STEPS,
            AMPLITUDES,
            "turn of the first joint [rad]",
            "move",
        ),
        (
            swings,
            SWING_STEPS,
            SPINS,
            "spin of the first joint [rad/s]",
            "free swing",
        ),
    ] {
        for map in maps {
            let mut plot = Plot::new(
                format!("{}, {title}", map.method),
                Axis::log_between("timestep", Unit::Seconds, steps.0, steps.1),
                Axis::log_between(label, Unit::Number, values.0, values.1),
            );
            let level = |holds: &bool| if *holds { -2 } else { 3 };
            plot.heat = Some(Heat {
                x: edges(steps, columns),
                y: edges(values, columns),
                rows: map
                    .rows
                    .iter()
                    .map(|(_, row)| row.iter().map(level).collect())
                    .collect(),
            });
            let line = centres_between(values, columns)
                .into_iter()
                .zip(&map.rows)
                .map(|(value, (limit, _))| (*limit, value))
                .filter(|(limit, _)| *limit <= steps.1);
            plot.series.push(Curve::line("ink", line));
            plots.push(plot);
        }
    }
    Figure::new(
        "nonlinear-map",
        "Beyond small deviations the timestep is limited by speed",
        "Top: moves of 2 links under the default gains, from rest; blue where both joints are within 0.02 rad after 6 \
         s, orange where not. Bottom: free swings from (0, 0.5) with the first joint spinning; \
         orange where the energy above the hanging arm's doubles or halves within 4 s. Line: the smaller of the limit \
         by linearisation (moves: the least of all poses; swings: of small swings, where there is one) and \
         the timestep_limit_motion that the service answers. A set of moves that no timestep brings home in time \
         shows as orange at the top of every panel.",
        &[Key::line("ink", "predicted limit")],
        &plots,
    )
}

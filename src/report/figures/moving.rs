//! The cost of holding a setpoint that moves: part of the section on forces.
//!
//! **Invariant:** an order is fitted where truncation and hold are all there is.

use super::slope::{AGREEMENT, as_expected, order_cell, slope};
use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::report::csv::Csv;
use crate::report::experiments::error::{OUTPUTS, REACH};
use crate::report::experiments::moving::{
    DURATION, LookedAt, MovingScene, TIMESTEP, distance_behind,
};
use crate::report::making::Making;
use crate::report::section::{Block, Cell, Figure, Section, Table, Verdict, by_method};
use crate::report::svg::{
    Axis, Curve, Key, Marker, Plot, Point, Unit, number, scientific, seconds,
};

/// Errors below this \[rad\] are rounding as much as truncation.
const ROUNDING: f64 = 1e-13;

/// Errors above this \[rad\] are of a loop near its limit.
const COARSE: f64 = 1e-2;

/// Runs that an order is fitted to, the finest.
const FITTED: usize = 3;

/// Steps between two moves of the setpoint: each, five (as the action `follow_joint_trajectory` moves it), 60 Hz, …
const EVERY: [u64; 7] = [1, 2, 5, 10, 17, 50, 100];

struct MovingLine {
    behind: LookedAt,
    method: Method,
    /// Timestep and error.
    points: Vec<(f64, f64)>,
}

impl MovingLine {
    fn order(&self) -> Option<f64> {
        let shown = |point: &&(f64, f64)| point.1 > ROUNDING && point.1 < COARSE;
        let inside = self.points.iter().rev().filter(shown);
        slope(inside.take(FITTED).copied())
    }

    fn as_expected(&self) -> Option<bool> {
        as_expected(self.order(), self.behind.order(self.method))
    }

    /// Timestep and error nearest to a millisecond.
    fn near_a_millisecond(&self) -> Option<(f64, f64)> {
        let mut points = self.points.iter().copied();
        points.find(|point| point.0 < 1.5e-3)
    }
}

/// Time between two moves of the setpoint \[s\], and how far the arm comes to be from it \[rad\], with velocities and
/// without.
type Distance = (f64, f64, f64);

/// Adds what there is to say about setpoints that move.
pub(super) fn add(making: &mut Making<'_>, section: &mut Section) {
    let scene = MovingScene::new();
    let halvings = making.choose(9, 7);
    let mut lines = Vec::new();
    for behind in LookedAt::ALL {
        for method in Method::ALL {
            let points = (0..=halvings).map(|halving| {
                let steps = OUTPUTS << halving;
                let error = scene.error(behind, method, steps);
                (DURATION / in_f64(steps), error)
            });
            lines.push(MovingLine {
                behind,
                method,
                points: points.collect(),
            });
        }
    }
    let distances: Vec<Distance> = EVERY
        .iter()
        .map(|&every| {
            let (with, without) = (distance_behind(every, true), distance_behind(every, false));
            (TIMESTEP * in_f64(every), with, without)
        })
        .collect();
    making.keep("moving", errors(&lines));
    making.keep("behind", distances_csv(&distances));
    let judged: Vec<bool> = lines.iter().filter_map(MovingLine::as_expected).collect();
    let held = judged.iter().filter(|holds| **holds).count();
    section.findings.extend(findings(&lines, &distances));
    section.verdicts.push(Verdict {
        claim: format!(
            "Behind a moving setpoint a method keeps its order if law and setpoint are looked at in every stage, \
             and is of order 1 if the setpoint is held for the step, to {AGREEMENT}"
        ),
        seen: format!("{held} of {} orders", judged.len()),
        holds: held == judged.len() && judged.len() == lines.len(),
    });
    section.blocks.extend([
        Block::Figure(figure(&lines)),
        Block::Table(table(&lines)),
        Block::Figure(distance_figure(&distances)),
    ]);
}

fn errors(lines: &[MovingLine]) -> Csv {
    let mut csv = Csv::new("looked_at,method,dt,err_rad");
    for line in lines {
        for (dt, error) in &line.points {
            csv.row(&[
                line.behind.name().into(),
                line.method.name().into(),
                (*dt).into(),
                (*error).into(),
            ]);
        }
    }
    csv
}

fn distances_csv(distances: &[Distance]) -> Csv {
    let mut csv = Csv::new("setpoint_period,behind_with_velocity_rad,behind_without_rad");
    for (period, with, without) in distances {
        csv.row(&[(*period).into(), (*with).into(), (*without).into()]);
    }
    csv
}

fn findings(lines: &[MovingLine], distances: &[Distance]) -> Vec<String> {
    let rk4 = |behind| {
        let mut of = lines.iter();
        let line = of.find(|line| line.behind == behind && line.method == Method::Rk4)?;
        let order = line
            .order()
            .map_or_else(|| "?".to_owned(), |x| format!("{x:.1}"));
        Some((line.near_a_millisecond()?, order))
    };
    let mut found = Vec::new();
    if let (Some((live, live_order)), Some((held, held_order)), Some((known, known_order))) = (
        rk4(LookedAt::BothHeld),
        rk4(LookedAt::SetpointHeld),
        rk4(LookedAt::EveryStage),
    ) {
        found.push(format!(
            "**A setpoint that moves costs an order as a held effort does**: along {REACH}, on a smooth path of {} s, \
             RK4 at {} is off the law and the setpoint of every instant by {} rad with law and setpoint once a step, \
             as the live arm has them (order {live_order}), \
             {} rad with the setpoint alone held for the step (order {held_order}), and {} rad with both known in \
             every stage (order {known_order}).",
            number(DURATION),
            seconds(live.0),
            scientific(live.1),
            scientific(held.1),
            scientific(known.1),
        ));
    }
    let at = |period: f64| {
        let nearest = distances
            .iter()
            .min_by(|a, b| (a.0 - period).abs().total_cmp(&(b.0 - period).abs()));
        nearest.copied()
    };
    if let (Some(step), Some(action), Some(display)) = (at(1e-3), at(5e-3), at(1.0 / 60.0)) {
        found.push(format!(
            "**Velocities sent along keep the arm {} times nearer to a setpoint that moves**: with the default gains \
             it is at most {} rad behind on that path with them and {} without, if the setpoint is moved every step \
             of {}; {} and {} if every {}, {} and {} if every {}.",
            number((step.2 / step.1 * 10.0).round() / 10.0),
            scientific(step.1),
            scientific(step.2),
            seconds(step.0),
            scientific(action.1),
            scientific(action.2),
            seconds(action.0),
            scientific(display.1),
            scientific(display.2),
            seconds(display.0),
        ));
    }
    found
}

fn figure(lines: &[MovingLine]) -> Figure {
    let plots: Vec<Plot> = LookedAt::ALL
        .iter()
        .map(|behind| {
            let of = || lines.iter().filter(|line| line.behind == *behind);
            let times = of().flat_map(|line| line.points.iter().map(|point| point.0));
            let mut plot = Plot::new(
                behind.name(),
                Axis::log("timestep = control period", Unit::Seconds, times),
                Axis::log_between("largest error [rad]", Unit::Number, 1e-15, 1.0),
            );
            for line in of() {
                let points = line.points.iter().map(|&(dt, error)| {
                    let words = format!("{}, {}: {} rad", line.method, seconds(dt), number(error));
                    // A run that is lost stays lost.
                    Point::new(dt, if error < 1e-15 { 1e-15 } else { error }, words)
                });
                plot.series.push(Curve::of(line.method, points.collect()));
            }
            plot
        })
        .collect();
    Figure::new(
        "moving",
        "A setpoint that moves and is held for the step leaves order 1",
        "2 links with kp 200, 100 and kd 30, 12, behind a setpoint that goes from (0, 0) to (0.8, -0.6) in 2 s along \
         a polynomial of fifth degree, velocity sent along; error against the law and the setpoint at every instant. \
         The first panel is what the live arm does.",
        &Key::methods(),
        &plots,
    )
}

fn table(lines: &[MovingLine]) -> Table {
    let mut table = Table::new(
        "moving",
        "Orders behind a moving setpoint, as expected and as observed",
        format!("Fitted to the {FITTED} finest runs with errors above rounding."),
        &by_method(&["Looked at"], &[]),
    );
    for behind in LookedAt::ALL {
        let mut row = vec![Cell::new(behind.name())];
        for line in lines.iter().filter(|line| line.behind == behind) {
            row.push(order_cell(line.order(), behind.order(line.method)));
        }
        table.rows.push(row);
    }
    table
}

fn distance_figure(distances: &[Distance]) -> Figure {
    let mut plot = Plot::new(
        "distance from the moving setpoint",
        Axis::log(
            "time between two moves of the setpoint",
            Unit::Seconds,
            distances.iter().map(|row| row.0),
        ),
        Axis::log_between("largest distance [rad]", Unit::Number, 1e-3, 1.0),
    );
    let mut keys = Vec::new();
    for (class, marker, label, with) in [
        ("c1", Marker::Diamond, "positions and velocities", true),
        ("c2", Marker::Square, "positions alone", false),
    ] {
        let points = distances.iter().map(|&(period, known, unknown)| {
            let value = if with { known } else { unknown };
            let words = format!("{label}, {}: {} rad", seconds(period), scientific(value));
            Point::new(period, value, words)
        });
        plot.series.push(Curve {
            class,
            marker,
            line: true,
            dashed: false,
            points: points.collect(),
        });
        keys.push(Key {
            class,
            marker,
            dashed: false,
            label: label.to_owned(),
        });
    }
    Figure::new(
        "behind",
        "Velocities sent along keep it nearer",
        "The same path with the default gains and steps of a 1024th of a second, from rest where it begins. The \
         setpoint is held between two moves, its velocity too.",
        &keys,
        &[plot],
    )
}

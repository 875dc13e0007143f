//! Orders under forces that are hard on a method, and behind setpoints that move.
//!
//! **Invariant:** an order is fitted where truncation is all there is, and not where nothing is to be seen but
//! rounding.

use super::moving;
use super::slope::{AGREEMENT, as_expected, order_cell, slope};
use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::report::csv::Csv;
use crate::report::experiments::forcing::{COARSEST, DURATION, FORCES, Force};
use crate::report::making::Making;
use crate::report::section::{Block, Cell, Figure, Section, Table, Verdict, by_method};
use crate::report::svg::{Axis, Curve, Key, Plot, Point, Unit, number, power, seconds};

/// Errors below this are rounding as much as truncation.
const ROUNDING: f64 = 1e-12;

/// Runs that an order is fitted to, the finest that stand out from rounding.
const FITTED: usize = 6;

struct Convergence {
    force: &'static Force,
    method: Method,
    /// Timestep and error.
    points: Vec<(f64, f64)>,
}

impl Convergence {
    fn order(&self) -> Option<f64> {
        let inside = self.points.iter().rev().filter(|point| point.1 > ROUNDING);
        slope(inside.take(FITTED).copied())
    }

    fn as_expected(&self) -> Option<bool> {
        as_expected(self.order(), (self.force.order)(self.method))
    }
}

pub(super) fn make(making: &mut Making<'_>) -> Section {
    let halvings = making.choose(12, 10);
    let mut lines = Vec::new();
    for force in &FORCES {
        for method in Method::ALL {
            let points = (0..=halvings)
                .filter_map(|halving| {
                    let steps = COARSEST << halving;
                    Some((DURATION / in_f64(steps), force.error(method, steps)?))
                })
                .collect();
            lines.push(Convergence {
                force,
                method,
                points,
            });
        }
        making.at(lines.len() / Method::ALL.len(), FORCES.len());
    }
    let mut csv = Csv::new("force,method,dt,error_scaled");
    for line in &lines {
        for (dt, error) in &line.points {
            csv.row(&[
                line.force.name.into(),
                line.method.name().into(),
                (*dt).into(),
                (*error).into(),
            ]);
        }
    }
    making.keep("forcing", csv);
    let judged: Vec<bool> = lines.iter().filter_map(Convergence::as_expected).collect();
    let held = judged.iter().filter(|holds| **holds).count();
    let mut section = Section {
        findings: vec![finding(&lines)],
        verdicts: vec![Verdict {
            claim: format!(
                "Under every force a method has the order that theory leaves it, to {AGREEMENT}"
            ),
            seen: format!("{held} of {} orders", judged.len()),
            holds: held == judged.len() && judged.len() == lines.len(),
        }],
        blocks: vec![Block::Figure(figure(&lines)), Block::Table(table(&lines))],
        ..Section::default()
    };
    moving::add(making, &mut section);
    section
}

fn order_of(lines: &[Convergence], force: &str, method: Method) -> String {
    lines
        .iter()
        .find(|line| line.force.name == force && line.method == method)
        .and_then(Convergence::order)
        .map_or_else(|| "?".to_owned(), |order| format!("{order:.1}"))
}

/// How many times smaller RK4's error is than another method's at the same number of evaluations: the least and the
/// most of the finest runs.
fn gain(lines: &[Convergence], force: &str, other: Method) -> Option<(f64, f64)> {
    let of = |method| {
        lines
            .iter()
            .find(|line| line.force.name == force && line.method == method)
    };
    let (rk4, other) = (of(Method::Rk4)?, of(other)?);
    let shorter = f64::from(other.method.evaluations()) / f64::from(Method::Rk4.evaluations());
    let gains = rk4.points.iter().rev().filter_map(|(dt, error)| {
        let same_cost = |point: &&(f64, f64)| (point.0 / (dt * shorter) - 1.0).abs() < 1e-9;
        let beside = other.points.iter().find(same_cost)?;
        (*error > ROUNDING).then(|| beside.1 / error)
    });
    let gains = gains.take(FITTED).map(|gain| (gain, gain));
    gains.reduce(|all, one| (all.0.min(one.0), all.1.max(one.1)))
}

fn finding(lines: &[Convergence]) -> String {
    let rk4 = |force| order_of(lines, force, Method::Rk4);
    let gain = |force, method| {
        gain(lines, force, method).map_or_else(
            || "?".to_owned(),
            |(least, most)| format!("{least:.1} to {most:.1}"),
        )
    };
    format!(
        "**RK4 is of order {} under a smooth force, of {} where the force has a kink and of {} where it jumps**: \
         there its order is no higher than midpoint's, or Euler's. At equal cost it gains a factor of {} over midpoint \
         at a kink, and of {} over Euler at a jump.",
        rk4("smooth"),
        rk4("kink"),
        rk4("jump"),
        gain("kink", Method::Midpoint),
        gain("jump", Method::Euler),
    )
}

fn figure(lines: &[Convergence]) -> Figure {
    let plots: Vec<Plot> = FORCES
        .iter()
        .map(|force| {
            let of_force = || lines.iter().filter(|line| line.force.name == force.name);
            let times = of_force().flat_map(|line| line.points.iter().map(|point| point.0));
            let mut plot = Plot::new(
                format!("{}: {}", force.name, force.formula),
                Axis::log("timestep", Unit::Seconds, times),
                Axis::log_between(
                    "largest error / farthest position",
                    Unit::Number,
                    1e-16,
                    1e4,
                ),
            );
            for line in of_force() {
                let points = line.points.iter().map(|&(dt, error)| {
                    let words = format!("{}, {}: {}", line.method, seconds(dt), number(error));
                    Point::new(dt, error.max(1e-16), words)
                });
                plot.series.push(Curve::of(line.method, points.collect()));
            }
            plot
        })
        .collect();
    Figure::new(
        "forcing",
        "Where order is lost: forces through /arm_sim/integration_step",
        "A particle of 1 kg, from rest, for 2 s; c is a time that lies on no step, and the error the root of the mean \
         square over 32 of them. The fast force looks stiff and is not: nothing \
         feeds back, so no timestep is unstable. The aliased one has a period of 1/64 s: at timesteps of whole \
         periods every step sees the same force, and the particle is driven away.",
        &Key::methods(),
        &plots,
    )
}

fn table(lines: &[Convergence]) -> Table {
    let mut table = Table::new(
        "forcing",
        "Orders, as expected and as observed",
        format!(
            "Fitted to the {FITTED} finest runs with errors above {}.",
            power(ROUNDING.log10().round())
        ),
        &by_method(&["Force", ""], &[]),
    );
    for force in &FORCES {
        let mut row = vec![Cell::new(force.name), Cell::new(force.formula)];
        for line in lines.iter().filter(|line| line.force.name == force.name) {
            row.push(order_cell(line.order(), (force.order)(line.method)));
        }
        table.rows.push(row);
    }
    table
}

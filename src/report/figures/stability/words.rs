//! Stability in words.
//!
//! **Invariant:** every number in a sentence is one of this run.

use super::line::{AGREEMENT, LimitRow, with_default_gains};
use super::map::Map;
use super::period::{Growth, Period};
use crate::math::integrator::Method;
use crate::report::section::Verdict;
use crate::report::svg::{number, seconds};
use crate::study::stability::Sampling;

pub(super) fn findings(lines: &[LimitRow]) -> Vec<String> {
    let mut findings = Vec::new();
    let at = |sampling, method| with_default_gains(lines, sampling, method);
    if let (Some(verlet), Some(rk4), Some(continuous)) = (
        at(Sampling::Held, Method::Verlet),
        at(Sampling::Held, Method::Rk4),
        at(Sampling::Continuous, Method::Rk4),
    ) {
        let least = rk4.over_poses.map_or_else(String::new, |limit| {
            format!(" The smallest limit of all poses is {}.", seconds(limit))
        });
        findings.push(format!(
            "**Held at (0.4, 0.8) with the default gains, the 2-link arm goes unstable at {} with RK4 and at {} with \
             Verlet**: the same, since the effort is held for the step. With the law in every stage RK4 would be \
             stable up to {}. That belongs to the simulation; the first limit belongs to the controller, and a real \
             arm would show it.{least}",
            seconds(rk4.predicted),
            seconds(verlet.predicted),
            seconds(continuous.predicted),
        ));
    }
    let worst = worst(lines);
    findings.push(format!(
        "**The linearised loop predicts the arm's own limit to {} %** in {} cases: 2 and 3 links, mild to overdamped \
         gains, all methods, both kinds of control.",
        number(100.0 * worst),
        lines.len()
    ));
    findings
}

fn worst(lines: &[LimitRow]) -> f64 {
    lines
        .iter()
        .map(|line| {
            line.ratio()
                .map_or(f64::INFINITY, |ratio| (ratio - 1.0).abs())
        })
        .fold(0.0, f64::max)
}

pub(super) fn verdicts(
    lines: &[LimitRow],
    map: &Map,
    periods: &[Period],
    growth: &Growth,
) -> Vec<Verdict> {
    let worst = worst(lines);
    let spread = {
        let limits = periods
            .iter()
            .filter(|period| period.0 != Method::Euler)
            .filter_map(|period| period.2);
        let (low, high) = limits.fold((f64::INFINITY, 0.0_f64), |(low, high), limit| {
            (low.min(limit), high.max(limit))
        });
        high / low - 1.0
    };
    vec![
        Verdict {
            claim: format!("Predicted and measured limits agree to 1 % in all {} cases", lines.len()),
            seen: format!("furthest apart {} %", number(100.0 * worst)),
            holds: worst <= AGREEMENT,
        },
        Verdict {
            claim: "At most 1 % of the map's cells that can be judged disagree with the prediction".to_owned(),
            seen: format!(
                "{} of {}; {} more, agreeing or not, change too slowly to judge",
                map.disagreeing, map.cells, map.undecided
            ),
            holds: map.disagreeing * 100 <= map.cells,
        },
        Verdict {
            claim: "With a held effort midpoint, Verlet and RK4 share one limit of the control period, however many \
                    steps it is cut into (within 0.1 %)".to_owned(),
            seen: format!("{} % between the smallest and the largest", number(100.0 * spread)),
            holds: spread <= 1e-3,
        },
        Verdict {
            claim: "A deviation of the arm grows per control period as the spectral radius says (within 0.1 \
                    %)".to_owned(),
            seen: format!(
                "furthest off {} % in {} measurements with 1, 10 and 100 steps per period",
                number(100.0 * growth.furthest),
                growth.dots
            ),
            holds: growth.furthest <= 1e-3,
        },
    ]
}

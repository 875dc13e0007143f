//! Truncation, rounding and control hold as separate parts of the error.
//!
//! **Invariant:** each part is measured separately; their sum bounds the total.

use super::fit::slope;
use crate::math::integrator::Method;
use crate::report::experiments::budget::{Budget, Parts};
use crate::report::experiments::error::{OUTPUTS, REACH};
use crate::report::section::Section;
use crate::report::svg::{Axis, Curve, Key, Marker, Plot, Unit, number, scientific, seconds};
use crate::study::matrix::largest;

const DURATION: f64 = 2.0;
const METHODS: [Method; 3] = [Method::Euler, Method::Verlet, Method::Rk4];

/// A part of the error: its legend key and its value.
type ErrorPart = (Key, fn(&Parts) -> f64);

fn parts() -> [ErrorPart; 4] {
    let truncation = Key::line("c1", "truncation (the method)").marked(Marker::Diamond);
    let rounding = Key::line("c3", "rounding (53 bits)").marked(Marker::Circle);
    let hold = Key::line("c2", "control hold (the period)").marked(Marker::Square);
    [
        (truncation, |parts| parts.truncation),
        (rounding, |parts| parts.rounding),
        (hold, |parts| parts.hold),
        (Key::line("ink", "total").dashed(), |parts| parts.total),
    ]
}

pub(super) fn make(section: &mut Section) {
    let halvings = section.choose(9, 5);
    // For each timestep, coarse to fine, the parts of each method.
    let [free, held] = [false, true].map(|control| -> Vec<Vec<Parts>> {
        let budget = Budget::new(control, DURATION);
        let steps = (0..=halvings).map(|halving| OUTPUTS << halving);
        steps.map(|steps| budget.parts(&METHODS, steps)).collect()
    });
    figure(section, &[("Free swing", &free), ("PD reach, held", &held)]);
    findings(section, &held);
    let holds = held.iter().filter_map(|methods| methods.last());
    let order = slope(
        holds
            .filter(|parts| parts.hold < 1e-2)
            .map(|parts| (parts.timestep, parts.hold)),
    );
    section.claim(
        "Holding the effort is an error of first order in the control period (slope within 0.1)",
        format!("slope {:.3}", order.unwrap_or(f64::NAN)),
        order.is_some_and(|order| (order - 1.0).abs() <= 0.1),
    );
    let last = free.iter().filter_map(|methods| methods.last());
    let rounding = largest(last.map(|parts| parts.rounding));
    section.claim(
        "Rounding costs RK4 less than 10⁻¹⁴ rad in 2 s of free swing at every timestep",
        format!("at most {} rad", number(rounding)),
        rounding < 1e-14,
    );
}

fn figure(section: &mut Section, scenes: &[(&str, &Vec<Vec<Parts>>)]) {
    let all = scenes.iter().flat_map(|scene| scene.1.iter().flatten());
    let label = "timestep = control period";
    let x = Axis::around(label, Unit::Seconds, all.map(|parts| parts.timestep));
    let y = Axis::log("largest error [rad]", Unit::Number, (1e-18, 10.0));
    let mut panels = Vec::new();
    for (scene, runs) in scenes {
        for (index, method) in METHODS.iter().enumerate() {
            let runs: Vec<&Parts> = runs.iter().filter_map(|run| run.get(index)).collect();
            let plot = Plot::new(format!("{scene}, {method}"), x.clone(), y.clone());
            panels.push(plot.with(parts().map(|(key, of)| {
                let points = runs.iter().map(|parts| (parts.timestep, of(parts)));
                Curve::line(key, points.filter(|point| point.1 != 0.0))
            })));
        }
    }
    section.figure(
        "error-budget",
        "With a held effort the hold dominates the error; rounding is the smallest part while the motion is stable",
        &format!(
            "2 links of 1 m and 1 kg, from rest on the horizontal, 2 s. Free: no effort. PD: {REACH}, the effort held \
             for each step. Truncation: the method's steps in double-double arithmetic against the true motion under \
             the effort that these steps hold. Rounding: the live arm's steps against the same steps in double-double \
             arithmetic. Hold: that true motion against the one with a continuous-time law. A cross at the top edge is \
             a run that diverged."
        ),
        &panels,
    );
}

fn findings(section: &mut Section, held: &[Vec<Parts>]) {
    let near = held.iter().find_map(|methods| match methods.as_slice() {
        [euler, verlet, rk4] if rk4.timestep < 1.5e-3 => Some([*euler, *verlet, *rk4]),
        _ => None,
    });
    let Some([euler, verlet, rk4]) = near else {
        return;
    };
    let period = seconds(rk4.timestep);
    section.findings.push(format!(
        "**At a timestep and control period of {period}, {REACH} is off by {} rad because the effort is held, {} rad by \
         RK4's truncation and {} rad by rounding**. These are the largest of 1024 instants. The error of the hold is \
         the distance from a law that acts at every instant. A better method does not reduce it.",
        scientific(rk4.hold),
        scientific(rk4.truncation),
        scientific(rk4.rounding)
    ));
    section.findings.push(format!(
        "**Against the loop with the same control period, the error is {} rad with RK4, {} rad with Verlet and {} rad \
         with Euler**. This is the same motion at {period}.",
        scientific(rk4.truncation),
        scientific(verlet.truncation),
        scientific(euler.truncation),
    ));
}

//! The runs in words: headlines, findings, verdicts.
//!
//! **Invariant:** every number in a sentence is one of this run.

use super::data::{Data, MOST_SEARCHED, Run};
use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::report::experiments::error::REACH;
use crate::report::section::Verdict;
use crate::report::svg::{number, scientific, seconds};

pub(super) fn headline_time(data: &[Data]) -> String {
    let swing = data.iter().find(|data| data.scene.name() == "swing-2");
    let cost = |method| swing.and_then(|data| data.reaching(method, 1e-6));
    match (cost(Method::Rk4), cost(Method::Verlet), swing) {
        (Some(rk4), Some(verlet), Some(data)) => format!(
            "An error of 10⁻⁶ rad costs RK4 {} and Verlet {} of computing time for {} s of a free swing",
            seconds(rk4.timing.minimum),
            seconds(verlet.timing.minimum),
            number(data.scene.duration())
        ),
        _ => "Error against time".to_owned(),
    }
}

pub(super) fn headline_timestep(data: &[Data]) -> String {
    let held = data.iter().find(|data| data.scene.control() == "held");
    let order = |method| {
        held.and_then(|data| data.order(method))
            .map_or_else(|| "?".to_owned(), |o| format!("{o:.2}"))
    };
    format!(
        "Every method shows its order, until the effort is held: then RK4's is {} and Verlet's {}",
        order(Method::Rk4),
        order(Method::Verlet)
    )
}

pub(super) fn findings(data: &[Data]) -> Vec<String> {
    let mut findings = Vec::new();
    let of = |name: &str| data.iter().find(|data| data.scene.name() == name);
    if let Some(swing) = of("swing-2") {
        let cost = |method| swing.reaching(method, 1e-4);
        if let (Some(verlet), Some(rk4)) = (cost(Method::Verlet), cost(Method::Rk4)) {
            let evaluations = |run: &Run| in_f64(run.outcome.evaluations);
            let euler = cost(Method::Euler).map_or_else(
                // Euler takes an evaluation a step.
                || format!("over {}", number(in_f64(MOST_SEARCHED) / evaluations(rk4))),
                |euler| number(evaluations(euler) / evaluations(rk4)),
            );
            findings.push(format!(
                "**To stay within 10⁻⁴ rad of the true motion on a free 2-link swing of {} s RK4 takes steps of \
                 {}**, and {} evaluations per simulated second; Verlet needs {} times as many and Euler {euler} times.",
                number(swing.scene.duration()),
                seconds(rk4.outcome.timestep),
                number((evaluations(rk4) / swing.scene.duration()).round()),
                number(evaluations(verlet) / evaluations(rk4)),
            ));
        }
    }
    if let Some(held) = of("reach-held") {
        let at = |method, steps: u64| {
            held.of(method)
                .find(|run| run.outcome.steps == steps)
                .map(|run| run.outcome)
        };
        // 2 s in 2048 steps: the power of two next to the default timestep.
        if let (Some(rk4), Some(verlet)) = (at(Method::Rk4, 2048), at(Method::Verlet, 2048)) {
            findings.push(format!(
                "**Against a law that acts at every instant RK4 is no better than Verlet, once the effort is held for \
                 each step**: on {REACH} they are {} and {} rad off at dt = {}. What counts there is the control \
                 period.",
                scientific(rk4.error),
                scientific(verlet.error),
                seconds(rk4.timestep)
            ));
        }
    }
    let fastest = of("swing-2").and_then(|data| data.step_time(Method::Rk4));
    let slowest = of("swing-3").and_then(|data| data.step_time(Method::Rk4));
    if let (Some(two), Some(three)) = (fastest, slowest) {
        findings.push(format!(
            "**One RK4 step takes {} with 2 links and {} with 3**: at the default 1 ms the arm runs {} and {} times \
             faster than the clock.",
            seconds(two),
            seconds(three),
            number(1e-3 / two),
            number(1e-3 / three),
        ));
    }
    findings
}

pub(super) fn verdicts(data: &[Data]) -> Vec<Verdict> {
    let mut worst: (f64, String) = (0.0, "no slope fitted".to_owned());
    for data in data {
        for method in Method::ALL {
            let expected = if data.scene.control() == "held" {
                1.0
            } else {
                f64::from(method.order())
            };
            if let Some(order) = data.order(method) {
                let off = (order - expected).abs();
                if off >= worst.0 {
                    worst = (
                        off,
                        format!(
                            "furthest off: {} in {}, {order:.2} for {expected:.0}",
                            method,
                            data.scene.title()
                        ),
                    );
                }
            }
        }
    }
    let smallest = data
        .iter()
        .flat_map(|data| &data.runs)
        .map(|run| run.outcome.error)
        .filter(|error| *error > 0.0)
        .fold(f64::INFINITY, f64::min);
    let uncertainty = data
        .iter()
        .map(|data| data.scene.uncertainty())
        .fold(0.0, f64::max);
    vec![
        Verdict {
            claim: "Every method converges at its order, and at order 1 where the effort is held (slopes within \
                    0.35)".to_owned(),
            seen: worst.1,
            holds: worst.0 <= 0.35,
        },
        Verdict {
            claim: "References are at least 100 times better known than the smallest error shown".to_owned(),
            seen: format!("uncertainty at most {}, smallest error {}", scientific(uncertainty), scientific(smallest)),
            holds: uncertainty * 100.0 <= smallest,
        },
    ]
}

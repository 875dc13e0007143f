//! Truncation, rounding and control hold, apart.
//!
//! **Invariant:** the parts are measured each on its own; their sum bounds the whole.

use super::slope::slope;
use crate::math::integrator::Method;
use crate::report::csv::Csv;
use crate::report::experiments::budget::{Budget, Parts};
use crate::report::experiments::error::{OUTPUTS, REACH};
use crate::report::making::Making;
use crate::report::section::{Block, Figure, Section, Verdict};
use crate::report::svg::{
    Axis, Curve, Key, Marker, Plot, Point, Unit, number, scientific, seconds,
};

const DURATION: f64 = 2.0;
const METHODS: [Method; 3] = [Method::Euler, Method::Verlet, Method::Rk4];

/// One panel: control or not, method, parts by timestep from coarse to fine.
struct Panel {
    control: bool,
    method: Method,
    parts: Vec<Parts>,
}

pub(super) fn make(making: &mut Making<'_>) -> Section {
    let halvings = making.choose(9, 5);
    let mut panels = Vec::new();
    for control in [false, true] {
        let budget = Budget::new(control, DURATION);
        let mut columns: Vec<Panel> = METHODS
            .map(|method| Panel {
                control,
                method,
                parts: Vec::new(),
            })
            .into();
        for halving in 0..=halvings {
            let all = budget.parts(&METHODS, OUTPUTS << halving);
            for (panel, parts) in columns.iter_mut().zip(all) {
                panel.parts.push(parts);
            }
        }
        panels.append(&mut columns);
    }
    making.keep("error-budget", rows(&panels));
    Section {
        findings: findings(&panels),
        verdicts: verdicts(&panels),
        blocks: vec![Block::Figure(figure(&panels))],
        ..Section::default()
    }
}

fn rows(panels: &[Panel]) -> Csv {
    let mut csv = Csv::new("scene,method,dt,total_rad,truncation_rad,rounding_rad,hold_rad");
    for panel in panels {
        for parts in &panel.parts {
            csv.row(&[
                scene(panel.control).into(),
                panel.method.name().into(),
                parts.timestep.into(),
                parts.total.into(),
                parts.truncation.into(),
                parts.rounding.into(),
                parts.hold.into(),
            ]);
        }
    }
    csv
}

fn scene(control: bool) -> &'static str {
    if control {
        "PD reach, held"
    } else {
        "Free swing"
    }
}

const PARTS: [(&str, &str, Marker); 3] = [
    ("c1", "truncation (the method)", Marker::Diamond),
    ("c3", "rounding (53 bits)", Marker::Circle),
    ("c2", "control hold (the period)", Marker::Square),
];

fn plot(panel: &Panel, x: &Axis, y: &Axis) -> Plot {
    let title = format!("{}, {}", scene(panel.control), panel.method);
    let mut plot = Plot::new(title, x.clone(), y.clone());
    let total = panel
        .parts
        .iter()
        .map(|parts| (parts.timestep, parts.total));
    plot.series.push(Curve {
        dashed: true,
        ..Curve::line("ink", total)
    });
    for (class, name, marker) in PARTS {
        let points: Vec<Point> = panel
            .parts
            .iter()
            .map(|parts| {
                let value = match class {
                    "c1" => parts.truncation,
                    "c3" => parts.rounding,
                    _ => parts.hold,
                };
                let tooltip = format!(
                    "{name}: {} rad at {}",
                    scientific(value),
                    seconds(parts.timestep)
                );
                Point::new(parts.timestep, value, tooltip)
            })
            .filter(|point| point.y != 0.0)
            .collect();
        plot.series.push(Curve {
            class,
            marker,
            line: true,
            dashed: false,
            points,
        });
    }
    plot
}

fn figure(panels: &[Panel]) -> Figure {
    let all = panels.iter().flat_map(|panel| &panel.parts);
    let x = Axis::log(
        "timestep = control period",
        Unit::Seconds,
        all.map(|parts| parts.timestep),
    );
    let y = Axis::log_between("largest error [rad]", Unit::Number, 1e-18, 10.0);
    let plots: Vec<Plot> = panels.iter().map(|panel| plot(panel, &x, &y)).collect();
    let mut legend: Vec<Key> = PARTS
        .iter()
        .map(|(class, label, marker)| Key {
            class,
            marker: *marker,
            dashed: false,
            label: (*label).to_owned(),
        })
        .collect();
    legend.push(Key {
        dashed: true,
        ..Key::line("ink", "all of it")
    });
    Figure::new(
        "error-budget",
        "Under a held effort the hold outweighs everything else; rounding is visible only where nothing else is left",
        "2 links, 2 s. Truncation: the method's steps in twice the digits against the true motion under the effort \
         those steps hold. Rounding: the live arm's steps against the same steps in twice the digits. Hold: that true \
         motion against the one under the law at every instant.",
        &legend,
        &plots,
    )
}

fn findings(panels: &[Panel]) -> Vec<String> {
    let mut findings = Vec::new();
    let rk4 = panels
        .iter()
        .find(|panel| panel.control && panel.method == Method::Rk4);
    let near = |panel: &'_ Panel| {
        let parts = panel.parts.iter();
        parts.copied().find(|parts| parts.timestep < 1.5e-3)
    };
    let euler = panels
        .iter()
        .find(|panel| panel.control && panel.method == Method::Euler);
    if let (Some(euler), Some(rk4)) = (euler.and_then(near), rk4.and_then(near)) {
        let part = euler.total / rk4.total;
        findings.push(format!(
            "**Against a law that acts at every instant, hold and truncation together, Euler is off by {} rad at {} on \
             {REACH} and RK4 by {} rad**: {}.",
            scientific(euler.total),
            seconds(rk4.timestep),
            scientific(rk4.total),
            if part < 0.9 {
                "Euler's truncation happens to cancel part of the hold, which makes it no better method"
            } else {
                "the hold is all that shows"
            }
        ));
    }
    if let Some(parts) = rk4.and_then(near) {
        findings.push(format!(
            "**Against a law that acts at every instant, on {REACH}, at a control period of {}, holding the effort \
             costs {} rad, RK4's truncation {} and rounding {}**: a better method cannot make good what the \
             control period loses.",
            seconds(parts.timestep),
            scientific(parts.hold),
            scientific(parts.truncation),
            scientific(parts.rounding)
        ));
    }
    let verlet = panels
        .iter()
        .find(|panel| panel.control && panel.method == Method::Verlet);
    let of = |panel: Option<&Panel>| panel.and_then(near);
    if let (Some(euler), Some(verlet), Some(rk4)) = (of(euler), of(verlet), of(rk4)) {
        findings.push(format!(
            "**Against the loop whose law runs at the same instants RK4 is {} rad off, Verlet {} and Euler {}**, on \
             the same reach at {}: the method matters for the simulation, the period for the control.",
            scientific(rk4.truncation),
            scientific(verlet.truncation),
            scientific(euler.truncation),
            seconds(rk4.timestep)
        ));
    }
    findings
}

fn verdicts(panels: &[Panel]) -> Vec<Verdict> {
    let mut verdicts = Vec::new();
    let rk4 = panels
        .iter()
        .find(|panel| panel.control && panel.method == Method::Rk4);
    if let Some(panel) = rk4 {
        let order = slope(
            panel
                .parts
                .iter()
                .filter(|parts| parts.hold < 1e-2)
                .map(|parts| (parts.timestep, parts.hold)),
        );
        verdicts.push(Verdict {
            claim: "Holding the effort is an error of first order in the control period (slope within 0.1)".to_owned(),
            seen: order.map_or_else(|| "no slope".to_owned(), |order| format!("slope {order:.3}")),
            holds: order.is_some_and(|order| (order - 1.0).abs() <= 0.1),
        });
    }
    let rounding = panels
        .iter()
        .filter(|panel| !panel.control && panel.method == Method::Rk4)
        .flat_map(|panel| &panel.parts)
        .map(|parts| parts.rounding)
        .fold(0.0, f64::max);
    verdicts.push(Verdict {
        claim: "Rounding costs RK4 less than 10⁻¹⁴ rad in 2 s of free swing at every timestep"
            .to_owned(),
        seen: format!("at most {} rad", number(rounding)),
        holds: rounding < 1e-14,
    });
    verdicts
}

//! Energy of a free swing that goes on for long.
//!
//! **Invariant:** drift is divided by the arm's energy scale, never by its energy, which is 0 at the start.

use crate::math::arm::{Arm, State};
use crate::math::integrator::Method;
use crate::report::csv::Csv;
use crate::report::experiments::chaos::energy_drift;
use crate::report::making::Making;
use crate::report::section::{Block, Figure, Section, Verdict};
use crate::report::svg::{Axis, Curve, Key, Plot, Unit, number, scientific, seconds};

const TIMESTEP: f64 = 1e-3;

struct DriftPanel {
    title: String,
    method: Method,
    points: Vec<(f64, f64)>,
    duration: f64,
}

pub(super) fn make(making: &mut Making<'_>) -> Section {
    let duration = making.choose(1000.0, 60.0);
    let hanging = -std::f64::consts::FRAC_PI_2;
    let regular = State {
        position: [hanging + 0.3, 0.0],
        velocity: [0.0; 2],
    };
    let mut panels = Vec::new();
    for (index, method) in Method::ALL.into_iter().enumerate() {
        let arm = Arm::<2>::default();
        let mut add = |title: &str, points| {
            panels.push(DriftPanel {
                title: title.to_owned(),
                method,
                points,
                duration,
            });
        };
        add(
            "Regular swing, 2 links from 0.3 rad",
            energy_drift(&arm, &regular, method, TIMESTEP, duration),
        );
        add(
            "Chaotic swing, 2 links from horizontal",
            energy_drift(&arm, &State::rest(), method, TIMESTEP, duration),
        );
        let three = Arm::<3>::default();
        add(
            "Chaotic swing, 3 links from horizontal",
            energy_drift(&three, &State::rest(), method, TIMESTEP, duration),
        );
        making.at(index + 1, Method::ALL.len());
    }
    let mut csv = Csv::new("scene,method,dt,t,dE_max_scaled");
    for panel in &panels {
        for (t, drift) in &panel.points {
            csv.row(&[
                panel.title.as_str().into(),
                panel.method.name().into(),
                TIMESTEP.into(),
                (*t).into(),
                (*drift).into(),
            ]);
        }
    }
    making.keep("energy-drift", csv);
    Section {
        findings: findings(&panels),
        verdicts: verdicts(&panels),
        blocks: vec![Block::Figure(figure(&panels))],
        ..Section::default()
    }
}

impl DriftPanel {
    fn end(&self) -> f64 {
        self.points.last().map_or(f64::NAN, |point| point.1)
    }
}

fn figure(panels: &[DriftPanel]) -> Figure {
    let times = panels
        .iter()
        .flat_map(|panel| panel.points.iter().map(|point| point.0));
    let x = Axis::log("simulated time [s]", Unit::Number, times);
    let y = Axis::log_between(
        "largest energy error so far / scale",
        Unit::Number,
        1e-17,
        1e2,
    );
    let mut plots: Vec<Plot> = Vec::new();
    for panel in panels {
        if !plots.iter().any(|plot| plot.title == panel.title) {
            plots.push(Plot::new(panel.title.clone(), x.clone(), y.clone()));
        }
        for plot in plots.iter_mut().filter(|plot| plot.title == panel.title) {
            let points = panel.points.iter().filter(|point| point.1 > 0.0).copied();
            plot.series.push(Curve::line(panel.method.name(), points));
        }
    }
    let keys: Vec<Key> = Method::ALL
        .iter()
        .map(|method| Key::line(method.name(), method.name()))
        .collect();
    Figure::new(
        "energy-drift",
        headline(panels),
        "Timestep 1 ms, no control: energy should stay. The scale is the arm's largest change of potential energy plus \
         its kinetic energy at the start. A line that ends early left the finite numbers.",
        &keys,
        &plots,
    )
}

fn of<'a>(panels: &'a [DriftPanel], title: &str, method: Method) -> Option<&'a DriftPanel> {
    panels
        .iter()
        .find(|panel| panel.title.starts_with(title) && panel.method == method)
}

fn headline(panels: &[DriftPanel]) -> String {
    let end = |title, method| of(panels, title, method).map_or(f64::NAN, DriftPanel::end);
    format!(
        "Verlet keeps energy to {} on a regular swing but only to {} on a chaotic one; RK4 to {}",
        scientific(end("Regular", Method::Verlet)),
        scientific(end("Chaotic swing, 2", Method::Verlet)),
        scientific(end("Chaotic swing, 2", Method::Rk4))
    )
}

fn findings(panels: &[DriftPanel]) -> Vec<String> {
    let end = |method| of(panels, "Chaotic swing, 2", method).map_or(f64::NAN, DriftPanel::end);
    let duration = panels.first().map_or(0.0, |panel| panel.duration);
    vec![format!(
        "**Over {} s of chaotic swing at {} the energy error is {} of the scale with Verlet, {} with midpoint and {} \
         with RK4.** This Verlet is not symplectic: the forces of an arm depend on velocity.",
        number(duration),
        seconds(TIMESTEP),
        scientific(end(Method::Verlet)),
        scientific(end(Method::Midpoint)),
        scientific(end(Method::Rk4))
    )]
}

fn verdicts(panels: &[DriftPanel]) -> Vec<Verdict> {
    let mut holds = true;
    for title in ["Regular", "Chaotic swing, 2", "Chaotic swing, 3"] {
        let end = |method| of(panels, title, method).map_or(f64::NAN, DriftPanel::end);
        let order_two = end(Method::Midpoint).min(end(Method::Verlet));
        // An Euler run that left the finite numbers has no end to compare.
        let euler = end(Method::Euler);
        holds &= end(Method::Rk4) < order_two && (order_two < euler || !euler.is_finite());
    }
    vec![Verdict {
        claim: "At 1 ms energy is kept best by RK4, then by the methods of order 2, worst by Euler, in all three \
                swings".to_owned(),
        seen: headline(panels),
        holds,
    }]
}

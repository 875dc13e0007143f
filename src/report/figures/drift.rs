//! Energy of a free swing that goes on for long.
//!
//! **Invariant:** drift is divided by the arm's energy scale, never by its energy, which is 0 at the start.

use crate::math::arm::{Arm, State};
use crate::math::integrator::Method;
use crate::report::csv::Csv;
use crate::report::experiments::chaos::{energy_drift, symplectic_drift};
use crate::report::making::Making;
use crate::report::section::{Block, Figure, Section, Verdict};
use crate::report::svg::{Axis, Curve, Key, Plot, Unit, number, one_digit, seconds};

const TIMESTEP: f64 = 1e-3;

/// Swings of the ensemble.
const ENSEMBLE: u32 = 8;

/// The symplectic baseline, in the legend and in the file.
const BASELINE: &str = "implicit midpoint";

/// One line of a panel; without a method it is the baseline's.
struct DriftPanel {
    title: &'static str,
    method: Option<Method>,
    points: Vec<(f64, f64)>,
}

pub(super) fn make(making: &mut Making<'_>) -> Section {
    let duration = making.choose(1000.0, 60.0);
    let hanging = -std::f64::consts::FRAC_PI_2;
    let regular = State::at_rest([hanging + 0.3, 0.0]);
    let (two, three) = (Arm::<2>::default(), Arm::<3>::default());
    let mut panels = Vec::new();
    let lines = Method::ALL.map(Some).into_iter().chain([None]);
    for method in lines {
        let of_two = |start: &State<2>| match method {
            Some(method) => energy_drift(&two, start, method, TIMESTEP, duration),
            None => symplectic_drift(&two, start, TIMESTEP, duration),
        };
        let of_three = match method {
            Some(method) => energy_drift(&three, &State::rest(), method, TIMESTEP, duration),
            None => symplectic_drift(&three, &State::rest(), TIMESTEP, duration),
        };
        panels.extend(
            [
                ("Regular swing, 2 links from 0.3 rad", of_two(&regular)),
                (
                    "Chaotic swing, 2 links from horizontal",
                    of_two(&State::rest()),
                ),
                ("Chaotic swing, 3 links from horizontal", of_three),
            ]
            .map(|(title, points)| DriftPanel {
                title,
                method,
                points,
            }),
        );
    }
    let ensemble: Vec<(Method, String)> = [Method::Verlet, Method::Midpoint, Method::Rk4]
        .map(|method| (method, ends_of_ensemble(method, duration)))
        .into();
    let mut csv = Csv::new("scene,method,dt,t,dE_max_scaled");
    for panel in &panels {
        for (t, drift) in &panel.points {
            csv.row(&[
                panel.title.into(),
                panel.method.map_or(BASELINE, Method::name).into(),
                TIMESTEP.into(),
                (*t).into(),
                (*drift).into(),
            ]);
        }
    }
    making.keep("energy-drift", csv);
    Section {
        findings: findings(&ensemble, duration),
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
            plots.push(Plot::new(panel.title, x.clone(), y.clone()));
        }
        for plot in plots.iter_mut().filter(|plot| plot.title == panel.title) {
            let points = panel.points.iter().filter(|point| point.1 > 0.0).copied();
            let class = panel.method.map_or("ink", Method::name);
            plot.series.push(Curve {
                dashed: panel.method.is_none(),
                ..Curve::line(class, points)
            });
        }
    }
    let mut keys = Method::ALL
        .map(|method| Key::line(method.name(), method.name()))
        .to_vec();
    keys.push(Key {
        dashed: true,
        ..Key::line("ink", BASELINE)
    });
    Figure::new(
        "energy-drift",
        headline(panels),
        "Free swings at a timestep of 1 ms. Their energy should stay. The scale is the arm's largest change of \
         potential energy plus its kinetic energy at the start. A line that ends early left the finite numbers. \
         Implicit midpoint is a baseline of this report: it is symplectic, and its error does not grow with time.",
        &keys,
        &plots,
    )
}

fn of<'a>(panels: &'a [DriftPanel], title: &str, method: Option<Method>) -> Option<&'a DriftPanel> {
    panels
        .iter()
        .find(|panel| panel.title.starts_with(title) && panel.method == method)
}

fn headline(panels: &[DriftPanel]) -> String {
    let end = |title, method| of(panels, title, Some(method)).map_or(f64::NAN, DriftPanel::end);
    format!(
        "Verlet keeps energy to {} on a regular swing but only to {} on a chaotic one; RK4 to {}",
        one_digit(end("Regular", Method::Verlet)),
        one_digit(end("Chaotic swing, 2", Method::Verlet)),
        one_digit(end("Chaotic swing, 2", Method::Rk4))
    )
}

/// The least and the largest energy error that the 2-link chaotic swing ends with, of swings let go a billionth of a
/// radian apart; one digit each. Chaos leaves no more.
fn ends_of_ensemble(method: Method, duration: f64) -> String {
    let arm = Arm::<2>::default();
    let ends = (0..ENSEMBLE).map(|index| {
        let start = State::at_rest([1e-9 * f64::from(index), 0.0]);
        let points = energy_drift(&arm, &start, method, TIMESTEP, duration);
        points.last().map_or(f64::NAN, |point| point.1)
    });
    let ends: Vec<f64> = ends.collect();
    let least = ends.iter().copied().fold(f64::INFINITY, f64::min);
    let most = ends.iter().copied().fold(0.0, f64::max);
    let (least, most) = (one_digit(least), one_digit(most));
    if least == most {
        least
    } else {
        format!("{least} to {most}")
    }
}

fn findings(ensemble: &[(Method, String)], duration: f64) -> Vec<String> {
    let ends = |method| {
        let mut of = ensemble.iter();
        of.find(|one| one.0 == method)
            .map_or("?", |one| one.1.as_str())
    };
    vec![format!(
        "**Over {} s of chaotic swing at {} the energy error is {} of the scale with Verlet, {} with midpoint and {} \
         with RK4**, in {ENSEMBLE} swings let go a billionth of a radian apart. This Verlet is not symplectic: the \
         forces of an arm depend on velocity.",
        number(duration),
        seconds(TIMESTEP),
        ends(Method::Verlet),
        ends(Method::Midpoint),
        ends(Method::Rk4)
    )]
}

fn verdicts(panels: &[DriftPanel]) -> Vec<Verdict> {
    let mut holds = true;
    for title in ["Regular", "Chaotic swing, 2", "Chaotic swing, 3"] {
        let end = |method| of(panels, title, Some(method)).map_or(f64::NAN, DriftPanel::end);
        let order_two = end(Method::Midpoint).min(end(Method::Verlet));
        // An Euler run that left the finite numbers has no end to compare.
        let euler = end(Method::Euler);
        holds &= end(Method::Rk4) < order_two && (order_two < euler || !euler.is_finite());
    }
    // The error of a symplectic method is bounded. A tenth of the time is enough to reach the bound.
    let growth = |title| {
        let points = &of(panels, title, None)?.points;
        let end = points.last()?;
        let tenth = points.iter().find(|point| point.0 >= 0.1 * end.0)?;
        Some(end.1 / tenth.1)
    };
    let regular = growth("Regular").unwrap_or(f64::NAN);
    vec![
        Verdict {
            claim: "At 1 ms energy is kept best by RK4, then by the methods of order 2, worst by Euler, in all three \
                    swings"
                .to_owned(),
            seen: headline(panels),
            holds,
        },
        Verdict {
            claim: "The energy error of the symplectic baseline does not grow on the regular swing (at most by half \
                    over the last nine tenths of the time)"
                .to_owned(),
            seen: format!("to {} times that of the first tenth", number(regular)),
            holds: regular <= 1.5,
        },
    ]
}

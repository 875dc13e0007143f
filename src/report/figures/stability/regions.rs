//! Why a loop goes unstable, as pictures: the eigenvalues of one step as the timestep grows, and the run that blows up.
//!
//! **Invariant:** the eigenvalues are predicted, the runs are the live arm's.

use std::f64::consts::TAU;

use crate::math::arm::State;
use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::math::simulation::Simulation;
use crate::report::csv::Csv;
use crate::report::section::Figure;
use crate::report::svg::{Axis, Curve, Key, Mark, Marker, Plot, Point, Unit, seconds};
use crate::study::control_loop::ControlLoop;
use crate::study::linear::Linear;
use crate::study::stability::{Sampling, limit_held, step_matrix};

/// Timesteps of the eigenvalues, in parts of the limit.
const PARTS: (f64, f64) = (0.05, 1.25);

/// How many timesteps are shown.
const SHOWN: u32 = 25;

/// Timesteps of the runs, in parts of the limit, and their classes.
const RUNS: [(f64, &str); 2] = [(0.97, "c1"), (1.03, "c2")];

/// Time of a run \[s\].
const DURATION: f64 = 3.0;

/// How far a run begins from the setpoint \[rad\].
const NUDGE: f64 = 1e-6;

/// The figure and its numbers, of a loop at its setpoint.
pub(super) fn regions_figure(control: &ControlLoop<2>) -> (Figure, Csv) {
    let mut csv = Csv::new("kind,method,dt,x,y");
    let (mut regions, mut runs) = (Vec::new(), Vec::new());
    for method in Method::ALL {
        let control = control.with_method(method);
        let Some(limit) = limit_held(&control) else {
            continue;
        };
        regions.push(region(&control, limit, &mut csv));
        runs.push(traces(&control, limit, &mut csv));
    }
    regions.append(&mut runs);
    let figure = Figure::new(
        "regions",
        "Why: beyond the limit one eigenvalue leaves the unit circle, and the arm flips at every step",
        format!(
            "2 links held at (0.4, 0.8) with the default gains. Top: the eigenvalues of one step of the linearised \
             loop in the circle in which it is stable, at {SHOWN} timesteps from {} to {} of the limit; they \
             begin near 1. Bottom: the arm itself, let go {NUDGE} rad from the setpoint, at {} and {} of that limit.",
            PARTS.0, PARTS.1, RUNS[0].0, RUNS[1].0
        ),
        &[
            Key {
                marker: Marker::Circle,
                ..Key::line("c1", "below the limit")
            },
            Key {
                marker: Marker::Square,
                ..Key::line("c2", "beyond it")
            },
            Key::line("ink", "the unit circle"),
        ],
        &regions,
    );
    (figure, csv)
}

fn region(control: &ControlLoop<2>, limit: f64, csv: &mut Csv) -> Plot {
    // As wide as it is high, on the paper.
    let mut plot = Plot::new(
        format!("{}: stable up to {}", control.method, seconds(limit)),
        Axis::linear("real part", -1.7, 1.7),
        Axis::linear("imaginary part", -1.2, 1.2),
    );
    let circle = (0..=120).map(|part| {
        let angle = TAU * f64::from(part) / 120.0;
        (angle.cos(), angle.sin())
    });
    plot.series.push(Curve::line("ink", circle));
    let linear = Linear::at_setpoint(control);
    let (mut inside, mut beyond) = (Vec::new(), Vec::new());
    for index in 0..SHOWN {
        let part = PARTS.0 + (PARTS.1 - PARTS.0) * f64::from(index) / f64::from(SHOWN - 1);
        let h = part * limit;
        let step = step_matrix(&linear, control.method, Sampling::Held, h);
        for value in step.eigenvalues() {
            csv.row(&[
                "eigenvalue".into(),
                control.method.name().into(),
                h.into(),
                value.re.into(),
                value.im.into(),
            ]);
            let words = format!("{}: {:.3} {:+.3} i", seconds(h), value.re, value.im);
            let point = Point::new(value.re, value.im, words);
            if part <= 1.0 {
                inside.push(point);
            } else {
                beyond.push(point);
            }
        }
    }
    for (class, marker, points) in [
        ("c1", Marker::Circle, inside),
        ("c2", Marker::Square, beyond),
    ] {
        plot.series.push(Curve {
            class,
            marker,
            line: false,
            dashed: false,
            points,
        });
    }
    plot
}

fn traces(control: &ControlLoop<2>, limit: f64, csv: &mut Csv) -> Plot {
    let mut plot = Plot::new(
        format!("{}: the arm at both sides of it", control.method),
        Axis::linear("simulated time [s]", 0.0, DURATION),
        Axis::log_between("distance from the setpoint [rad]", Unit::Number, 1e-12, 1e2),
    );
    for (part, class) in RUNS {
        let h = part * limit;
        let setpoint = control.setpoint.position;
        let start = State::at_rest(setpoint.map(|position| position + NUDGE));
        let mut live = settled(&control.with_timestep(h));
        live.set_state(start);
        let mut points = Vec::new();
        let mut step = 0;
        while in_f64(step) * h < DURATION && live.step() {
            step += 1;
            let position = live.state().position;
            let both = position.iter().zip(&setpoint);
            let off = both
                .map(|(one, other)| (one - other).abs())
                .fold(0.0, f64::max);
            csv.row(&[
                "run".into(),
                control.method.name().into(),
                h.into(),
                (in_f64(step) * h).into(),
                off.into(),
            ]);
            points.push((in_f64(step) * h, off.max(1e-12)));
        }
        plot.series.push(Curve::line(class, points));
    }
    plot.marks.push(Mark::Horizontal {
        y: NUDGE,
        class: "soft",
        label: "where it is let go".to_owned(),
        right: true,
    });
    plot
}

/// The loop at rest at its setpoint, its integral carrying the load, brought there with short steps.
fn settled(control: &ControlLoop<2>) -> Simulation<2> {
    let quiet = ControlLoop {
        method: Method::Rk4,
        ..*control
    };
    let mut live = quiet
        .with_timestep(1e-3)
        .simulation(State::at_rest(control.setpoint.position));
    live.advance(30_000);
    live.set_method(control.method);
    live.set_timestep(control.timestep);
    live
}

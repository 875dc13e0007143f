//! Spectral radius of one step against the timestep, with the measured limits on it.
//!
//! **Invariant:** lines are predicted, marks are measured.

use super::line::{LimitRow, capital, in_words, with_default_gains};
use crate::math::integrator::Method;
use crate::report::csv::Csv;
use crate::report::experiments::measure::stiffened;
use crate::report::section::Figure;
use crate::report::svg::{Axis, Curve, Key, Mark, Marker, Plot, Point, Unit, seconds};
use crate::study::linear::Linear;
use crate::study::stability::{Sampling, step_matrix};

/// The figure and its numbers.
pub(super) fn radius_figure(lines: &[LimitRow]) -> (Figure, Csv) {
    let mut csv = Csv::new("control,method,dt,spectral_radius");
    let plots = Sampling::ALL.map(|sampling| panel(lines, sampling, &mut csv));
    let figure = Figure::new(
        "spectral-radius",
        "With the effort held, midpoint, Verlet and RK4 go unstable at the same timestep; only a law in every stage \
         shows the method",
        "2 links, default gains. Lines are predicted: the largest eigenvalue of one step of the linearised loop. Marks \
         are where the arm itself was measured to stop settling.",
        &Key::methods(),
        &plots,
    );
    (figure, csv)
}

fn panel(lines: &[LimitRow], sampling: Sampling, csv: &mut Csv) -> Plot {
    let x = Axis::log_between("timestep", Unit::Seconds, 5e-4, 2e-2);
    let y = Axis::linear("growth per step (spectral radius)", 0.9, 1.1);
    let mut plot = Plot::new(capital(in_words(sampling)), x, y);
    plot.marks.push(Mark::Horizontal {
        y: 1.0,
        class: "ink",
        label: "unstable above".to_owned(),
        right: false,
    });
    for method in Method::ALL {
        let linear = Linear::at_setpoint(&stiffened(1.0).with_method(method));
        let mut curve = Vec::new();
        for index in 0..=400 {
            let h = 5e-4 * 40_f64.powf(f64::from(index) / 400.0);
            let radius = step_matrix(&linear, method, sampling, h).spectral_radius();
            csv.row(&[
                sampling.name().into(),
                method.name().into(),
                h.into(),
                radius.into(),
            ]);
            curve.push((h, radius));
        }
        let shown = curve.into_iter().filter(|(_, radius)| *radius <= 1.1);
        let held = sampling == Sampling::Held;
        plot.series.push(Curve {
            // Where curves lie on each other the dashed one lets the other through.
            dashed: held && matches!(method, Method::Verlet | Method::Rk4),
            ..Curve::line(method.name(), shown)
        });
        if let Some(limit) =
            with_default_gains(lines, sampling, method).and_then(|line| line.measured)
        {
            let tooltip = format!("{method}: measured limit {}", seconds(limit));
            plot.series.push(Curve {
                class: method.name(),
                marker: Marker::of(method),
                line: false,
                dashed: false,
                points: vec![Point::new(limit, 1.0, tooltip)],
            });
        }
    }
    plot
}

//! The two figures: error against time and against timestep.
//!
//! **Invariant:** the same error axis in every panel.

use super::data::{Data, Run};
use super::words::{headline_time, headline_timestep};
use crate::math::integrator::Method;
use crate::report::experiments::error::RunOutcome;
use crate::report::section::Figure;
use crate::report::svg::{Axis, Curve, Key, Mark, Plot, Point, Unit, scientific, seconds};

/// All panels share this, so that scenes can be compared. An exact hit is drawn on the lower edge.
fn error_axis() -> Axis {
    Axis::log_between("largest error [rad]", Unit::Number, 1e-17, 10.0)
}

fn tooltip(data: &Data, run: &Run) -> String {
    let RunOutcome {
        timestep,
        evaluations,
        error,
        ..
    } = run.outcome;
    let outcome = if error.is_finite() {
        format!("error {} {}", scientific(error), data.unit())
    } else {
        "diverged".to_owned()
    };
    format!(
        "{}: dt {}, {evaluations} evaluations, {}: {outcome}",
        run.method,
        seconds(timestep),
        seconds(run.timing.minimum)
    )
}

fn panels(data: &[Data], x: &Axis, of: impl Fn(&Run) -> f64) -> Vec<Plot> {
    data.iter()
        .map(|data| {
            let mut plot = Plot::new(data.scene.title(), x.clone(), error_axis());
            if data.scene.links() == 0 {
                plot.y.label = "largest error [m]";
            }
            for method in Method::ALL {
                let points = data.of(method).map(|run| {
                    // An error of exactly 0 has no logarithm: it is drawn at the lower edge.
                    let error = run.outcome.error.max(1e-17);
                    Point::new(of(run), error, tooltip(data, run))
                });
                plot.series.push(Curve::of(method, points.collect()));
            }
            plot
        })
        .collect()
}

fn floor() -> Mark {
    Mark::Horizontal {
        y: f64::EPSILON,
        class: "soft",
        label: "rounding".to_owned(),
        right: false,
    }
}

pub(super) fn against_time(data: &[Data]) -> Figure {
    let all = data.iter().flat_map(|data| &data.runs);
    let x = Axis::log(
        "time for the whole run",
        Unit::Seconds,
        all.map(|run| run.timing.minimum),
    );
    let mut plots = panels(data, &x, |run| run.timing.minimum);
    for (plot, data) in plots.iter_mut().zip(data) {
        plot.above = data.evaluation_time();
        let points = plot.series.iter_mut().flat_map(|series| &mut series.points);
        let runs = Method::ALL.into_iter().flat_map(|method| data.of(method));
        for (point, run) in points.zip(runs) {
            point.spread = Some(run.timing.quartiles);
        }
        plot.marks.push(floor());
    }
    Figure::new(
        "work-precision-time",
        headline_time(data),
        "One mark per timestep; each timestep is half of the one before, and all methods take the same ones. Time is \
         the minimum of repeats; whiskers reach from the first to the third quartile. Upper scale: evaluations of the \
         dynamics, at the median time of one in that scene. A cross at the top edge is a run that diverged. Dotted \
         line: one unit in the last place of 1 rad. The error of a reach is the distance from a law that acts at every \
         instant; that from the loop whose law runs once a period is the truncation in the figure of the error's \
         parts. Each mark's tooltip has its own evaluations.",
        &Key::methods(),
        &plots,
    )
}

pub(super) fn against_timestep(data: &[Data]) -> Figure {
    let all = data.iter().flat_map(|data| &data.runs);
    let x = Axis::log(
        "timestep",
        Unit::Seconds,
        all.map(|run| run.outcome.timestep),
    );
    let mut plots = panels(data, &x, |run| run.outcome.timestep);
    for (plot, data) in plots.iter_mut().zip(data) {
        for method in Method::ALL {
            if let Some(limit) = data.scene.predicted_limit(method) {
                plot.marks.push(Mark::Vertical {
                    x: limit,
                    class: method.name(),
                    tooltip: format!("{method}: predicted stability limit {}", seconds(limit)),
                });
            }
        }
        plot.marks.push(Mark::Slopes {
            x: x.max / 60.0,
            y: 1e-14,
            decades: 1.0,
            orders: vec![1.0, 2.0, 4.0],
        });
        plot.marks.push(floor());
    }
    Figure::new(
        "convergence",
        headline_timestep(data),
        "The runs of the figure before, by timestep: the slope is the order of the method. Dotted upright lines: the \
         predicted largest stable timestep at the setpoint, one per method. The three strokes show orders 1, 2 and 4.",
        &Key::methods(),
        &plots,
    )
}

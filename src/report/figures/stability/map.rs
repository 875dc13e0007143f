//! The map: does a nudge of the arm die out or grow, by timestep and stiffness, under the predicted line.
//!
//! **Invariant:** every cell is measured; the prediction is drawn over them and nothing is filled in.

use super::line::Meter;
use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::report::csv::Csv;
use crate::report::experiments::measure::{STEPS, growths, stiffened};
use crate::report::figures::cells::{centres, edges};
use crate::report::making::Making;
use crate::report::section::Figure;
use crate::report::svg::{Axis, Curve, Heat, Key, Marker, Plot, Point, Unit, seconds};
use crate::study::linear::Linear;
use crate::study::matrix::Matrix;
use crate::study::stability::{Sampling, largest_timestep, step_matrix};

/// Ends of the axes: timestep \[s\], factor on the default gains.
const TIMESTEPS: (f64, f64) = (2e-4, 1e-1);
const FACTORS: (f64, f64) = (1e-2, 1e2);

/// The map as it is made.
pub(super) struct Map {
    pub(super) csv: Csv,
    /// Cells judged, and those whose verdict is not the predicted one.
    pub(super) cells: usize,
    pub(super) disagreeing: usize,
    /// Cells not judged: see [`undecided`].
    pub(super) undecided: usize,
    /// Edges of the cells.
    timesteps: Vec<f64>,
    factors: Vec<f64>,
    plots: Vec<Plot>,
}

/// Measures `columns` timesteps at three quarters as many stiffnesses, for every method and kind of control.
pub(super) fn map(making: &mut Making<'_>, meter: &mut Meter, columns: usize) -> Map {
    let mut map = Map {
        csv: Csv::new("control,method,dt,gain_factor,growth,predicted_limit"),
        cells: 0,
        disagreeing: 0,
        undecided: 0,
        timesteps: edges(TIMESTEPS, columns),
        factors: edges(FACTORS, columns * 3 / 4),
        plots: Vec::new(),
    };
    for sampling in Sampling::ALL {
        for method in Method::ALL {
            map.panel(making, meter, method, sampling);
        }
    }
    map
}

impl Map {
    fn panel(
        &mut self,
        making: &mut Making<'_>,
        meter: &mut Meter,
        method: Method,
        sampling: Sampling,
    ) {
        let mut plot = Plot::new(
            format!("{method}, {}", sampling.name()),
            Axis::log_between("timestep", Unit::Seconds, TIMESTEPS.0, TIMESTEPS.1),
            Axis::log_between(
                "stiffness, times the default gains",
                Unit::Number,
                FACTORS.0,
                FACTORS.1,
            ),
        );
        let (mut rows, mut line, mut disagreeing) = (Vec::new(), Vec::new(), Vec::new());
        let (factors, timesteps) = (centres(&self.factors), centres(&self.timesteps));
        let cells = factors.iter().flat_map(|factor| {
            let control = stiffened(*factor).with_method(method);
            let timesteps = timesteps.iter();
            timesteps.map(move |h| control.with_timestep(*h))
        });
        let measured = growths(&cells.collect::<Vec<_>>(), sampling);
        for (factor, measured) in factors.into_iter().zip(measured.chunks(timesteps.len())) {
            let (limit, row) = self.row(factor, method, sampling, measured, &mut disagreeing);
            line.push((limit, factor));
            rows.push(row);
            meter.add(making, 1);
        }
        self.disagreeing += disagreeing.len();
        plot.heat = Some(Heat {
            x: self.timesteps.clone(),
            y: self.factors.clone(),
            rows,
        });
        plot.series.push(Curve::line("ink", line));
        plot.series.push(Curve {
            class: "ink",
            marker: Marker::Circle,
            line: false,
            dashed: false,
            points: disagreeing,
        });
        self.plots.push(plot);
    }

    /// Predicted limit and levels of one stiffness, by the growths that were measured.
    fn row(
        &mut self,
        factor: f64,
        method: Method,
        sampling: Sampling,
        measured: &[Option<f64>],
        disagreeing: &mut Vec<Point>,
    ) -> (f64, Vec<i8>) {
        let control = stiffened(factor).with_method(method);
        let linear = Linear::at_setpoint(&control);
        let limit = largest_timestep(&linear, method, sampling).unwrap_or(f64::INFINITY);
        let mut row = Vec::new();
        for (h, &growth) in centres(&self.timesteps).into_iter().zip(measured) {
            self.csv.row(&[
                sampling.name().into(),
                method.name().into(),
                h.into(),
                factor.into(),
                growth.into(),
                limit.into(),
            ]);
            // Asked before anybody looks at whether prediction and measurement agree.
            if undecided(&step_matrix(&linear, method, sampling, h)) {
                self.undecided += 1;
                row.push(0);
                continue;
            }
            row.push(level(growth));
            self.cells += 1;
            if growth.is_some_and(|growth| growth < 1.0) != (h < limit) {
                let tooltip = format!("predicted limit {}", seconds(limit));
                disagreeing.push(Point::new(h, factor, tooltip));
            }
        }
        (limit, row)
    }

    pub(super) fn figure(&self) -> Figure {
        Figure::new(
            "stability-map",
            format!(
                "Predicted and measured stability agree in {} of {} cells; {} change too slowly to judge",
                self.cells - self.disagreeing,
                self.cells,
                self.undecided
            ),
            "2 links at their setpoint, default gains stiffened by a factor (kp by it, kd by its root, ki by its power \
             of 3/2: the same motion, faster). Colour: whether a nudge of the arm itself dies out (blue) or grows \
             (orange), the darker the faster. Line: the predicted limit. Dots: cells where the two disagree. Grey: \
             not judged, because by the prediction the slowest mode changes its energy by less than a factor e in the \
             4000 steps watched; that is asked of every cell alike, before looking at whether it agrees. In the lowest \
             rows the gains are too weak to carry the arm against gravity: no timestep is stable.",
            &[Key::line("ink", "predicted limit")],
            &self.plots,
        )
    }
}

/// Whether the watch is too short to tell: by the prediction the slowest mode changes its energy by less than a factor
/// e meanwhile, so that where in its swing it is looked at decides. What was measured has no part in this.
fn undecided(step: &Matrix) -> bool {
    let watched = in_f64(STEPS);
    2.0 * watched * step.spectral_radius().ln().abs() < 1.0
}

/// Colour of a growth of energy over a few thousand steps.
fn level(growth: Option<f64>) -> i8 {
    match growth {
        None => 4,
        Some(growth) if growth > 1e4 => 3,
        Some(growth) if growth > 10.0 => 2,
        Some(growth) if growth >= 1.0 => 1,
        Some(growth) if growth > 0.1 => -1,
        Some(growth) if growth > 1e-4 => -2,
        Some(growth) if growth > 0.0 => -3,
        Some(_) => -4,
    }
}

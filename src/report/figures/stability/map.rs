//! The map: does a nudge of the arm die out or grow, by timestep and stiffness, under the predicted line.
//!
//! **Invariant:** every mark is measured, and shares nothing with the line of the prediction.

use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::report::csv::Csv;
use crate::report::experiments::measure::{STEPS, growths, stiffened};
use crate::report::figures::cells::{centres, edges};
use crate::report::section::Figure;
use crate::report::svg::{Axis, Curve, Key, Plot, Point, Unit, seconds};
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
    /// For each method and sampling: the predicted limit, then the measured one.
    curves: Vec<Curve>,
}

/// Measures `columns` timesteps at three quarters as many stiffnesses, for every method and kind of control.
pub(super) fn map(columns: usize) -> Map {
    let mut map = Map {
        csv: Csv::new("control,method,dt,gain_factor,growth,predicted_limit"),
        cells: 0,
        disagreeing: 0,
        undecided: 0,
        timesteps: edges(TIMESTEPS, columns),
        factors: edges(FACTORS, columns * 3 / 4),
        curves: Vec::new(),
    };
    for sampling in Sampling::ALL {
        for method in Method::ALL {
            map.measure(method, sampling);
        }
    }
    map
}

impl Map {
    fn measure(&mut self, method: Method, sampling: Sampling) {
        let (factors, timesteps) = (centres(&self.factors), centres(&self.timesteps));
        let cells = factors.iter().flat_map(|factor| {
            let control = stiffened(*factor).with_method(method);
            let timesteps = timesteps.iter();
            timesteps.map(move |h| control.with_timestep(*h))
        });
        let growth = growths(&cells.collect::<Vec<_>>(), sampling);
        let (mut predicted, mut measured) = (Vec::new(), Vec::new());
        for (factor, growth) in factors.into_iter().zip(growth.chunks(timesteps.len())) {
            let limit = self.row(factor, method, sampling, growth);
            predicted.push((limit, factor));
            let edge = edge(&self.timesteps, growth).filter(|_| limit > 0.0);
            measured.extend(edge.map(|h| {
                let tooltip = format!(
                    "{method}, {}: unstable from {}, predicted {}",
                    sampling.name(),
                    seconds(h),
                    seconds(limit)
                );
                Point::new(h, factor, tooltip)
            }));
        }
        let line = Curve::line(method.name(), predicted);
        self.curves.push(Curve {
            dashed: sampling == Sampling::Continuous,
            ..line
        });
        let marks = Curve::of(method, measured);
        self.curves.push(Curve {
            line: false,
            ..marks
        });
    }

    /// Compares the growths that were measured at one stiffness with the prediction; returns the predicted limit.
    fn row(
        &mut self,
        factor: f64,
        method: Method,
        sampling: Sampling,
        measured: &[Option<f64>],
    ) -> f64 {
        let control = stiffened(factor).with_method(method);
        let linear = Linear::at_setpoint(&control);
        let limit = largest_timestep(&linear, method, sampling).unwrap_or(f64::INFINITY);
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
                continue;
            }
            self.cells += 1;
            self.disagreeing += usize::from(dies_out(growth) != (h < limit));
        }
        limit
    }

    pub(super) fn figure(&self) -> Figure {
        let mut plot = Plot::new(
            "All methods",
            Axis::log_between("timestep", Unit::Seconds, TIMESTEPS.0, TIMESTEPS.1),
            Axis::log_between(
                "stiffness, times the default gains",
                Unit::Number,
                FACTORS.0,
                FACTORS.1,
            ),
        );
        plot.series.clone_from(&self.curves);
        Figure::new(
            "stability-map",
            format!(
                "Predicted and measured stability agree in {} of {} cells; {} change too slowly to judge",
                self.cells - self.disagreeing,
                self.cells,
                self.undecided
            ),
            "2 links at their setpoint, default gains stiffened by a factor (kp by it, kd by its root, ki by its power \
             of 3/2: the same motion, faster). Solid lines: the predicted limit with the effort held for the step, as \
             the live arm has it. Dashed lines: with the law in every stage. Marks: the shortest timestep at which a \
             nudge of the arm itself grew. In the lowest rows the gains are too weak to carry the arm against gravity, \
             and no timestep is stable. A cell counts as too slow to judge if by the prediction its slowest mode \
             changes its energy by less than a factor e in the 4000 steps watched.",
            &Key::methods(),
            &[plot],
        )
    }
}

/// Whether a nudge with this growth of its energy dies out.
fn dies_out(growth: Option<f64>) -> bool {
    growth.is_some_and(|growth| growth < 1.0)
}

/// The edge \[s\] between the last cell from which on to shorter timesteps all nudges die out, and the next one.
fn edge(edges: &[f64], growth: &[Option<f64>]) -> Option<f64> {
    let first = growth.iter().position(|growth| !dies_out(*growth))?;
    edges.get(first).copied().filter(|_| first > 0)
}

/// Whether the watch is too short to tell. By the prediction the slowest mode changes its energy by less than a factor
/// e meanwhile, so that the phase of its swing decides. Measurements have no part in this.
fn undecided(step: &Matrix) -> bool {
    let watched = in_f64(STEPS);
    2.0 * watched * step.spectral_radius().ln().abs() < 1.0
}

//! The largest stable timestep, predicted, measured and mapped over gains, and the velocity noise of encoders.
//!
//! **Invariant:** prediction and measurement share the arm and the gains, and nothing else.

use std::f64::consts::TAU;

use super::fit::{centres, edges};
use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::report::experiments::measure::{self, STEPS, decays, growth, stiffened};
use crate::report::section::{Cell, Section, Table};
use crate::report::svg::{Axis, Curve, Key, Marker, Plot, Point, Unit, number, seconds};
use crate::study::encoder::{largest_kd, velocity_noise};
use crate::study::linear::Linear;
use crate::study::stability::{Sampling, largest_timestep, limits, step_matrix};

pub(super) fn make(section: &mut Section) {
    finding(section);
    map(section);
    encoders(section);
}

/// The limits of the default arm, by its linearised loop.
fn finding(section: &mut Section) {
    let of = |method| limits(&stiffened(1.0).with_method(method));
    let (rk4, verlet) = (of(Method::Rk4), of(Method::Verlet));
    let said = |limit: Option<f64>| seconds(limit.unwrap_or(f64::NAN));
    section.findings.push(format!(
        "**At (0.4, 0.8) with the default gains and an effort held for the step, the 2-link arm is stable up to a \
         timestep of {} with RK4 and {} with Verlet**. The limits are equal because of the hold. They belong to the \
         controller, so a real arm has them too. With the law in every stage RK4 would be stable up to {}. That limit belongs to the \
         simulation. The smallest limit of all poses with held effort is {}.",
        said(rk4.held),
        said(verlet.held),
        said(rk4.continuous),
        said(rk4.minimum_held),
    ));
}

/// Ends of the map's axes: timestep \[s\], factor on the default gains.
const TIMESTEPS: (f64, f64) = (2e-4, 1e-1);
const FACTORS: (f64, f64) = (1e-2, 1e2);

/// Decay or growth of a small deviation, by timestep and stiffness, with the predicted limit.
fn map(section: &mut Section) {
    let columns = section.choose(48, 16);
    let timestep_edges = edges(TIMESTEPS, columns);
    let timesteps = centres(&timestep_edges);
    let factors = centres(&edges(FACTORS, columns * 3 / 4));
    let x = Axis::log("timestep", Unit::Seconds, TIMESTEPS);
    let y = Axis::log("stiffness, times the default gains", Unit::Number, FACTORS);
    let (mut cells, mut disagreeing, mut undecided) = (0, 0, 0);
    let titles = ["Effort held for the step", "Law in every stage"];
    let both = Sampling::ALL.into_iter().zip(titles);
    let panels = both.map(|(sampling, title)| {
        let (mut plot, mut marks) = (Plot::new(title, x.clone(), y.clone()), Vec::new());
        for method in Method::ALL {
            let control = |factor| stiffened(factor).with_method(method);
            let (mut predicted, mut measured) = (Vec::new(), Vec::new());
            for (row, factor) in factors.iter().enumerate() {
                let growth = |h: &f64| growth(&control(*factor).with_timestep(*h), sampling);
                let growth: Vec<Option<f64>> = timesteps.iter().map(growth).collect();
                let linear = Linear::at_setpoint(&control(*factor));
                let limit = largest_timestep(&linear, method, sampling).unwrap_or(f64::INFINITY);
                predicted.push((limit, *factor));
                for (h, growth) in timesteps.iter().zip(&growth) {
                    // The run is too short to judge a cell whose slowest mode changes its energy by less than a factor
                    // e. This decision uses no measurement.
                    let radius = step_matrix(&linear, method, sampling, *h).spectral_radius();
                    if 2.0 * in_f64(STEPS) * radius.ln().abs() < 1.0 {
                        undecided += 1;
                    } else {
                        cells += 1;
                        disagreeing += usize::from(decays(*growth) != (*h < limit));
                    }
                }
                // The edge below the first cell in which a deviation grew. Each method is marked in rows of its own, so
                // that lines and marks stay visible.
                let first = growth.iter().position(|growth| !decays(*growth));
                let edge =
                    first.filter(|first| *first > 0 && limit > 0.0 && row % 4 == method as usize);
                measured.extend(edge.and_then(|first| timestep_edges.get(first)).map(|h| {
                    let note = format!("predicted {}", seconds(limit));
                    Point::new(*h, *factor, note)
                }));
            }
            plot.add(Curve::line(Key::of(method).marked(Marker::None), predicted));
            marks.push(Curve::dots(Key::of(method), measured));
        }
        plot.with(marks)
    });
    let panels: Vec<Plot> = panels.collect();
    section.claim(
        "At most 1 % of the map's cells that can be judged disagree with the prediction",
        format!("{disagreeing} of {cells}; {undecided} more, agreeing or not, change too slowly to judge"),
        disagreeing * 100 <= cells,
    );
    let agreeing = cells - disagreeing;
    section.figure(
        "stability-map",
        &format!(
            "Predicted and measured stability agree in {agreeing} of {cells} cells; {undecided} change too slowly to \
             judge"
        ),
        "2 links at their setpoint (0.4, 0.8), default gains stiffened by a factor (kp by it, kd by its root, ki by its \
         power of 3/2: the same motion, faster). The live arm holds the effort. Lines: the predicted limit. Marks: the smallest timestep at which a \
         small deviation of the arm itself grew, for each method in one of four rows of cells. Methods whose limits \
         are equal have one line. In the lowest rows the gains are too low to hold the arm against gravity, and no \
         timestep of the map is stable. A cell counts as too slow to judge if by the prediction its slowest mode changes its \
         energy by less than a factor e in the 4000 simulated steps.",
        &panels,
    );
}

/// The velocity noise of encoders, predicted and measured.
fn encoders(section: &mut Section) {
    /// Largest standard deviation of the effort for the largest kd \[N m\].
    const EFFORT: f64 = 0.1;
    let periods = section.choose(20_000, 2_000);
    let mut table = Table::new(
        "encoders",
        "Velocity noise of an encoder, and the largest kd",
        "The velocity is the difference of two counts over a control period of 1 ms, the joints are those of a free swing of 2 links from (0.4, -0.3). \
         With fewer than a step per period the noise depends on the speed. The largest kd makes a noise of 0.1 N m of the effort.",
        [
            "bits",
            "step",
            "predicted [rad/s]",
            "measured [rad/s]",
            "largest kd [N m s/rad]",
        ],
    );
    let mut furthest = 0.0_f64;
    for bits in 10..=20_u32 {
        let step = TAU / f64::from(1_u32 << bits);
        let predicted = velocity_noise(step, 0.001);
        let measured = measure::velocity_noise(step, 0.001, periods);
        if bits >= 14 {
            furthest = furthest.max((measured / predicted - 1.0).abs());
        }
        let kd = largest_kd(step, 0.001, EFFORT);
        let cells =
            [f64::from(bits), step, predicted, measured, kd].map(|value| Cell::new(number(value)));
        table.rows.push(cells.into());
    }
    section.table(&table);
    section.claim(
        "Differences of counts are as noisy as predicted (within 5 % from 14 bits on)",
        format!("furthest off {} %", number(100.0 * furthest)),
        furthest < 0.05,
    );
}

//! The largest stable timestep and control period: predicted, measured, mapped over gains, and explained by
//! eigenvalues.
//!
//! **Invariant:** prediction and measurement share the arm and the gains, and nothing else.

use std::f64::consts::TAU;

use super::fit::{centres, edges};
use crate::math::count::{in_f64, length_in_f64};
use crate::math::integrator::Method;
use crate::report::experiments::measure::{
    self, STEPS, decays, growth, growth_per_period, stiffened,
};
use crate::report::section::{Cell, Section, Table};
use crate::report::svg::{Axis, Curve, Key, Marker, Plot, Point, Unit, number, seconds};
use crate::study::control_loop::ControlLoop;
use crate::study::encoder::{largest_kd, velocity_noise};
use crate::study::linear::Linear;
use crate::study::stability::{
    Sampling, Stepping, largest_timestep, limit_held, limits, step_matrix,
};

pub(super) fn make(section: &mut Section) {
    finding(section);
    map(section);
    regions(section);
    control_period(section);
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

/// Timesteps of the eigenvalues, relative to the limit, and their number.
const PARTS: (f64, f64) = (0.05, 1.25);
const SHOWN: u32 = 25;

/// The cause of instability: the eigenvalues of one step as the timestep grows.
fn regions(section: &mut Section) {
    let limited = Method::ALL.into_iter().filter_map(|method| {
        let control = stiffened(1.0).with_method(method);
        Some((control, limit_held(&control)?))
    });
    let circles = limited.map(|(control, limit)| eigenvalues(&control, limit));
    section.figure(
        "regions",
        "Why: beyond the limit one eigenvalue leaves the unit circle",
        &format!(
            "2 links held at (0.4, 0.8) with the default gains: the eigenvalues of one step of the linearised loop, \
             and the unit circle in which it is stable. They are drawn at {SHOWN} timesteps from {} to {} of the \
             limit, and begin near 1. An eigenvalue that leaves the circle on the left flips the arm at every step.",
            PARTS.0, PARTS.1
        ),
        &circles.collect::<Vec<Plot>>(),
    );
}

fn eigenvalues(control: &ControlLoop<2>, limit: f64) -> Plot {
    let method = control.method;
    // Equal scales on both axes.
    let mut plot = Plot::new(
        format!("{method}: stable up to {}", seconds(limit)),
        Axis::linear("real part", (-1.7, 1.7)),
        Axis::linear("imaginary part", (-1.2, 1.2)),
    );
    let angles = (0..=120).map(|part| TAU * f64::from(part) / 120.0);
    let circle = angles.map(|angle| (angle.cos(), angle.sin()));
    plot.add(Curve::line(Key::line("ink", "the unit circle"), circle));
    let linear = Linear::at_setpoint(control);
    let mut points = [Vec::new(), Vec::new()];
    for index in 0..SHOWN {
        let part = PARTS.0 + (PARTS.1 - PARTS.0) * f64::from(index) / f64::from(SHOWN - 1);
        let h = part * limit;
        let values = step_matrix(&linear, method, Sampling::Held, h).eigenvalues();
        let [below, beyond] = &mut points;
        let side = if part <= 1.0 { below } else { beyond };
        let points = values.into_iter();
        side.extend(points.map(|value| Point::new(value.re, value.im, seconds(h))));
    }
    let keys = [
        Key::line("c1", "below the limit").marked(Marker::Circle),
        Key::line("c2", "beyond it").marked(Marker::Square),
    ];
    let dots = keys.into_iter().zip(points);
    plot.with(dots.map(|(key, points)| Curve::dots(key, points)))
}

/// Ends of the axis of control periods \[s\], and the growth up to which curves are drawn.
const PERIODS: (f64, f64) = (5e-4, 2e-2);
const GROWTH: (f64, f64) = (0.85, 1.15);

/// Steps per control period with their legend keys.
const SUBSTEPS: [(u32, &str, &str, Marker); 3] = [
    (1, "1 step per period", "c2", Marker::Square),
    (10, "10 steps per period", "c3", Marker::Triangle),
    (100, "100 steps per period", "c1", Marker::Circle),
];

/// Growth of a small deviation per control period, predicted and measured.
#[derive(Default)]
struct Growth {
    dots: u32,
    /// Largest distance of a dot from its curve, relative to the growth.
    furthest: f64,
    /// Largest distance between the curves of 1, 10 and 100 steps, for methods of order 2 and more.
    apart: f64,
}

fn control_period(section: &mut Section) {
    let dots = section.choose(12, 4);
    let mut growth = Growth::default();
    let panels = Method::ALL.map(|method| growth.panel(method, dots));
    let (dots, furthest) = (growth.dots, growth.furthest);
    let (apart, furthest_percent) = (number(100.0 * growth.apart), number(100.0 * furthest));
    section.claim(
        "A deviation of the arm grows per control period as the spectral radius says (within 0.1 %)",
        format!("furthest off {furthest_percent} % in {dots} measurements with 1, 10 and 100 steps per period"),
        furthest <= 1e-3,
    );
    section.figure(
        "control-period",
        &format!(
            "1, 10 and 100 steps per control period give the same growth to {apart} % from order 2 on; {dots} \
             measurements lie on their curves to {furthest_percent} %"
        ),
        "2 links at (0.4, 0.8), default gains, effort held over the period. Curves: spectral radius of one control period of the \
         linearised loop. Dots: the growth of a small deviation of the arm itself per period, over 4000 periods. The \
         limit of the control period is where a curve first crosses 1. From order 2 on shorter steps hardly change it. With \
         Euler the growth depends on the steps per period.",
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

impl Growth {
    fn panel(&mut self, method: Method, dots: usize) -> Plot {
        let control = stiffened(1.0).with_method(method);
        let linear = Linear::at_setpoint(&control);
        let x = Axis::log("control period", Unit::Seconds, PERIODS);
        let y = Axis::linear("growth per control period", GROWTH);
        let mut plot = Plot::new(method.name(), x, y);
        let limit = Key::line("ink", "unstable above").dashed();
        let ends = [PERIODS.0, PERIODS.1].map(|period| (period, 1.0));
        plot.add(Curve::line(limit, ends));
        for (turn, (substeps, label, class, marker)) in (0..).zip(SUBSTEPS) {
            let predicted = |substeps, period| {
                let stepping = Stepping::held(&linear, method, substeps, 0);
                stepping.matrix(period).spectral_radius()
            };
            let curve = edges(PERIODS, 200).into_iter();
            let curve = curve.map(|period| (period, predicted(substeps, period)));
            let key = Key::line(class, label).marked(marker);
            let is_shown = |growth: f64| growth <= GROWTH.1;
            plot.add(Curve::line(
                key.clone().marked(Marker::None),
                curve.filter(|it| is_shown(it.1)),
            ));
            // The dots alternate along the curves, so that no mark hides another. They are denser where the curve
            // rises.
            let even = edges(PERIODS, 3 * dots).into_iter().skip(turn).step_by(3);
            let limit = Stepping::held(&linear, method, substeps, 0).limit();
            let around = [0.985, 0.995, 1.005, 1.015, 1.03, 1.045];
            let steep =
                around.map(|part| limit.unwrap_or(f64::NAN) * (part + 0.002 * length_in_f64(turn)));
            let mut points = Vec::new();
            for period in even
                .take(dots)
                .chain(steep)
                .filter(|period| is_shown(predicted(substeps, *period)))
            {
                let expected = predicted(substeps, period);
                let measured = growth_per_period(&control.with_timestep(period), substeps);
                let measured = measured.unwrap_or(f64::INFINITY);
                if method != Method::Euler {
                    self.apart = self
                        .apart
                        .max((expected / predicted(1, period) - 1.0).abs());
                }
                self.dots += 1;
                self.furthest = self.furthest.max((measured / expected - 1.0).abs());
                let note = format!("{measured:.5} measured, {expected:.5} predicted");
                points.push(Point::new(period, measured, note));
            }
            plot.add(Curve::dots(key, points));
        }
        plot
    }
}

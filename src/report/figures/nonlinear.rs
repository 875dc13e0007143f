//! Stability beyond small deviations: by amplitude of a move, by speed of a swing, and beside a periodic swing.
//!
//! **Invariant:** every cell is measured. Predictions are drawn over the cells, and no cell is interpolated.

use super::fit::{centres, edges};
use crate::math::arm::{Arm, State};
use crate::math::integrator::Method;
use crate::report::experiments::nonlinear::{PeriodicSwing, arrives, is_carried, move_of, spun};
use crate::report::section::Section;
use crate::report::svg::{Axis, Curve, Key, Marker, Plot, Unit, number};
use crate::study::control_loop::ControlLoop;
use crate::study::motion::Motion;
use crate::study::stability::{ADVISED_PART, bisect, limit_held, limits};

/// A kind of motion: its name, its second axis, and the ends of the axes (timestep \[s\], amplitude or speed).
struct Kind {
    name: &'static str,
    label: &'static str,
    steps: (f64, f64),
    values: (f64, f64),
}

const MOVES: Kind = Kind {
    name: "move",
    label: "turn of the first joint [rad]",
    steps: (5e-4, 2e-2),
    values: (0.1, 100.0),
};
const SWINGS: Kind = Kind {
    name: "free swing",
    label: "spin of the first joint [rad/s]",
    steps: (1e-3, 0.5),
    values: (0.3, 300.0),
};

pub(super) fn make(section: &mut Section) {
    let columns = section.choose(32, 12);
    let mut panels = Vec::new();
    // Moves are limited by the pose with the smallest limit, and by their own speed.
    let moved = map(&MOVES, columns, &mut panels, |method| {
        let smallest = limits(&move_of(1.0, method, 1e-3)).trusted();
        let predicted = move |amplitude| {
            let motion = Motion::ahead(&move_of(amplitude, method, 1e-3), &State::rest());
            motion.timestep.min(smallest.unwrap_or(f64::INFINITY))
        };
        let holds = move |amplitude, h| arrives(&move_of(amplitude, method, h));
        (predicted, holds)
    });
    // Free swings are limited by the frequency of small swings, and by their speed. If small swings grow under a method
    // at every timestep, only the speed limits it: in four seconds that growth is small.
    let carried = map(&SWINGS, columns, &mut panels, |method| {
        let free = ControlLoop::free(Arm::<2>::default()).with_method(method);
        let small = limit_held(&free).filter(|limit| *limit > 0.0);
        let predicted = move |spin| {
            let motion = Motion::ahead(&free, &spun(spin));
            motion.timestep.min(small.unwrap_or(f64::INFINITY))
        };
        let holds = move |spin, h| is_carried(&free.with_timestep(h), spun(spin));
        (predicted, holds)
    });
    let swings = "swings of every speed keep their energy to a factor of two for 4 s";
    for (motions, (cells, lost)) in [
        ("moves of every amplitude arrive", moved),
        (swings, carried),
    ] {
        section.claim(
            format!("Within {ADVISED_PART} of the predicted limit {motions} (in 98 of 100 cells)"),
            format!("{} of {cells} cells", cells - lost),
            cells > 0 && 50 * lost <= cells,
        );
    }
    floquet(section);
    section.figure(
        "nonlinear-map",
        "Beyond small deviations the timestep is limited by speed",
        "Moves: 2 links under the default gains, from rest on the horizontal; the second joint turns by -0.75 times as \
         much. Pale: both joints are within 0.02 rad of the setpoint after 6 s; dark: they are not. Swings: free, from \
         (0, 0.5) with the first joint spinning. Dark: the energy above the hanging arm's doubles or halves within 4 s. \
         Line: the smaller of two limits. One is that by linearisation (moves: the least of all poses; swings: of small \
         swings, where there is one). The other is timestep_limit_motion of /study/stability.",
        &panels,
    );
}

/// A panel for each method, for which `measure` has two functions of the kind's value: the predicted limit \[s\], and
/// whether a timestep holds. Returns how many cells lie within the advised part of the limit, and how many of them
/// fail.
fn map<P: Fn(f64) -> f64, H: Fn(f64, f64) -> bool>(
    kind: &Kind,
    columns: usize,
    panels: &mut Vec<Plot>,
    measure: impl Fn(Method) -> (P, H),
) -> (usize, usize) {
    let mut counts = (0, 0);
    let [steps, values] = [kind.steps, kind.values].map(|ends| centres(&edges(ends, columns)));
    for method in Method::ALL {
        let (predicted, holds) = measure(method);
        let (mut line, mut cells) = (Vec::new(), [Vec::new(), Vec::new()]);
        for value in &values {
            let limit = predicted(*value);
            if limit <= kind.steps.1 {
                line.push((limit, *value));
            }
            for h in &steps {
                let holds = holds(*value, *h);
                if *h <= ADVISED_PART * limit {
                    counts.0 += 1;
                    counts.1 += usize::from(!holds);
                }
                let [lost, carried] = &mut cells;
                (if holds { carried } else { lost }).push((*h, *value));
            }
        }
        let plot = Plot::new(
            format!("{method}, {}", kind.name),
            Axis::log("timestep", Unit::Seconds, kind.steps),
            Axis::log(kind.label, Unit::Number, kind.values),
        );
        let keys = [("no", "does not"), ("yes", "arrives, or keeps its energy")];
        let cells = keys.into_iter().zip(cells).map(|((class, label), cells)| {
            Curve::cells(Key::line(class, label).marked(Marker::Square), cells)
        });
        let line = Curve::line(Key::line("ink", "predicted limit"), line);
        panels.push(plot.with(cells.chain([line])));
    }
    counts
}

/// Steps of order 4 per period, with which the multipliers are practically exact.
const TRUE_STEPS: u32 = 4096;

/// A multiplier beyond this is unstable. A double multiplier on the unit circle has an error of the square root of the
/// rounding error.
const UNSTABLE: f64 = 1.001;

/// The amplitude up to which a deviation from a periodic swing stays small, by the Floquet multipliers.
fn floquet(section: &mut Section) {
    /// Amplitudes of the swings \[rad\].
    const SWINGS: [f64; 9] = [0.1, 0.3, 0.6, 0.9, 1.2, 1.5, 1.8, 1.9, 2.0];
    let multiplier_at =
        |amplitude| Some(PeriodicSwing::of(amplitude)?.transverse(Method::Rk4, TRUE_STEPS));
    let multipliers = SWINGS.map(multiplier_at);
    let is_unstable = |multiplier: &Option<f64>| multiplier.is_some_and(|it| it > UNSTABLE);
    let first = multipliers.iter().position(is_unstable);
    let ends =
        first.and_then(|first| Some((SWINGS.get(first.checked_sub(1)?)?, SWINGS.get(first)?)));
    let swing = "**The slow periodic swing of the free 2-link arm is stable";
    section.findings.push(match (ends, SWINGS.last().zip(multipliers.last().copied().flatten())) {
        (Some((stable, unstable)), Some((last, multiplier))) => {
            let stable = bisect((*stable, *unstable), 4, |amplitude| {
                multiplier_at(amplitude).is_some_and(|it| it <= UNSTABLE)
            });
            format!(
                "{swing} up to {} rad at the first joint**. In it both links turn to the same side. A \
                 deviation grows {}-fold in a period at {} rad, so there no method is accurate for long.",
                number((100.0 * stable).floor() / 100.0),
                number(multiplier),
                number(*last),
            )
        }
        _ => format!("{swing} at every amplitude that was tried**."),
    });
}

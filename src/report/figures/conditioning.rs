//! Digits lost by mass ratio.
//!
//! **Invariant:** the truth behind the digits is known to at least ten more of them.

use crate::report::csv::Csv;
use crate::report::experiments::conditioning::{Lost, PoseShape, digits_lost};
use crate::report::making::Making;
use crate::report::section::{Block, Figure, Section, Verdict};
use crate::report::svg::{Axis, Curve, Key, Marker, Plot, Point, Unit, number, power};

/// Digits that the recursion may lose at worst.
const ALLOWED: f64 = 2.5;

/// The panel of folded arms.
const FOLDED: &str = "3 links, folded back once";

type Column = (f64, Lost);

pub(super) fn make(making: &mut Making<'_>) -> Section {
    let count = making.choose(400, 60);
    let mut csv = Csv::new(
        "pose,mass_ratio,recursion_median,recursion_worst,dense_median,dense_worst,inherent_median,inherent_worst",
    );
    let mut panels: Vec<(&str, Vec<Column>)> = Vec::new();
    for (title, pose) in [
        ("3 links, bent", PoseShape::Bent),
        ("3 links, stretched", PoseShape::Stretched),
        (FOLDED, PoseShape::Folded),
    ] {
        let mut columns = Vec::new();
        for exponent in -9..=9 {
            let ratio = 10_f64.powi(exponent);
            let Some(lost) = digits_lost(ratio, pose, count) else {
                continue;
            };
            csv.row(&[
                title.into(),
                ratio.into(),
                lost.recursion.0.into(),
                lost.recursion.1.into(),
                lost.dense.0.into(),
                lost.dense.1.into(),
                lost.inherent.0.into(),
                lost.inherent.1.into(),
            ]);
            columns.push((ratio, lost));
        }
        panels.push((title, columns));
    }
    making.keep("conditioning", csv);
    let (folded, others): (Vec<_>, Vec<_>) = panels
        .iter()
        .cloned()
        .partition(|(title, _)| *title == FOLDED);
    let worst = largest(&others, |lost| lost.recursion.1);
    let dense = largest(&panels, |lost| lost.dense.1);
    let lost_folded = largest(&folded, |lost| lost.recursion.1);
    let own = largest(&panels, |lost| lost.recursion.1 - lost.inherent.1);
    Section {
        findings: vec![format!(
            "**With a last link 10⁹ times lighter or heavier than the others bent and stretched arms lose at most {} \
             of 16 digits**; with the second link folded back onto the first, up to {}, of \
             which at most {} are the arm's own: the rest lies in the angles' last bits. Eliminating the mass matrix \
             loses up to {}.",
            number(worst),
            number(lost_folded),
            number(own.max(0.0)),
            if dense.is_finite() {
                number(dense)
            } else {
                "all".to_owned()
            }
        )],
        verdicts: verdicts(worst, own, count),
        blocks: vec![Block::Figure(figure(&panels, worst))],
        ..Section::default()
    }
}

fn verdicts(worst: f64, own: f64, count: u32) -> Vec<Verdict> {
    vec![
        Verdict {
            claim: format!(
                "In none of these poses are more than {ALLOWED} digits lost beyond those that lie in the angles' last \
                 bits"
            ),
            seen: format!("at worst {} digits beyond", number(own.max(0.0))),
            holds: own <= ALLOWED,
        },
        Verdict {
            claim: format!(
                "Accelerations lose at most {ALLOWED} digits at mass ratios from 10⁻⁹ to 10⁹, bent and stretched"
            ),
            seen: format!(
                "at worst {} digits in {} states",
                number(worst),
                2 * 19 * count
            ),
            holds: worst <= ALLOWED,
        },
    ]
}

fn largest(panels: &[(&str, Vec<Column>)], of: impl Fn(&Lost) -> f64) -> f64 {
    let all = panels.iter().flat_map(|(_, columns)| columns);
    // A failed elimination gives NaN: everything is lost.
    all.map(|(_, lost)| of(lost)).fold(0.0, |worst, value| {
        if value <= worst {
            worst
        } else if value.is_nan() {
            f64::INFINITY
        } else {
            value
        }
    })
}

fn figure(panels: &[(&str, Vec<Column>)], worst: f64) -> Figure {
    let plots: Vec<Plot> = panels
        .iter()
        .map(|(title, columns)| {
            let x = Axis::log_between(
                "mass of the last link / mass of the others",
                Unit::Number,
                1e-9,
                1e9,
            );
            let y = Axis::linear("digits lost, of 16", 0.0, 12.0);
            let mut plot = Plot::new(*title, x, y);
            let mut add = |class, marker, dashed, of: fn(&Lost) -> f64| {
                let points = columns.iter().map(|(ratio, lost)| {
                    let digits = of(lost);
                    Point::new(
                        *ratio,
                        digits,
                        format!(
                            "{}: {} digits",
                            power(ratio.log10().round()),
                            number(digits)
                        ),
                    )
                });
                plot.series.push(Curve {
                    class,
                    marker,
                    line: true,
                    dashed,
                    points: points.collect(),
                });
            };
            add("c2", Marker::Square, false, |lost| lost.dense.1);
            add("soft", Marker::None, true, |lost| lost.inherent.1);
            add("c1", Marker::Diamond, false, |lost| lost.recursion.1);
            plot
        })
        .collect();
    let key = |class, marker, dashed, label: &str| Key {
        class,
        marker,
        dashed,
        label: label.to_owned(),
    };
    Figure::new(
        "conditioning",
        format!(
            "Bent and stretched, the recursion loses at most {} digits where eliminating the mass matrix loses most of \
             them",
            number(worst)
        ),
        "Worst of all sampled states. The dashed line is what the last bit of an angle changes by itself: no way of \
         solving can be asked for more. Crosses at the top: elimination failed.",
        &[
            key("c1", Marker::Diamond, false, "this arm's recursion"),
            key("c2", Marker::Square, false, "elimination of M(q)"),
            key("soft", Marker::None, true, "inherent"),
        ],
        &plots,
    )
}

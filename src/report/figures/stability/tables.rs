//! The tables: every limit, and where it goes unstable at a glance.
//!
//! **Invariant:** prediction and measurement stand beside each other.

use super::line::{AGREEMENT, LimitRow, in_words};
use crate::math::integrator::Method;
use crate::report::section::{Cell, Table, by_method};
use crate::report::svg::seconds;
use crate::study::stability::Sampling;

pub(super) fn table(lines: &[LimitRow]) -> Table {
    let mut table = Table::new(
        "limits",
        "Largest stable timesteps",
        "Predicted from the loop linearised where it rests, at (0.4, 0.8), with 3 links (0.4, 0.8, -0.5), measured by \
         nudging the arm itself and watching whether it settles; the smallest limit of all poses, bounded where it can \
         be, and 0.8 times that as advice. Prediction and measurement must agree to 1 %.",
        &[
            "Links",
            "Gains",
            "Method",
            "Control",
            "Predicted",
            "Measured",
            "Measured / predicted",
            "Over all poses",
            "Advised",
        ],
    );
    for line in lines {
        let time = |limit: Option<f64>| {
            limit.map_or_else(|| Cell::new("–"), |limit| Cell::new(seconds(limit)))
        };
        let ratio = line.ratio();
        let good = ratio.is_some_and(|ratio| (ratio - 1.0).abs() <= AGREEMENT);
        table.rows.push(vec![
            Cell::new(line.links.to_string()),
            Cell::new(line.gains),
            Cell::method(line.method),
            Cell::new(in_words(line.sampling)),
            Cell::new(seconds(line.predicted)),
            line.measured.map_or_else(
                || Cell::new("none found").class("bad"),
                |measured| Cell::new(seconds(measured)),
            ),
            ratio.map_or_else(Cell::default, |ratio| {
                Cell::new(format!("{ratio:.5}")).class(if good { "good" } else { "bad" })
            }),
            time(line.over_poses),
            time(line.advised),
        ]);
    }
    table
}

pub(super) fn edges(lines: &[LimitRow]) -> Table {
    let mut table = Table::new(
        "edges",
        "At a glance: where it goes unstable, and why",
        "Largest stable timestep with the default gains at (0.4, 0.8), with 3 links at (0.4, 0.8, -0.5): elsewhere it \
         is another. Held for the step, the limit belongs to the control period: the effort answers a state that is \
         up to a step old. In every stage it belongs to the method.",
        &by_method(&["Arm", "Control"], &["Why"]),
    );
    for links in [2, 3] {
        for sampling in Sampling::ALL {
            let of = |method| {
                lines.iter().find(|line| {
                    line.links == links
                        && line.gains == "default"
                        && line.sampling == sampling
                        && line.method == method
                })
            };
            let mut row = vec![
                Cell::new(format!("{links} links, default gains")),
                Cell::new(in_words(sampling)),
            ];
            for method in Method::ALL {
                row.push(match of(method) {
                    Some(line) => {
                        let measured = line.measured.map_or_else(
                            || "not measured".to_owned(),
                            |m| format!("measured {}", seconds(m)),
                        );
                        Cell::new(seconds(line.predicted)).detail(measured)
                    }
                    None => Cell::new("none").class("bad"),
                });
            }
            row.push(Cell::new(match sampling {
                Sampling::Held => "the control period: damping answers too late",
                Sampling::Continuous => "the method's stability region",
            }));
            table.rows.push(row);
        }
    }
    table
}

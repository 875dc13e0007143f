//! The largest stable timestep: predicted, measured, mapped over gains, and what it hangs on.
//!
//! **Invariant:** prediction and measurement share the arm and the gains, and nothing else.

mod line;
mod map;
mod period;
mod regions;
mod tables;
mod words;

use line::LimitRow;
use map::map;
use period::{growth, period_table, periods};
use regions::regions_figure;
use tables::{edges, table};
use words::{findings, verdicts};

use crate::math::arm::Arm;
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};
use crate::report::experiments::measure::{measured_limit, stiffened};
use crate::report::making::Making;
use crate::report::section::{Block, Section};
use crate::study::control_loop::ControlLoop;
use crate::study::stability::{Sampling, limits};

pub(super) fn make(making: &mut Making<'_>) -> Section {
    let cells = making.choose(48, 16);
    let mut lines = Vec::new();
    for (name, gains) in gains_two() {
        lines_of(
            &mut lines,
            name,
            &ControlLoop::new(Arm::default(), gains, Setpoint::at([0.4, 0.8])),
        );
    }
    for (name, gains) in gains_three() {
        lines_of(
            &mut lines,
            name,
            &ControlLoop::new(Arm::default(), gains, Setpoint::at([0.4, 0.8, -0.5])),
        );
    }
    let map = map(cells);
    making.keep("stability-map", map.csv.clone());
    let periods = periods(making);
    let (regions, csv) = regions_figure(&stiffened(1.0));
    making.keep("regions", csv);
    let growth = growth(making);
    making.keep("control-period", growth.csv.clone());
    Section {
        findings: findings(&lines),
        verdicts: verdicts(&lines, &map, &periods, &growth),
        blocks: vec![
            Block::Table(edges(&lines)),
            Block::Figure(map.figure()),
            Block::Figure(regions),
            Block::Figure(growth.figure()),
            Block::Table(table(&lines)),
            Block::Table(period_table(&periods)),
        ],
        ..Section::default()
    }
}

fn gains<const N: usize>(kp: [f64; N], kd: [f64; N]) -> Gains<N> {
    Gains {
        kp,
        ki: [0.0; N],
        kd,
    }
}

fn gains_two() -> [(&'static str, Gains<2>); 4] {
    [
        ("mild", gains([200.0, 100.0], [30.0, 12.0])),
        ("default", Gains::<2>::default()),
        ("stiff", gains([1e4, 1e4], [200.0, 60.0])),
        ("overdamped", gains([200.0, 200.0], [500.0, 500.0])),
    ]
}

fn gains_three() -> [(&'static str, Gains<3>); 3] {
    [
        ("default", Gains::<3>::default()),
        ("stiff", gains([1e4; 3], [300.0, 100.0, 30.0])),
        ("overdamped", gains([200.0; 3], [500.0; 3])),
    ]
}

fn lines_of<const N: usize>(
    lines: &mut Vec<LimitRow>,
    name: &'static str,
    control: &ControlLoop<N>,
) {
    for method in Method::ALL {
        let control = control.with_method(method);
        let limits = limits(&control);
        for sampling in Sampling::ALL {
            let (predicted, over_poses) = match sampling {
                Sampling::Held => (limits.held, limits.minimum_held),
                Sampling::Continuous => (limits.continuous, limits.minimum_continuous),
            };
            let Some(predicted) = predicted.filter(|limit| *limit > 0.0) else {
                continue;
            };
            lines.push(LimitRow {
                links: N,
                gains: name,
                method,
                sampling,
                predicted,
                measured: measured_limit(&control, sampling, predicted),
                over_poses,
                advised: limits.advised.filter(|_| sampling == Sampling::Held),
            });
        }
    }
}

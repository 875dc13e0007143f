//! Error against time and timestep, in every scene and for every method.
//!
//! **Invariant:** every time stands beside the error of the same steps; runs that are lost are drawn as lost.

mod data;
mod plots;
mod tables;
mod words;

use data::{Data, Run};
use plots::{against_time, against_timestep};
use tables::{cheapest, orders, scene_list, table_of_runs};
use words::{findings, verdicts};

use crate::math::integrator::Method;
use crate::report::experiments::error::{OUTPUTS, scenes};
use crate::report::making::Making;
use crate::report::section::{Block, Section};
use crate::report::timing::{Effort, time};

pub(super) fn make(making: &mut Making<'_>) -> Section {
    let data = compute(making);
    let runs = table_of_runs(&data);
    making.keep("work-precision-time", runs.clone());
    making.keep("convergence", runs);
    Section {
        findings: findings(&data),
        verdicts: verdicts(&data),
        blocks: vec![
            Block::Table(cheapest(&data)),
            Block::Figure(against_time(&data)),
            Block::Figure(against_timestep(&data)),
            Block::Table(orders(&data)),
            Block::Table(scene_list(&data)),
        ],
        ..Section::default()
    }
}

fn compute(making: &mut Making<'_>) -> Vec<Data> {
    let halvings = making.choose(15, 9);
    let effort = making.choose(
        Effort {
            least: 3,
            most: 25,
            seconds: 0.05,
        },
        Effort {
            least: 3,
            most: 7,
            seconds: 0.01,
        },
    );
    let mut data = Vec::new();
    for scene in scenes() {
        let mut runs = Vec::new();
        for halving in 0..=halvings {
            let steps = OUTPUTS << halving;
            if steps > scene.most_steps() {
                continue;
            }
            for method in Method::ALL {
                runs.push(Run {
                    method,
                    outcome: scene.run(method, steps),
                    timing: time(effort, || scene.replay(method, steps)),
                });
            }
        }
        data.push(Data::new(scene, runs, effort));
    }
    data
}

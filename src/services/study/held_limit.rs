//! `/study/held_limit`: the largest stable control period of any robot near a pose, from its mass matrix and its gains.
//!
//! It does not depend on the arm.
//!
//! **Invariant:** a loop has at most [`MAX_STATES`] states, so that a piece takes about a millisecond.

use bytes::Bytes;

use super::{Computed, NUMBER_BYTES, Present, StudyWork};
use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::protocol::wire::json;
use crate::services::{Address, Ask};
use crate::study::held_loop::{Between, Given, HeldError, HeldLimit, HeldLoop, held_limit};
use crate::study::held_loop::{MAX_DELAY, MAX_STEPS};
use crate::study::paused::Paused;

/// Most states of a loop.
const MAX_STATES: usize = 48;

/// Most entries of a matrix: 16 joints.
const MOST_ENTRIES: usize = 256;

/// Matrices of the largest loop that exist at once, at most.
const MATRICES: usize = 40;

/// Finds the largest stable control period. One bad field rejects the whole request.
#[derive(Debug, Clone)]
pub struct FindHeldLimit {
    given: Given,
    period: Option<f64>,
}

impl Ask for FindHeldLimit {
    type Answer = Result<Box<HeldLimit>, HeldError>;

    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let mass = matrix(&mut fields, "mass_matrix");
        let joints = mass.len().isqrt();
        if joints * joints != mass.len() {
            fields.refuse(
                "mass_matrix",
                &format_args!("must have n² entries, got {}", mass.len()),
            );
        }
        let mut rows = |name| by_joint(matrix(&mut fields, name), mass.len());
        let (kp, kd, ki) = (rows("kp"), rows("kd"), rows("ki"));
        let (damping, stiffness) = (rows("damping"), rows("stiffness"));
        let ask = Self {
            period: fields.number("period", Bound::Positive),
            given: Given {
                kp,
                kd,
                ki,
                damping,
                stiffness,
                delay: fields.count("delay", 0..=MAX_DELAY).unwrap_or(0),
                between: fields
                    .choice("between", &Between::NAMES, |name| name)
                    .and_then(Between::named)
                    .unwrap_or(Between::Exact),
                steps: fields.count("steps", 1..=MAX_STEPS).unwrap_or(1),
                mass: by_row(&mass),
            },
        };
        fields.accept(ask)
    }

    fn write(answer: Result<Box<HeldLimit>, HeldError>, to: &Address) -> Bytes {
        to.outcome(answer.as_ref().map(|limit| {
            let critical = limit.critical.as_ref().map(|critical| {
                object! {
                    growth_per_period: critical.growth_per_period,
                    frequency: critical.frequency,
                    joint: critical.joint,
                    mode: critical.mode.as_slice(),
                    reverses: critical.reverses,
                }
            });
            let at = limit.at.as_ref();
            object! {
                period_limit: limit.period_limit,
                critical: critical,
                effective_inertia: limit.effective_inertia.as_slice(),
                stable: at.map(|at| at.is_stable),
                growth_per_period: at.map(|at| at.growth_per_period),
                timestep_limit: at.and_then(|at| at.timestep_limit),
                kd_factor_limit: at.and_then(|at| at.kd_factor),
                armature: at.and_then(|at| at.armature),
                explanation: limit.explanation.as_str(),
            }
        }))
    }
}

/// The numbers of a matrix, row by row. Each row may be an array of its own. A number that is not finite is refused with
/// the others.
fn matrix(fields: &mut Fields<'_>, name: &'static str) -> Vec<f64> {
    let mut entries = fields.entries(name, MOST_ENTRIES).unwrap_or_default();
    if entries
        .first()
        .is_some_and(|raw| raw.get().starts_with('['))
    {
        let joints = entries.len();
        let row = |raw| json::entries(raw, joints).filter(|row| row.count == joints);
        let rows: Option<Vec<_>> = entries.into_iter().map(row).collect();
        match rows.filter(|_| joints * joints <= MOST_ENTRIES) {
            Some(rows) => entries = rows.into_iter().flat_map(|row| row.first).collect(),
            None => {
                let most = MOST_ENTRIES.isqrt();
                let reason = format!("must have n rows of n numbers, n at most {most}");
                fields.refuse(name, &reason);
                return vec![];
            }
        }
    }
    let numbers: Option<Vec<f64>> = entries.into_iter().map(json::number).collect();
    if numbers.is_none() {
        fields.refuse(name, &"must be an array of numbers");
    }
    numbers.unwrap_or_default()
}

/// The rows of a square matrix.
fn by_row(numbers: &[f64]) -> Vec<Vec<f64>> {
    let joints = numbers.len().isqrt();
    numbers.chunks(joints.max(1)).map(<[f64]>::to_vec).collect()
}

/// The same for a matrix that may be absent, a single number, or a number for each joint. A whole matrix has this number of
/// `entries`.
fn by_joint(numbers: Vec<f64>, entries: usize) -> Vec<Vec<f64>> {
    match numbers.len() {
        0 => vec![],
        given if given == entries => by_row(&numbers),
        _ => vec![numbers],
    }
}

impl<const N: usize> Computed<N> for FindHeldLimit {
    type Work = StudyWork<Self::Answer>;

    fn work(self, _: Present<N>) -> Self::Work {
        let search = async move {
            let held = HeldLoop::try_from(&self.given)?.within(MAX_STATES)?;
            Ok(Box::new(held_limit(held, self.period).await))
        };
        StudyWork {
            most_bytes: MATRICES * MAX_STATES * MAX_STATES * size_of::<f64>()
                + 4 * MAX_STATES * NUMBER_BYTES,
            computation: Paused::new(search),
        }
    }
}

//! The matrices of a held loop as they are given, and their faults.
//!
//! **Invariant:** every accepted loop has a positive definite mass matrix and finite entries.

use super::{Between, HeldLoop, Matrices};
use crate::math::shown::{Shown, shown_against};
use crate::study::matrix::Matrix;

/// Most joints.
pub const MAX_JOINTS: usize = 64;

/// Most whole periods by which an effort may be late.
pub const MAX_DELAY: u64 = 8;

/// Most steps in a control period.
pub const MAX_STEPS: u64 = 1_000_000;

/// Most states: positions, velocities, efforts on their way, integrals.
pub const MAX_STATES: usize = 256;

/// Largest relative difference of two entries of a symmetric matrix that are equal but for rounding.
const SYMMETRIC: f64 = 1e-9;

/// A held loop as rows of numbers. Apart from `mass`, a matrix may be empty for zero, one number for each joint, or one
/// row of n numbers for a diagonal.
#[derive(Debug, Clone, PartialEq)]
pub struct Given {
    /// Mass matrix at the pose \[kg m²\].
    pub mass: Vec<Vec<f64>>,
    /// Proportional gains \[N m/rad\].
    pub kp: Vec<Vec<f64>>,
    /// Derivative gains \[N m s/rad\].
    pub kd: Vec<Vec<f64>>,
    /// Integral gains \[N m/(rad s)\].
    pub ki: Vec<Vec<f64>>,
    /// Damping of the joints \[N m s/rad\].
    pub damping: Vec<Vec<f64>>,
    /// Stiffness of springs and gravity \[N m/rad\].
    pub stiffness: Vec<Vec<f64>>,
    /// Whole periods by which an effort is late.
    pub delay: u64,
    /// The motion between two runs of the law.
    pub between: Between,
    /// Steps of a method in a period.
    pub steps: u64,
}

/// Why a loop is not accepted, in words. Rows and columns are counted from 0.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct HeldError(String);

impl HeldError {
    /// For a period that is not a length of time.
    pub fn period(period: f64) -> Self {
        Self(format!(
            "period must be finite and greater than 0, got {}",
            Shown(period)
        ))
    }
}

impl TryFrom<&Given> for HeldLoop {
    type Error = HeldError;

    fn try_from(given: &Given) -> Result<Self, HeldError> {
        let n = given.mass.len();
        if !(1..=MAX_JOINTS).contains(&n) {
            let why = format!("M must have 1 to {MAX_JOINTS} rows, got {n}");
            return Err(HeldError(why));
        }
        let (delay, steps) = (given.delay, given.steps);
        if delay > MAX_DELAY {
            let why = format!("delay must be 0 to {MAX_DELAY} periods, got {delay}");
            return Err(HeldError(why));
        }
        if !(1..=MAX_STEPS).contains(&steps) {
            let why = format!("steps must be 1 to {MAX_STEPS}, got {steps}");
            return Err(HeldError(why));
        }
        let mass = symmetric(&full("M", &given.mass, n)?)?;
        let either = |name, rows: &Vec<Vec<f64>>| matrix(name, rows, n);
        let (kp, kd) = (either("kp", &given.kp)?, either("kd", &given.kd)?);
        let ki = either("ki", &given.ki)?;
        let damping = either("damping", &given.damping)?;
        let stiffness = either("stiffness", &given.stiffness)?;
        let matrices = Matrices {
            mass,
            kp,
            kd,
            ki,
            damping,
            stiffness,
        };
        let held = Self {
            // Both are in range.
            delay: u8::try_from(delay).unwrap_or_default(),
            steps: u32::try_from(steps).unwrap_or(1),
            between: given.between.clone(),
            ..Self::new(matrices).map_err(|joint| {
                HeldError(format!(
                    "M must be positive definite: it has no inertia left at joint[{joint}]"
                ))
            })?
        };
        held.within(MAX_STATES)
    }
}

impl HeldLoop {
    /// The loop, if it has at most so many states.
    ///
    /// # Errors
    /// It has more.
    pub fn within(self, most: usize) -> Result<Self, HeldError> {
        let got = self.states();
        if got > most {
            return Err(HeldError(format!(
                "the loop must have at most {most} states, got {got}: 2 for each joint, 1 for each integral, 1 for each \
                 joint and period of delay"
            )));
        }
        Ok(self)
    }
}

/// A matrix given as rows, as a diagonal, as one number for each joint, or as nothing.
fn matrix(name: &'static str, rows: &[Vec<f64>], n: usize) -> Result<Matrix, HeldError> {
    let diagonal = match rows {
        [] => vec![0.0; n],
        [row] if row.len() == 1 => vec![row[0]; n],
        [row] if row.len() == n => row.clone(),
        _ => return full(name, rows, n),
    };
    let rows = |i| (0..n).map(move |j| if i == j { diagonal[j] } else { 0.0 });
    full(
        name,
        &(0..n)
            .map(|i| rows.clone()(i).collect())
            .collect::<Vec<_>>(),
        n,
    )
}

fn full(name: &'static str, rows: &[Vec<f64>], n: usize) -> Result<Matrix, HeldError> {
    if rows.len() != n || rows.iter().any(|row| row.len() != n) {
        let or = match name {
            "M" => "",
            _ => ", or one number for each joint, or one for all",
        };
        let why = format!("{name} must have {n} rows of {n} numbers, as M has rows{or}");
        return Err(HeldError(why));
    }
    for (row, column) in (0..n).flat_map(|row| (0..n).map(move |column| (row, column))) {
        let value = rows[row][column];
        if !value.is_finite() {
            let why = format!("{name} must be finite: {name}[{row}][{column}] is {value}");
            return Err(HeldError(why));
        }
    }
    Ok(Matrix::from_fn(n, |row, column| rows[row][column]))
}

/// The mean of a matrix and its mirror image.
fn symmetric(mass: &Matrix) -> Result<Matrix, HeldError> {
    let n = mass.size();
    for (row, column) in (0..n).flat_map(|row| (0..row).map(move |column| (row, column))) {
        let (one, other) = (mass[(row, column)], mass[(column, row)]);
        if (one - other).abs() > SYMMETRIC * one.abs().max(other.abs()) {
            return Err(HeldError(format!(
                "M must be symmetric: M[{row}][{column}] is {}, M[{column}][{row}] is {}",
                shown_against(one, other),
                shown_against(other, one)
            )));
        }
    }
    Ok(Matrix::from_fn(n, |i, j| {
        0.5 * (mass[(i, j)] + mass[(j, i)])
    }))
}

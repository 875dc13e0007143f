//! The steps of a batch, with checks for signals.
//!
//! **Invariant:** a signal's handler that reads or changes the arms never waits, because it runs between two pieces.

use std::sync::Mutex;

use pendularm::math::simulation::Simulation;
use pyo3::prelude::{PyResult, Python};
use rayon::ThreadPool;

use super::lanes::{self, Piece};
use super::windows::Windows;
use crate::patience::hold;

/// Takes all steps from this piece on, with a check for signals between two pieces.
pub(super) fn take<const N: usize>(
    py: Python<'_>,
    arms: &Mutex<Vec<Simulation<N>>>,
    windows: &Windows,
    pool: Option<&ThreadPool>,
    first: Piece<'_>,
) -> PyResult<()> {
    let mut piece = first;
    let most = piece.steps.iter().copied().max().unwrap_or(0);
    while piece.done < most {
        {
            let mut arms = hold(py, arms);
            let arms = arms.as_mut_slice();
            windows.write(py, |shown| match pool {
                None => lanes::advance(arms, shown, piece),
                Some(pool) => pool.install(|| lanes::advance(arms, shown, piece)),
            })?;
        }
        piece.done = piece.done.saturating_add(piece.length);
        py.check_signals()?;
    }
    Ok(())
}

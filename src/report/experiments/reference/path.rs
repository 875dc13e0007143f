//! A reference motion at any instant: the series of its steps, kept.
//!
//! **Invariant:** an instant beyond the end is answered with the end.

#![allow(
    clippy::indexing_slicing,
    reason = "every index comes from `array::from_fn` over arrays of the same constant length"
)]

use super::double_double::DoubleDouble as Real;
use super::taylor::{Taylor, TaylorStep, evaluate};
use super::{COARSE, FINE, Law, continuous_drive, exact};
use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;

/// Instants at which two settings are compared.
const COMPARED: u64 = 64;

/// A motion from a start on, for some time.
#[derive(Debug, Clone)]
pub struct ReferencePath<const N: usize> {
    pieces: Vec<TaylorStep<N>>,
    uncertainty: f64,
}

impl<const N: usize> ReferencePath<N> {
    /// The motion from `start` under the law at every instant, or under a constant effort, for `duration` \[s\]. `None`
    /// for an effort that is held from one control instant to the next.
    #[must_use]
    pub fn new(arm: &Arm<N>, start: &State<N>, law: &Law<N>, duration: f64) -> Option<Self> {
        let pieces = |setting| {
            let (mut state, drive) = (exact(start), continuous_drive(law)?);
            Some(Taylor::new(arm, setting).path(&mut state, &drive, duration))
        };
        let (fine, coarse) = (pieces(FINE)?, pieces(COARSE)?);
        let spacing = duration / in_f64(COMPARED);
        let off = (1..=COMPARED).map(|index| {
            let time = Real::from(spacing) * Real::from(in_f64(index));
            let (one, other) = (position(&fine, time), position(&coarse, time));
            let apart = one.iter().zip(&other);
            apart.fold(0.0, |largest: f64, (a, b)| {
                largest.max((*a - *b).abs().to_f64())
            })
        });
        let uncertainty = off.fold(0.0, f64::max);
        Some(Self {
            pieces: fine,
            uncertainty,
        })
    }

    /// The joint angles after `steps` steps of `timestep` \[s\] \[rad\].
    #[must_use]
    pub fn after(&self, steps: u64, timestep: f64) -> [Real; N] {
        position(
            &self.pieces,
            Real::from(timestep) * Real::from(in_f64(steps)),
        )
    }

    /// How far the angles may be off: the largest difference between two settings \[rad\].
    #[must_use]
    pub fn uncertainty(&self) -> f64 {
        self.uncertainty
    }
}

/// The joint angles at `time` \[s\].
fn position<const N: usize>(pieces: &[TaylorStep<N>], time: Real) -> [Real; N] {
    let after = pieces.partition_point(|piece| (piece.begins - time).to_f64() <= 0.0);
    let Some(piece) = pieces.get(after.saturating_sub(1)) else {
        return [Real::from(f64::NAN); N];
    };
    let after = time - piece.begins;
    let change = evaluate(&piece.angle, after);
    std::array::from_fn(|i| piece.position[i] + change[i] * after)
}

//! The largest distance between the end effectors of two runs of one motion.
//!
//! They are compared after every step of the first run. A comparison at even intervals would miss the first
//! milliseconds of a stiff loop, or a whole turn of a fast link.
//!
//! **Invariant:** a piece of a comparison takes a millisecond at most (optimised build).

use super::continuous::ContinuousLoop;
use super::paused::PieceWork;
use crate::math::arm::{Arm, State};
use crate::math::kinematics::forward;
use crate::math::simulation::Simulation;

/// A run that can be stepped, and whose state can be read.
pub trait Steppable<const N: usize>: Send {
    /// Takes up to `steps` steps. Returns how many it took before the run diverged.
    fn advance(&mut self, steps: u64) -> u64;
    /// The cost of all steps so far, in evaluations of the dynamics.
    fn evaluations(&self) -> u64;
    /// The present state.
    fn state(&self) -> &State<N>;
}

impl<const N: usize> Steppable<N> for Simulation<N> {
    fn advance(&mut self, steps: u64) -> u64 {
        Simulation::advance(self, steps)
    }

    fn evaluations(&self) -> u64 {
        self.steps() * u64::from(self.method().evaluations())
    }

    fn state(&self) -> &State<N> {
        Simulation::state(self)
    }
}

impl<const N: usize> Steppable<N> for ContinuousLoop<N> {
    fn advance(&mut self, steps: u64) -> u64 {
        (0..steps).take_while(|_| self.step()).count() as u64
    }

    fn evaluations(&self) -> u64 {
        self.steps * u64::from(self.control.method.evaluations())
    }

    fn state(&self) -> &State<N> {
        &self.state
    }
}

/// The largest distance \[m\] between the two end effectors after any of the run's `steps`. One step of the run takes
/// as long as `reference_steps` steps of the reference. Infinite if either diverges. The comparison ends once the
/// distance exceeds `allowed` \[m\].
pub async fn largest_distance<const N: usize>(
    arm: &Arm<N>,
    (mut run, steps): (Box<dyn Steppable<N>>, u64),
    (mut reference, reference_steps): (Box<dyn Steppable<N>>, u64),
    allowed: f64,
) -> f64 {
    let (mut largest, mut work, mut piece) = (0.0, 0, PieceWork::default());
    for _ in 0..steps {
        if run.advance(1) < 1 || reference.advance(reference_steps) < reference_steps {
            return f64::INFINITY;
        }
        let [one, other] =
            [&run, &reference].map(|it| forward(arm.lengths(), &it.state().position));
        let apart = one.position.distance(other.position);
        largest = if apart.is_nan() {
            f64::INFINITY
        } else {
            apart.max(largest)
        };
        if largest > allowed {
            break;
        }
        let before = std::mem::replace(&mut work, run.evaluations() + reference.evaluations());
        piece.spend(work - before).await;
    }
    largest
}

//! The largest distance between the end effectors of two runs of one motion.
//!
//! They are compared after every step of the first run. A comparison at even intervals would miss the first
//! milliseconds of a stiff loop, or a whole turn of a fast link.
//!
//! **Invariant:** a piece of a comparison takes a millisecond at most (optimised build).

use super::continuous::ContinuousLoop;
use super::paused::PieceWork;
use super::taylor::TaylorReference;
use crate::math::arm::{Arm, State};
use crate::math::kinematics::forward;
use crate::math::simulation::Simulation;

/// Most Taylor coefficients of a free motion: a few seconds of one core.
const MAX_COEFFICIENTS: u64 = 40_000_000;

/// A run that can be stepped, and whose state can be read.
pub(crate) trait Steppable<const N: usize>: Send {
    /// Takes up to `steps` steps. Returns how many it took before the run diverged.
    fn advance(&mut self, steps: u64) -> u64;
    /// The cost of all steps so far, in evaluations of the dynamics.
    fn evaluations(&self) -> u64;
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
        self.steps() * u64::from(self.control.method.evaluations())
    }

    fn state(&self) -> &State<N> {
        &self.state
    }
}

/// The motion of a free arm, computed within a tolerance.
pub(super) struct FreeMotion<const N: usize> {
    pub(super) arm: Arm<N>,
    pub(super) taylor: TaylorReference<N>,
    /// Length of a step \[s\].
    pub(super) timestep: f64,
}

impl<const N: usize> Steppable<N> for FreeMotion<N> {
    fn advance(&mut self, steps: u64) -> u64 {
        let Self {
            arm,
            taylor,
            timestep,
        } = self;
        let mut follow = || {
            taylor.follow(arm, &[0.0; N], *timestep) && taylor.coefficients() <= MAX_COEFFICIENTS
        };
        (0..steps).take_while(|_| follow()).count() as u64
    }

    fn evaluations(&self) -> u64 {
        self.taylor.coefficients()
    }

    fn state(&self) -> &State<N> {
        self.taylor.state()
    }
}

/// The largest distance \[m\] between the two end effectors after any of the run's `steps`. One step of the run takes
/// as long as `reference_steps` steps of the reference. Infinite if either diverges. The comparison ends once the
/// distance exceeds `allowed` \[m\].
pub(super) async fn largest_distance<const N: usize>(
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::paused::at_once;

    /// A run that has diverged.
    struct Diverged(State<2>);

    impl Steppable<2> for Diverged {
        fn advance(&mut self, _: u64) -> u64 {
            0
        }

        fn evaluations(&self) -> u64 {
            0
        }

        fn state(&self) -> &State<2> {
            &self.0
        }
    }

    #[test]
    fn a_run_that_diverges_is_infinitely_far_off_however_far_is_allowed() {
        let arm = Arm::default();
        let run = || Box::new(Diverged(State::rest()));
        let reference = || Box::new(Simulation::new(arm, crate::study::linear::no_control()));
        let off = largest_distance(&arm, (run(), 1_000_000), (reference(), 1), f64::INFINITY);
        assert!(at_once(off).is_infinite());
        let off = largest_distance(&arm, (reference(), 1_000_000), (run(), 1), f64::INFINITY);
        assert!(at_once(off).is_infinite());
    }
}

//! Two runs of one motion beside each other: how far their end effectors come apart.
//!
//! They are compared after every step of the first run. A comparison in even intervals would miss what happens in
//! between: the first milliseconds of a stiff loop, or a whole turn of a fast link.
//!
//! **Invariant:** a comparison goes on by pieces, and a piece takes a millisecond at most (optimised build).

use glam::DVec2;

use super::continuous::ContinuousLoop;
use super::taylor::TaylorReference;
use crate::math::arm::{Arm, State};
use crate::math::kinematics::forward;
use crate::math::simulation::Simulation;

/// Evaluations of the dynamics between two returns to the caller; a piece may exceed them by one step.
const WORK_PER_PIECE: u64 = 2000;

/// Most coefficients of a followed arm: some seconds of one core.
const MAX_COEFFICIENTS: u64 = 40_000_000;

/// A run that can be stepped and seen.
pub(super) trait Steppable {
    /// Takes a step. Returns its cost in evaluations of the dynamics; none if the run has diverged.
    fn step(&mut self) -> Option<u64>;
    fn end_effector(&self) -> DVec2;
}

impl<const N: usize> Steppable for Simulation<N> {
    fn step(&mut self) -> Option<u64> {
        Simulation::step(self).then(|| self.method().evaluations().into())
    }

    fn end_effector(&self) -> DVec2 {
        forward(self.arm().lengths(), &self.state().position).position
    }
}

/// The motion that others are compared with.
#[derive(Debug, Clone)]
pub(super) enum ReferenceRun<const N: usize> {
    /// An arm under a law that acts at every instant.
    Law(ContinuousLoop<N>),
    /// An arm under a law that runs once a control period.
    Sampled(Box<Simulation<N>>),
    /// An arm left to itself.
    Free(FreeMotion<N>),
}

/// An arm left to itself, followed within a tolerance.
#[derive(Debug, Clone)]
pub(super) struct FreeMotion<const N: usize> {
    arm: Arm<N>,
    taylor: TaylorReference<N>,
    timestep: f64,
}

impl<const N: usize> FreeMotion<N> {
    pub(super) fn new(arm: Arm<N>, start: State<N>, timestep: f64, tolerance: f64) -> Self {
        Self {
            arm,
            taylor: TaylorReference::within(start, tolerance),
            timestep,
        }
    }
}

impl<const N: usize> Steppable for ReferenceRun<N> {
    fn step(&mut self) -> Option<u64> {
        match self {
            Self::Law(law) => law.step().then(|| law.control.method.evaluations().into()),
            Self::Sampled(sampled) => Steppable::step(&mut **sampled),
            Self::Free(free) => {
                let before = free.taylor.coefficients();
                let is_followed = free.taylor.follow(&free.arm, &[0.0; N], free.timestep);
                let after = free.taylor.coefficients();
                (is_followed && after <= MAX_COEFFICIENTS).then_some(after - before)
            }
        }
    }

    fn end_effector(&self) -> DVec2 {
        let (arm, state) = match self {
            Self::Sampled(sampled) => (sampled.arm(), sampled.state()),
            Self::Law(law) => (&law.control.arm, &law.state),
            Self::Free(free) => (&free.arm, free.taylor.state()),
        };
        forward(arm.lengths(), &state.position).position
    }
}

/// A run on its way beside the truth.
#[derive(Debug, Clone)]
pub(super) struct Beside<R, const N: usize> {
    run: R,
    truth: ReferenceRun<N>,
    /// Steps of the truth in one of the run.
    truth_steps: u64,
    /// Steps of the run that are still to be taken.
    left: u64,
    /// How far the end effectors may come apart \[m\]; the comparison ends beyond that.
    allowed: f64,
    apart: f64,
}

impl<R: Steppable, const N: usize> Beside<R, N> {
    pub(super) fn new(
        run: R,
        steps: u64,
        truth: ReferenceRun<N>,
        truth_steps: u64,
        allowed: f64,
    ) -> Self {
        Self {
            run,
            truth,
            truth_steps,
            left: steps,
            allowed,
            apart: 0.0,
        }
    }

    /// Goes on by a piece. Returns the largest distance \[m\] once it is known, or known to be too large; infinite if a
    /// run has diverged.
    pub(super) fn advance(&mut self) -> Option<f64> {
        let mut work = 0;
        while self.left > 0 && self.apart <= self.allowed {
            if work >= WORK_PER_PIECE {
                return None;
            }
            let Some(more) = self.step() else {
                // A run that has diverged costs nothing, so the loop would not end.
                self.left = 0;
                self.apart = f64::INFINITY;
                break;
            };
            work += more;
            self.left -= 1;
        }
        Some(self.apart)
    }

    fn step(&mut self) -> Option<u64> {
        let mut work = self.run.step()?;
        for _ in 0..self.truth_steps {
            work += self.truth.step()?;
        }
        let apart = self.run.end_effector().distance(self.truth.end_effector());
        self.apart = self
            .apart
            .max(if apart.is_nan() { f64::INFINITY } else { apart });
        Some(work)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run that has diverged, and counts how often it is asked on.
    struct Diverged<'a>(&'a std::cell::Cell<u64>);

    impl Steppable for Diverged<'_> {
        fn step(&mut self) -> Option<u64> {
            self.0.set(self.0.get() + 1);
            None
        }

        fn end_effector(&self) -> DVec2 {
            DVec2::NAN
        }
    }

    #[test]
    fn a_comparison_ends_with_its_numbers_however_far_apart_is_allowed() {
        let asked = std::cell::Cell::new(0);
        let arm = Arm::<2>::default();
        let start = State {
            position: [0.0; 2],
            velocity: [0.0; 2],
        };
        let truth = ReferenceRun::Free(FreeMotion::new(arm, start, 0.01, 1e-6));
        let mut beside = Beside::new(Diverged(&asked), 1_000_000, truth, 1, f64::INFINITY);
        assert_eq!(beside.advance(), Some(f64::INFINITY));
        assert_eq!(beside.advance(), Some(f64::INFINITY));
        assert_eq!(asked.get(), 1);
    }
}

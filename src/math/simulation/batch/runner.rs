//! Assigns arms to the lanes of a few pairs of registers.
//!
//! When an arm leaves a lane, the next waiting arm gets it. So no lane is empty until the last arms have one.
//!
//! **Invariant:** a lane without an arm holds an arm at rest without gravity, which is stepped with the others and
//! never diverges.

#![allow(
    clippy::indexing_slicing,
    reason = "pairs of registers, and the jobs of each, are counted from their lanes"
)]

use std::vec::Drain;

use fearless_simd::Simd;

use super::job::{BatchJob, StepDynamics, StepKind};
use super::lanes::{Lanes, Moving};
use crate::math::number::{Number, Wide};

/// Registers whose operations alternate.
const K: usize = 2;
/// Pairs of registers that take each step in turn.
pub(super) const PAIRS: usize = 2;

/// The arms of one kind: some are in the lanes of a few pairs, and the others wait for a lane.
pub(super) struct BatchRunner<'q, 'a, S: Simd, const N: usize> {
    pairs: [Lanes<Wide<S, K>, N>; PAIRS],
    /// The arm in each lane, pair after pair.
    jobs: Vec<Option<BatchJob<'a, N>>>,
    waiting: Drain<'q, BatchJob<'a, N>>,
}

impl<'q, 'a, S: Simd, const N: usize> BatchRunner<'q, 'a, S, N> {
    /// Loads an arm into every lane, as far as there are arms.
    #[inline(always)]
    pub(super) fn new(simd: S, mut waiting: Drain<'q, BatchJob<'a, N>>) -> Self {
        let mut pairs = [Lanes::resting(Wide::<S, K>::splat(simd, 0.0)); PAIRS];
        let mut jobs = Vec::with_capacity(PAIRS * Wide::<S, K>::LANES);
        for lanes in &mut pairs {
            for lane in 0..Wide::<S, K>::LANES {
                let mut job = waiting.next();
                if let Some(job) = &mut job {
                    lanes.place(lane, job);
                }
                jobs.push(job);
            }
        }
        Self {
            pairs,
            jobs,
            waiting,
        }
    }

    /// Takes all steps of all arms.
    #[inline(always)]
    pub(super) fn run(mut self, kind: StepKind) {
        while let Some(steps) = self.until_look() {
            match kind.dynamics {
                StepDynamics::Weightless => self.take_steps::<false, false>(kind, steps),
                StepDynamics::Frictionless => self.take_steps::<true, false>(kind, steps),
                StepDynamics::Damped => self.take_steps::<true, true>(kind, steps),
            }
            self.look(steps);
        }
    }

    /// The number of steps that all arms take before the next check.
    fn until_look(&self) -> Option<u64> {
        self.jobs.iter().flatten().map(BatchJob::until_look).min()
    }

    #[inline(always)]
    fn take_steps<const USES_FIRST_ANGLE: bool, const HAS_FRICTION: bool>(
        &mut self,
        kind: StepKind,
        steps: u64,
    ) {
        let mut jobs = self.jobs.chunks(Wide::<S, K>::LANES);
        let taken: [bool; PAIRS] = [(); PAIRS].map(|()| {
            jobs.next()
                .is_some_and(|jobs| jobs.iter().any(Option::is_some))
        });
        for step in 0..steps {
            for (index, lanes) in self.pairs.iter_mut().enumerate() {
                if !taken[index] {
                    continue;
                }
                let mut next =
                    lanes.next::<USES_FIRST_ANGLE, HAS_FRICTION>(kind.method, kind.controlled);
                if !Wide::<S, K>::all_finite(&next.state.position, &next.state.velocity) {
                    // This part is a separate function, so the loop's other values stay in registers.
                    let mut parted = next;
                    let first = index * Wide::<S, K>::LANES;
                    part(lanes, &mut parted, &mut self.jobs[first..], step);
                    next = parted;
                }
                lanes.moving = next;
            }
        }
    }

    /// Counts the steps, removes arms that are done, and gives their lanes to the next ones.
    fn look(&mut self, steps: u64) {
        let chunks = self.jobs.chunks_mut(Wide::<S, K>::LANES);
        for (lanes, jobs) in self.pairs.iter_mut().zip(chunks) {
            for (lane, place) in jobs.iter_mut().enumerate() {
                if let Some(job) = place {
                    let push_ends = job.count(steps);
                    if job.left() == 0 {
                        lanes.moving.write(lane, job.arm);
                        job.end(false);
                        lanes.rest(lane);
                        *place = None;
                    } else {
                        if push_ends {
                            lanes.end_push(lane);
                        }
                        if job.ends_period() {
                            lanes.begin_period(lane, job);
                        }
                    }
                }
                if place.is_none()
                    && let Some(mut next) = self.waiting.next()
                {
                    lanes.place(lane, &mut next);
                    *place = Some(next);
                }
            }
        }
    }
}

/// Removes the arms whose next state is not finite. They took `step` steps of this run before it.
#[cold]
#[inline(never)]
fn part<T: Number, const N: usize>(
    lanes: &mut Lanes<T, N>,
    next: &mut Moving<T, N>,
    jobs: &mut [Option<BatchJob<'_, N>>],
    step: u64,
) {
    for (lane, place) in (0..T::LANES).zip(jobs) {
        if !next.is_finite(lane)
            && let Some(mut job) = place.take()
        {
            job.count(step);
            lanes.moving.write(lane, job.arm);
            job.end(true);
            lanes.rest(lane);
            next.set(lane, &Moving::resting(0.0));
        }
    }
}

//! Many simulations advanced side by side, with one SIMD lane each.
//!
//! Arms share a register if they have the same method, if all controllers are on or all are off, if all have
//! gravity or none has, and if all have friction or none has. State, parameters, gains, setpoint, timestep, disturbance and number of steps may differ.
//! The number of lanes depends on the processor at run time: 8 with AVX-512, 4 with AVX2, 2 with NEON or SSE2.
//!
//! The formulas are those of one arm, with another number type ([`crate::math::number`]): two registers at a time. A
//! few such pairs take each step in turn, so the processor executes one pair while another waits for its results.
//!
//! **Invariant:** every simulation ends in the state of [`Simulation::advance`], bit for bit, in every batch.

mod job;
mod lanes;
mod runner;

use std::cmp::Reverse;

use fearless_simd::dispatch;

use self::job::{BatchJob, StepKind};
use self::runner::BatchRunner;
use super::Simulation;
use crate::math::number::Registers;

/// Fewest evaluations for which an arm is loaded into a lane. Loading and storing take about as long as
/// these evaluations alone.
const WORTH_A_LANE: u64 = 2;

/// Most arms that wait for a lane. With this number, empty lanes at the end have little effect.
const QUEUE: usize = 1024;

impl Registers {
    /// Runs [`advance`] with registers of one width.
    pub fn advance<'a, const N: usize>(
        self,
        arms: impl IntoIterator<Item = (&'a mut Simulation<N>, u64)>,
    ) {
        let mut waiting: [Vec<BatchJob<'a, N>>; StepKind::COUNT] =
            std::array::from_fn(|_| Vec::new());
        for (arm, steps) in arms {
            if steps == 0 || arm.divergence.is_some() {
                continue;
            }
            let evaluations = steps.saturating_mul(arm.method.evaluations().into());
            let kind = StepKind::of(arm);
            // A lane keeps no time, so the number of steps is bounded first.
            let alone = evaluations < WORTH_A_LANE || arm.steps_with_time(steps) < steps;
            let job = BatchJob::new(arm, steps);
            if alone {
                job.alone();
                continue;
            }
            let Some(queue) = waiting.get_mut(kind.index()) else {
                continue;
            };
            queue.push(job);
            if queue.len() == QUEUE {
                self.run(kind, queue);
            }
        }
        for (kind, queue) in StepKind::all().zip(&mut waiting) {
            self.run(kind, queue);
        }
    }

    /// Takes the steps of all arms of one kind, and removes them from the queue.
    fn run<const N: usize>(self, kind: StepKind, queue: &mut Vec<BatchJob<'_, N>>) {
        if queue.len() < 2 {
            // No other arm could share a register.
            queue.drain(..).for_each(BatchJob::alone);
            return;
        }
        // The arm with the most steps begins first, so the last arms end at about the same time.
        queue.sort_by_key(|job| Reverse(job.left()));
        dispatch!(self.level(), simd => BatchRunner::new(simd, queue.drain(..)).run(kind));
    }
}

/// Takes up to `steps` steps with every arm. An arm takes fewer steps only if it diverges or has diverged.
///
/// ```
/// use pendularm::math::{arm::Arm, pid::Gains, simulation::{Simulation, batch}};
///
/// let mut arms = vec![Simulation::<2>::new(Arm::default(), Gains::default()); 100];
/// batch::advance(arms.iter_mut().map(|arm| (arm, 1000)));
/// assert!(arms.iter().all(|arm| arm.steps() == 1000));
/// ```
pub fn advance<'a, const N: usize>(arms: impl IntoIterator<Item = (&'a mut Simulation<N>, u64)>) {
    Registers::widest().advance(arms);
}

//! Many simulations advanced side by side, a lane of the machine's registers for each.
//!
//! Arms share a register if they have the same method, the controller alike on or off, and gravity alike or none.
//! State, parameters, gains, setpoint, timestep, disturbance and number of steps are each arm's own. The processor
//! decides at run time how many lanes there are: 8 with AVX-512, 4 with AVX2, 2 with NEON or SSE2.
//!
//! Formulas are those of one arm, over another number ([`crate::math::number`]): two registers at a time. A few
//! such pairs take each step in turn, so that the processor works at one while another waits for its own results.
//!
//! **Invariant:** every simulation ends in the state that [`Simulation::advance`] gives, bit for bit, in every
//! batch.

mod job;
mod lanes;
mod runner;

use std::cmp::Reverse;

use fearless_simd::dispatch;

use self::job::{BatchJob, StepKind};
use self::runner::BatchRunner;
use super::Simulation;
use crate::math::number::Registers;

/// Fewest evaluations for which an arm is put into a lane: to and fro takes about as long as one does alone.
const WORTH_A_LANE: u64 = 2;

/// Most arms that wait for a lane: enough that empty lanes at the end count for little.
const QUEUE: usize = 1024;

impl Registers {
    /// Does [`advance`] in these registers.
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
            // A lane has no clock.
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

    /// Takes the steps of arms of one kind, who then have left the queue.
    fn run<const N: usize>(self, kind: StepKind, queue: &mut Vec<BatchJob<'_, N>>) {
        if queue.len() < 2 {
            // There is no other arm to share a register with.
            queue.drain(..).for_each(BatchJob::alone);
            return;
        }
        // The arm that takes longest begins first, so that the last ones end together.
        queue.sort_by_key(|job| Reverse(job.left()));
        dispatch!(self.level(), simd => BatchRunner::new(simd, queue.drain(..)).run(kind));
    }
}

/// Takes up to `steps` steps with every arm. An arm takes fewer only if it has diverged or diverges.
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

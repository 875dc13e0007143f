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
use std::ops::ControlFlow;

use fearless_simd::dispatch;

use self::job::{BatchJob, Observer, StepKind};
use self::runner::BatchRunner;
use super::Simulation;
use crate::math::arm::State;
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
        self.take_all(arms.into_iter().map(|(arm, steps)| (arm, steps, None)));
    }

    /// Does [`advance_with`] in these registers.
    pub fn advance_with<'a, const N: usize, O>(
        self,
        arms: impl IntoIterator<Item = (&'a mut Simulation<N>, u64, O)>,
    ) where
        O: FnMut(&State<N>) -> ControlFlow<()> + 'a,
    {
        let observed = |(arm, steps, observe): (_, _, O)| {
            let observer: Observer<'a, N> = Box::new(observe);
            (arm, steps, Some(observer))
        };
        self.take_all(arms.into_iter().map(observed));
    }

    fn take_all<'a, const N: usize>(
        self,
        arms: impl Iterator<Item = (&'a mut Simulation<N>, u64, Option<Observer<'a, N>>)>,
    ) {
        let mut waiting: [Vec<BatchJob<'a, N>>; StepKind::COUNT] =
            std::array::from_fn(|_| Vec::new());
        for (arm, steps, observer) in arms {
            if steps == 0 || arm.divergence.is_some() {
                continue;
            }
            let evaluations = steps.saturating_mul(arm.method.evaluations().into());
            let kind = StepKind::of(arm);
            // A lane has no clock.
            let alone = evaluations < WORTH_A_LANE || arm.steps_with_time(steps) < steps;
            let job = BatchJob::new(arm, steps, observer);
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

/// Does what [`advance`] does, and shows each arm's own observer the state after every step. The observer may end its
/// arm's advance there, as in [`Simulation::advance_with`].
///
/// ```
/// use std::ops::ControlFlow;
/// use pendularm::math::{arm::{Arm, State}, pid::Gains, simulation::{Simulation, batch}};
///
/// let mut arms = vec![Simulation::<2>::new(Arm::default(), Gains::default()); 100];
/// let mut lowest = vec![0.0_f64; 100];
/// batch::advance_with(arms.iter_mut().zip(&mut lowest).map(|(arm, lowest)| {
///     (arm, 1000, move |state: &State<2>| {
///         *lowest = lowest.min(state.position[0]);
///         if *lowest < -1.0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
///     })
/// }));
/// assert!(arms.iter().all(|arm| arm.steps() < 1000));
/// ```
pub fn advance_with<'a, const N: usize, O>(
    arms: impl IntoIterator<Item = (&'a mut Simulation<N>, u64, O)>,
) where
    O: FnMut(&State<N>) -> ControlFlow<()> + 'a,
{
    Registers::widest().advance_with(arms);
}

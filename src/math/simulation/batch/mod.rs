//! Many simulations advanced side by side, a lane of the machine's registers for each.
//!
//! Arms with the same method, with the controller alike on or off, and alike with or without gravity share a register;
//! state, parameters, gains, setpoint, timestep, disturbance and number of steps are each arm's own. What the processor
//! has decides at run time how many lanes there are: 8 with AVX-512, 4 with AVX2, 2 with NEON or SSE2.
//!
//! Formulas are those of one arm, over another number ([`crate::math::number`]): two registers at a time, and a few
//! such pairs take each step in turn, so that the processor works at one while another waits for its own results.
//!
//! **Invariant:** every simulation is afterwards what [`Simulation::advance`] would have made of it, bit for bit,
//! whoever stands beside it.

mod lanes;
mod seat;

use fearless_simd::dispatch;

use self::lanes::{Formation, PAIRS};
use self::seat::{Seat, StepKind};
use super::Simulation;
use crate::math::number::Registers;

/// Fewest evaluations for which an arm is put into a lane: to and fro takes about as long as one does alone.
const WORTH_A_LANE: u64 = 2;

impl Registers {
    /// [`advance`] in these.
    pub fn advance<'a, const N: usize>(
        self,
        arms: impl IntoIterator<Item = (&'a mut Simulation<N>, u64)>,
    ) {
        let full = 2 * PAIRS * self.lanes();
        let mut waiting: [Vec<Seat<'a, N>>; StepKind::COUNT] = std::array::from_fn(|_| Vec::new());
        for (arm, steps) in arms {
            if steps == 0 || arm.divergence.is_some() {
                continue;
            }
            let evaluations = steps.saturating_mul(arm.method.evaluations().into());
            if evaluations < WORTH_A_LANE {
                arm.advance(steps);
                continue;
            }
            let kind = StepKind::of(arm);
            let Some(seats) = waiting.get_mut(kind.index()) else {
                continue;
            };
            seats.push(Seat::new(arm, steps));
            if seats.len() == full {
                self.run(kind, seats);
            }
        }
        for (kind, seats) in StepKind::all().zip(&mut waiting) {
            self.run(kind, seats);
        }
    }

    /// Takes the steps of arms of one kind, at most as many as have a lane, who then leave their seats.
    fn run<const N: usize>(self, kind: StepKind, seats: &mut Vec<Seat<'_, N>>) {
        if let [seat] = seats.as_mut_slice() {
            // Nobody to share a register with.
            seat.alone();
        } else if !seats.is_empty() {
            dispatch!(self.level(), simd => Formation::new(simd, seats).run(kind));
        }
        seats.clear();
    }
}

/// Takes up to so many steps with every arm, all of them unless it has diverged or does so.
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

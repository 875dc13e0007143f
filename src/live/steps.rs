//! Single steps of a paused arm, taken in rows (a limited number per turn).
//!
//! **Invariant:** a row ends with each message about a goal, so the message is sent before the next
//! step.

use super::{GoalProgress, LiveArm, World};
use crate::math::simulation::ArmInput;
use crate::protocol::op::fields::Rejections;
use crate::services::arm::{DIVERGED, STEPS_IN_A_ROW, Step, Stepped, StepsEnd};

/// Requested steps that are not all taken.
#[derive(Debug, Clone, Copy)]
pub struct StepsAsked<const N: usize> {
    asked: u64,
    taken: u64,
    /// The effort that is applied instead of the controller's \[N m\], if there is one.
    effort: Option<[f64; N]>,
}

impl<const N: usize, W: World<N>> LiveArm<N, W> {
    /// Checks whether the steps can be taken.
    ///
    /// # Errors
    /// All rejected fields of the request.
    pub fn begin_steps(&self, ask: Step<N>) -> Result<StepsAsked<N>, Rejections> {
        let mut rejected = ask.rejected;
        if !self.paused {
            rejected.refuse("steps", &"can be taken only while the arm is paused");
        } else if self.simulation.divergence().is_some() {
            rejected.refuse("steps", &DIVERGED);
        }
        match ask.steps.filter(|_| rejected.is_empty()) {
            Some(asked) => Ok(StepsAsked {
                asked,
                taken: 0,
                effort: ask.effort,
            }),
            None => Err(rejected),
        }
    }

    /// Takes the next row of steps. Returns the answer after the last one, and the message about the goal to be
    /// sent before the next row.
    pub fn take_row(
        &mut self,
        steps: &mut StepsAsked<N>,
    ) -> (Option<Stepped<N>>, Option<GoalProgress<N>>) {
        if !self.paused {
            return (Some(self.stepped(steps, StepsEnd::Resumed)), None);
        }
        let has_diverged = self.simulation.divergence().is_some();
        if steps.effort.is_some() {
            self.change(ArmInput::Drive(steps.effort));
        }
        let row_end = steps.asked.min(steps.taken + STEPS_IN_A_ROW);
        let mut progress = None;
        // A reached goal ends an advance, but not the request. News of a goal end the row.
        while steps.taken < row_end && progress.is_none() && self.simulation.divergence().is_none()
        {
            let taken;
            (taken, progress) = self.advance(row_end - steps.taken, true);
            steps.taken += taken;
        }
        if steps.effort.is_some() {
            self.change(ArmInput::Drive(None));
        }
        let end = if self.simulation.divergence().is_some() {
            if !has_diverged {
                self.note_divergence();
            }
            Some(StepsEnd::Diverged)
        } else {
            (steps.taken == steps.asked).then_some(StepsEnd::AllTaken)
        };
        (end.map(|end| self.stepped(steps, end)), progress)
    }

    fn stepped(&self, steps: &StepsAsked<N>, end: StepsEnd) -> Stepped<N> {
        Stepped {
            steps: steps.taken,
            time: self.simulation.time(),
            state: *self.simulation.state(),
            effort: *self.simulation.effort(),
            end,
        }
    }
}

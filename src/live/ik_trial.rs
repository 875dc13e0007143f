//! Timed trials of an arm: the rules of `math::trial`, with the arm's time and lengths and with random targets.
//!
//! **Invariant:** the time of a trial never goes back. The host may get the poses of the arm in any order.

use serde::Serialize;

use super::goals::{Obstacle, Pose};
use super::ik_action::GoalReport;
use crate::math::trial::{Conclusion, Trial, TrialCommand, sample};
use crate::services::trial::{Terms, TrialRefused, TrialRequest, status_message};

/// The trials of one arm. The host executes their commands in order, and reports each answer before the next command.
pub struct IkTrials<const N: usize> {
    trial: Trial,
    /// Uniform random numbers from 0 to 1, for the targets.
    random: Box<dyn FnMut() -> f64>,
    /// The last known lengths \[m\].
    lengths: [f64; N],
    /// The last known number of resets, and simulation time over all of them \[s\].
    clock: (u64, f64),
}

/// The answer of `ik_action` to a goal of the trial.
pub struct GoalAnswer<const N: usize> {
    /// The ticket of the command.
    pub ticket: u64,
    /// The goal's id, if it was accepted.
    pub goal_id: Option<String>,
    /// Lengths after a refusal \[m\], which may have been the reason.
    pub lengths: Option<[f64; N]>,
}

impl<const N: usize> IkTrials<N> {
    /// No trial yet. The targets come from `random`, uniform numbers from 0 to 1.
    #[must_use]
    pub fn new(random: impl FnMut() -> f64 + 'static) -> Self {
        Self {
            trial: Trial::default(),
            random: Box::new(random),
            lengths: [1.0; N],
            clock: (0, 0.0),
        }
    }

    /// The present trial.
    #[must_use]
    pub const fn trial(&self) -> &Trial {
        &self.trial
    }

    /// The message of `/ik_trial/status`; none before the first start.
    #[must_use]
    pub fn status(&self) -> Option<impl Serialize + Send + use<N>> {
        self.trial.status().map(|status| status_message(&status))
    }

    /// Takes lengths and time from a pose of the arm, and ends a trial whose duration is over. Of two poses in either
    /// order the later time counts.
    #[must_use]
    pub fn tick(&mut self, pose: &Pose<N>) -> Vec<TrialCommand> {
        self.lengths = pose.lengths;
        let latest = (pose.resets, pose.simulated);
        if latest > self.clock {
            self.clock = latest;
        }
        self.trial.tick(self.clock.1)
    }

    /// Decides a request, after [`IkTrials::tick`] with this pose. Returns also the reason why the arm does not move, of
    /// which the caller is warned.
    ///
    /// # Errors
    /// If it is refused. The trial does not change then.
    pub fn decide(
        &mut self,
        ask: TrialRequest,
        pose: &Pose<N>,
    ) -> Result<(Vec<TrialCommand>, Option<Obstacle>), TrialRefused> {
        let target = || sample(&self.lengths, &mut self.random);
        let commands = match ask {
            TrialRequest::Start { changes, rejected } if rejected.is_empty() => {
                self.trial.start(self.clock.1, changes, target)?
            }
            TrialRequest::Start { rejected, .. } => return Err(TrialRefused::Rejected(rejected)),
            TrialRequest::Skip => self.trial.skip(target)?,
            TrialRequest::Stop => return Ok((self.trial.stop()?, None)),
        };
        Ok((commands, pose.obstacle))
    }

    /// The answer to a request with that outcome.
    #[must_use]
    pub fn terms(&self, outcome: Result<(), TrialRefused>) -> Terms {
        Terms {
            settings: self.trial.settings(),
            outcome,
        }
    }

    /// Takes feedback or the end of a goal.
    #[must_use]
    pub fn report(&mut self, GoalReport { goal, progress }: GoalReport<N>) -> Vec<TrialCommand> {
        let mut commands = self.tick(&progress.pose);
        match progress.outcome {
            None => self
                .trial
                .feedback(&goal.id, progress.distance, &goal.positions),
            Some(outcome) => {
                let conclusion = Conclusion {
                    goal_id: goal.id,
                    outcome,
                    final_distance: progress.distance,
                };
                let target = || sample(&self.lengths, &mut self.random);
                commands.extend(self.trial.concluded(conclusion, target));
            }
        }
        commands
    }

    /// Takes the answer to a goal of the trial.
    #[must_use]
    pub fn answered(&mut self, answer: GoalAnswer<N>) -> Vec<TrialCommand> {
        self.lengths = answer.lengths.unwrap_or(self.lengths);
        let target = || sample(&self.lengths, &mut self.random);
        match answer.goal_id {
            Some(goal_id) => self.trial.accepted(answer.ticket, &goal_id, target),
            None => self.trial.refused(answer.ticket, target),
        }
    }
}

//! A timed trial: one random target after another, counted as the arm reaches them.
//!
//! A [`Trial`] gets events and returns a list of [`TrialCommand`]s. The actor around it only passes messages. A
//! trial does not depend on the arm: targets come from a closure (usually around [`sample`]), and ids identify
//! goals. [`Trial::tick`] gets the simulation time, before any other event of that time.
//!
//! ```text
//!                    start                       accepted                    concluded: reached
//! no pursuit ──────────────────────▶ asked ──────────────────▶ in flight ───────────────────────▶ asked (the next)
//!     ▲      start, skip               │ refused too often         │ concluded: preempted by another client
//!     └────────────────────────────────┴───────────────────────────┘ stop, or the duration is over
//! ```
//!
//! **Invariant:** only the result of the active goal counts. News of an older goal change nothing.

mod sampling;
mod terms;

use super::goal::{Outcome, rounding};
use super::kinematics::Target;

pub use sampling::sample;
pub use terms::{
    ActionStatus, Changes, Conclusion, DURATION, Rejection, Settings, Status, TrialCommand,
};

/// The number of refused targets in a row after which the trial waits. A sampled target is refused only if the
/// lengths change between sampling and solving, so two refusals in a row are rare.
pub const ATTEMPTS: u32 = 8;

/// Most results that are kept until the answer shows which goal is the trial's own. At most two wait if news arrive in
/// order.
const EARLY_RESULTS: usize = 4;

/// Simulation time since a start, summed over resets of the simulation clock.
#[derive(Debug, Clone, Copy)]
struct TrialClock {
    /// Time before the last reset of the clock \[s\].
    carried: f64,
    origin: f64,
    latest: f64,
}

impl TrialClock {
    const fn started(now: f64) -> Self {
        Self {
            carried: 0.0,
            origin: now,
            latest: now,
        }
    }

    /// This is a difference, not a running sum, so the rounding error does not grow with the number of calls.
    fn elapsed(&self) -> f64 {
        self.carried + (self.latest - self.origin)
    }

    fn tell(&mut self, now: f64) {
        if now < self.latest {
            self.carried = self.elapsed();
            self.origin = now;
        }
        self.latest = now;
    }
}

/// The goal of the trial.
#[derive(Debug, Clone, PartialEq)]
enum Pursuit {
    Nothing,
    /// A goal has been sent, and its id is not known yet.
    Asked {
        ticket: u64,
        target: Target,
        attempt: u32,
        /// Results since then; one of them may belong to this goal.
        early: Vec<Conclusion>,
    },
    InFlight {
        goal_id: String,
    },
}

/// The part of the status that belongs to one goal.
#[derive(Debug, Clone, PartialEq)]
struct View {
    target: Option<Target>,
    error: Option<f64>,
    desired_positions: Option<Vec<f64>>,
    action_status: ActionStatus,
}

impl View {
    const fn of(target: Option<Target>, action_status: ActionStatus) -> Self {
        Self {
            target,
            error: None,
            desired_positions: None,
            action_status,
        }
    }
}

/// The state of trials: at most one at a time, and none before the first start.
#[derive(Debug, Clone)]
pub struct Trial {
    settings: Settings,
    /// There is none before the first start.
    clock: Option<TrialClock>,
    running: bool,
    targets_reached: u64,
    pursuit: Pursuit,
    view: View,
    /// The number of goals sent so far. It never restarts, so an answer to an older start is recognised.
    tickets: u64,
}

impl Default for Trial {
    fn default() -> Self {
        Self {
            settings: Settings::default(),
            clock: None,
            running: false,
            targets_reached: 0,
            pursuit: Pursuit::Nothing,
            view: View::of(None, ActionStatus::Idle),
            tickets: 0,
        }
    }
}

impl Trial {
    /// Returns the status; none before the first start.
    #[must_use]
    pub fn status(&self) -> Option<Status> {
        let clock = self.clock?;
        let View {
            target,
            error,
            desired_positions,
            action_status,
        } = self.view.clone();
        Some(Status {
            running: self.running,
            elapsed: clock.elapsed().min(self.settings.duration),
            duration: self.settings.duration,
            targets_reached: self.targets_reached,
            target,
            error,
            desired_positions,
            action_status,
        })
    }

    /// The present settings.
    #[must_use]
    pub const fn settings(&self) -> Settings {
        self.settings
    }

    /// Whether a trial runs.
    #[must_use]
    pub const fn running(&self) -> bool {
        self.running
    }

    /// Remaining simulation time of a running trial \[s\]; none when no trial runs.
    #[must_use]
    pub fn remaining(&self) -> Option<f64> {
        let clock = self.clock.filter(|_| self.running)?;
        Some((self.settings.duration - clock.elapsed()).max(0.0))
    }

    /// Sets the simulation time \[s\], and ends the trial when its duration is over.
    ///
    /// A time before the previous one means that the simulation clock was reset. It adds nothing.
    #[must_use]
    pub fn tick(&mut self, now: f64) -> Vec<TrialCommand> {
        let Some(clock) = self.clock.as_mut().filter(|_| self.running) else {
            return Vec::new();
        };
        clock.tell(now);
        if clock.elapsed() + rounding(now) < self.settings.duration {
            return Vec::new();
        }
        // The trial is over, or the clock is too large for a useful resolution.
        self.end()
    }

    /// Starts a trial at simulation time `now` \[s\]. It replaces a running one.
    ///
    /// # Errors
    ///
    /// [`Rejection::NoTarget`] if `sample` finds none. Settings and a running trial do not change.
    pub fn start(
        &mut self,
        now: f64,
        changes: Changes,
        sample: impl FnOnce() -> Option<Target>,
    ) -> Result<Vec<TrialCommand>, Rejection> {
        let target = sample().ok_or(Rejection::NoTarget)?;
        self.settings = changes.to(self.settings);
        self.clock = Some(TrialClock::started(now));
        self.running = true;
        self.targets_reached = 0;
        Ok(self.replace(target))
    }

    /// Replaces the present target by a new one, without counting it.
    ///
    /// # Errors
    ///
    /// [`Rejection::NotRunning`] when no trial runs, [`Rejection::NoTarget`] if `sample` finds
    /// none.
    pub fn skip(
        &mut self,
        sample: impl FnOnce() -> Option<Target>,
    ) -> Result<Vec<TrialCommand>, Rejection> {
        if !self.running {
            return Err(Rejection::NotRunning);
        }
        let target = sample().ok_or(Rejection::NoTarget)?;
        Ok(self.replace(target))
    }

    /// Ends the trial early.
    ///
    /// # Errors
    ///
    /// [`Rejection::NotRunning`] when no trial runs.
    pub fn stop(&mut self) -> Result<Vec<TrialCommand>, Rejection> {
        if self.running {
            Ok(self.end())
        } else {
            Err(Rejection::NotRunning)
        }
    }

    /// The goal sent under `ticket` has been accepted under `goal_id`.
    #[must_use]
    pub fn accepted(
        &mut self,
        ticket: u64,
        goal_id: &str,
        sample: impl FnOnce() -> Option<Target>,
    ) -> Vec<TrialCommand> {
        match std::mem::replace(&mut self.pursuit, Pursuit::Nothing) {
            Pursuit::Asked {
                ticket: asked,
                target,
                early,
                ..
            } if asked == ticket => {
                self.pursuit = Pursuit::InFlight {
                    goal_id: goal_id.to_owned(),
                };
                self.view = View::of(Some(target), ActionStatus::Active);
                let mut commands = vec![TrialCommand::PublishStatus];
                if let Some(early) = early.into_iter().find(|early| early.goal_id == goal_id) {
                    commands.extend(self.concluded(early, sample));
                }
                commands
            }
            other => {
                // This goal is no longer needed, so the arm must not continue to it.
                self.pursuit = other;
                vec![TrialCommand::CancelGoal {
                    goal_id: goal_id.to_owned(),
                }]
            }
        }
    }

    /// The goal sent under `ticket` has been rejected; another target is tried, [`ATTEMPTS`] in all.
    #[must_use]
    pub fn refused(
        &mut self,
        ticket: u64,
        sample: impl FnOnce() -> Option<Target>,
    ) -> Vec<TrialCommand> {
        let attempt = match &self.pursuit {
            Pursuit::Asked {
                ticket: asked,
                attempt,
                ..
            } if *asked == ticket => attempt + 1,
            _ => return Vec::new(),
        };
        if attempt <= ATTEMPTS
            && let Some(target) = sample()
        {
            return vec![self.ask(target, attempt)];
        }
        self.pursuit = Pursuit::Nothing;
        self.view = View::of(None, ActionStatus::Idle);
        vec![TrialCommand::PublishStatus]
    }

    /// Takes feedback on any goal: the end effector's `distance` from its target \[m\], and the commanded `positions`
    /// \[rad\].
    pub fn feedback(&mut self, goal_id: &str, distance: f64, positions: &[f64]) {
        if self.is_in_flight(goal_id) {
            self.view.error = Some(distance);
            let desired = self.view.desired_positions.get_or_insert_default();
            desired.clear();
            desired.extend_from_slice(positions);
        }
    }

    /// Takes the end of any goal. If the active goal was reached, it is counted, and the next target is sampled.
    #[must_use]
    pub fn concluded(
        &mut self,
        conclusion: Conclusion,
        sample: impl FnOnce() -> Option<Target>,
    ) -> Vec<TrialCommand> {
        if let Pursuit::Asked { early, .. } = &mut self.pursuit {
            if early.len() == EARLY_RESULTS {
                early.remove(0);
            }
            early.push(conclusion);
            return Vec::new();
        }
        if !self.is_in_flight(&conclusion.goal_id) {
            return Vec::new();
        }
        self.pursuit = Pursuit::Nothing;
        match conclusion.outcome {
            Outcome::Reached => {
                self.targets_reached += 1;
                // The status shows this until the next goal is accepted, so that clients can see it.
                self.view.action_status = ActionStatus::Reached;
                self.view.error = Some(conclusion.final_distance);
                let next = sample().map(|target| self.ask(target, 1));
                std::iter::once(TrialCommand::PublishStatus)
                    .chain(next)
                    .collect()
            }
            Outcome::Preempted => {
                self.view = View::of(self.view.target, ActionStatus::Preempted);
                vec![TrialCommand::PublishStatus]
            }
        }
    }

    fn is_in_flight(&self, goal_id: &str) -> bool {
        matches!(&self.pursuit, Pursuit::InFlight { goal_id: ours } if ours == goal_id)
    }

    /// Drops the present goal and pursues `target`.
    fn replace(&mut self, target: Target) -> Vec<TrialCommand> {
        // The new goal preempts the old one only if it is accepted, so the old one is cancelled first.
        let mut commands = self.abandon();
        commands.push(self.ask(target, 1));
        // The status shows the target once its goal has been accepted, with that goal's setpoint.
        self.view = View::of(None, ActionStatus::Idle);
        commands
    }

    fn end(&mut self) -> Vec<TrialCommand> {
        let mut commands = self.abandon();
        self.running = false;
        self.view = View::of(None, ActionStatus::Idle);
        commands.push(TrialCommand::PublishStatus);
        commands
    }

    fn abandon(&mut self) -> Vec<TrialCommand> {
        match std::mem::replace(&mut self.pursuit, Pursuit::Nothing) {
            Pursuit::InFlight { goal_id } => vec![TrialCommand::CancelGoal { goal_id }],
            // A goal without an id is cancelled as soon as it has one.
            Pursuit::Asked { .. } | Pursuit::Nothing => Vec::new(),
        }
    }

    fn ask(&mut self, target: Target, attempt: u32) -> TrialCommand {
        self.tickets += 1;
        let ticket = self.tickets;
        self.pursuit = Pursuit::Asked {
            ticket,
            target,
            attempt,
            early: Vec::new(),
        };
        TrialCommand::SendGoal {
            ticket,
            target,
            criteria: self.settings.criteria,
        }
    }
}

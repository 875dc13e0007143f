//! An arm and its remaining steps.
//!
//! **Invariant:** an arm is written back once: after its last step, or when a result is not finite.

use crate::math::arm::{Arm, State};
use crate::math::count::partition_point;
use crate::math::integrator::Method;
use crate::math::simulation::increments::leaves_out_first_angle;
use crate::math::simulation::{After, Simulation};

/// The kind of a step, the same in all lanes of a register.
#[derive(Debug, Clone, Copy)]
pub(super) struct StepKind {
    pub(super) method: Method,
    /// Whether the control law runs in every step.
    pub(super) controlled: bool,
    pub(super) dynamics: StepDynamics,
}

/// The terms of the equation of motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StepDynamics {
    /// Without gravity and the first angle.
    Weightless,
    /// With gravity.
    Frictionless,
    /// With gravity and friction.
    Damped,
}

impl StepDynamics {
    const ALL: [Self; 3] = [Self::Weightless, Self::Frictionless, Self::Damped];

    fn of<const N: usize>(arm: &Arm<N>) -> Self {
        if arm.has_friction() {
            Self::Damped
        } else if leaves_out_first_angle(arm) {
            Self::Weightless
        } else {
            Self::Frictionless
        }
    }
}

impl StepKind {
    /// The number of kinds.
    pub(super) const COUNT: usize = 2 * StepDynamics::ALL.len() * Method::ALL.len();

    pub(super) fn of<const N: usize>(arm: &Simulation<N>) -> Self {
        Self {
            method: arm.method,
            controlled: arm.pid.is_enabled() && arm.hold.every_step,
            dynamics: StepDynamics::of(&arm.arm),
        }
    }

    pub(super) fn all() -> impl Iterator<Item = Self> {
        Method::ALL.into_iter().flat_map(|method| {
            [false, true].into_iter().flat_map(move |controlled| {
                StepDynamics::ALL.map(|dynamics| Self {
                    method,
                    controlled,
                    dynamics,
                })
            })
        })
    }

    /// Its place in [`StepKind::all`].
    pub(super) fn index(self) -> usize {
        let kinds = StepDynamics::ALL.len();
        kinds * (2 * self.method as usize + usize::from(self.controlled)) + self.dynamics as usize
    }
}

/// An arm that is being stepped.
pub(super) struct BatchJob<'a, const N: usize> {
    pub(super) arm: &'a mut Simulation<N>,
    /// Steps that have been taken, and those still to be taken.
    taken: u64,
    left: u64,
    /// The number of steps with its disturbance.
    pushes: u64,
    /// Its present control period, if a period may have several steps.
    period: Option<HeldSteps<N>>,
}

/// A control period, or the rest of one, in which the effort is held.
struct HeldSteps<const N: usize> {
    effort: [f64; N],
    /// What its first step changes.
    first: After<N>,
    /// Steps that have been taken.
    taken: u64,
    /// The integral before it \[rad s\].
    integral: [f64; N],
    /// Whether it ends by itself. It does not if the controller is off or a client sets the effort.
    ends: bool,
}

impl<'a, const N: usize> BatchJob<'a, N> {
    /// An arm and the number of its steps, at least one.
    pub(super) fn new(arm: &'a mut Simulation<N>, steps: u64) -> Self {
        let pushes = pushes(arm, steps);
        Self {
            arm,
            taken: 0,
            left: steps,
            pushes,
            period: None,
        }
    }

    /// The effort if the law does not run in every step \[N m\].
    pub(super) fn given(&self) -> [f64; N] {
        match &self.period {
            Some(period) => period.effort,
            None => [0.0; N],
        }
    }

    /// Whether the control law may be due.
    pub(super) fn ends_period(&self) -> bool {
        self.period
            .as_ref()
            .is_some_and(|period| period.left() == 0)
    }

    /// Begins a control period in `state`, if it has several steps. `integral` is the present one. Returns the
    /// integral in this period.
    pub(super) fn begin_period(
        &mut self,
        state: &State<N>,
        integral: impl FnOnce() -> [f64; N],
    ) -> [f64; N] {
        if let Some(period) = self.period.take() {
            period.commit(self.arm);
            self.arm.pid.commit(integral());
        }
        let before = *self.arm.pid.integral();
        if self.arm.hold.every_step {
            return before;
        }
        let (hold, pid) = (&self.arm.hold, &self.arm.pid);
        let (control, first) = hold.begin_step(pid, state);
        self.period = Some(HeldSteps {
            effort: control.effort,
            first,
            taken: 0,
            integral: before,
            ends: pid.is_enabled() && hold.held.driven.is_none(),
        });
        control.integral
    }

    /// Takes the steps without a lane.
    pub(super) fn alone(self) {
        self.arm.advance(self.left);
    }

    /// The largest number of steps that it still takes.
    pub(super) fn left(&self) -> u64 {
        self.left
    }

    /// The number of steps until the next check: until the disturbance ends or all steps are taken.
    pub(super) fn until_look(&self) -> u64 {
        let pushed = if self.is_pushed() {
            self.pushes - self.taken
        } else {
            u64::MAX
        };
        let held = self.period.as_ref().map_or(u64::MAX, HeldSteps::left);
        self.left.min(pushed).min(held)
    }

    /// Whether the disturbance acts in the next step.
    pub(super) fn is_pushed(&self) -> bool {
        self.taken < self.pushes
    }

    /// Counts the taken steps. Returns whether the disturbance ended with the last of them.
    pub(super) fn count(&mut self, steps: u64) -> bool {
        let was_pushed = self.is_pushed();
        if let Some(period) = &mut self.period {
            period.taken += steps;
        }
        self.taken += steps;
        self.left -= steps;
        was_pushed && !self.is_pushed()
    }

    /// Records the taken steps in the arm, and whether the next one was tried and not taken.
    pub(super) fn end(&mut self, diverged: bool) {
        self.arm.steps += self.taken;
        self.arm.steps_since_base += self.taken;
        if let Some(period) = &self.period {
            period.commit(self.arm);
            if period.taken == 0 {
                self.arm.pid.commit(period.integral);
            }
        }
        if diverged {
            self.arm.diverge();
        }
        if self.taken + u64::from(diverged) > self.pushes {
            self.arm.disturbance = None;
        }
    }
}

impl<const N: usize> HeldSteps<N> {
    /// The remaining steps.
    fn left(&self) -> u64 {
        if self.ends {
            self.first.due + 1 - self.taken
        } else {
            u64::MAX
        }
    }

    /// Commits the taken steps to the arm.
    fn commit(&self, arm: &mut Simulation<N>) {
        let Some(more) = self.taken.checked_sub(1) else {
            return;
        };
        let mut step = self.first;
        if self.ends {
            step.due -= more;
        }
        arm.hold.commit(step);
    }
}

/// The number of the next `steps` (at least one) that begin before the arm's disturbance ends.
fn pushes<const N: usize>(arm: &Simulation<N>, steps: u64) -> u64 {
    let Some(disturbance) = arm.disturbance else {
        return 0;
    };
    // Times do not decrease from step to step, even with rounding.
    partition_point(steps, |step| arm.time_after(step) < disturbance.ends)
}

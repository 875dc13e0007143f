//! An arm and the steps that it is still to take.
//!
//! **Invariant:** an arm is written back once, when its last step is taken or its result is not finite.

use std::ops::ControlFlow;

use crate::math::arm::State;
use crate::math::count::partition_point;
use crate::math::integrator::Method;
use crate::math::simulation::Simulation;
use crate::math::simulation::increments::leaves_out_first_angle;

/// How a step is taken, the same in all lanes of a register.
#[derive(Debug, Clone, Copy)]
pub(super) struct StepKind {
    pub(super) method: Method,
    /// Whether the controller is on.
    pub(super) controlled: bool,
    /// Whether the dynamics look at the first angle.
    pub(super) weighs: bool,
}

impl StepKind {
    /// How many kinds there are.
    pub(super) const COUNT: usize = 4 * Method::ALL.len();

    pub(super) fn of<const N: usize>(arm: &Simulation<N>) -> Self {
        Self {
            method: arm.method,
            controlled: arm.pid.is_enabled(),
            weighs: !leaves_out_first_angle(&arm.arm),
        }
    }

    pub(super) fn all() -> impl Iterator<Item = Self> {
        Method::ALL.into_iter().flat_map(|method| {
            [(false, false), (false, true), (true, false), (true, true)].map(
                |(controlled, weighs)| Self {
                    method,
                    controlled,
                    weighs,
                },
            )
        })
    }

    /// Its place in [`StepKind::all`].
    pub(super) fn index(self) -> usize {
        4 * self.method as usize + 2 * usize::from(self.controlled) + usize::from(self.weighs)
    }
}

/// Sees the states that an arm's steps lead to, and may end them there.
pub(super) type Observer<'a, const N: usize> = Box<dyn FnMut(&State<N>) -> ControlFlow<()> + 'a>;

/// An arm on its way.
pub(super) struct Seat<'a, const N: usize> {
    pub(super) arm: &'a mut Simulation<N>,
    /// Steps that have been taken, and those still to be taken.
    taken: u64,
    left: u64,
    /// How many steps its disturbance acts in.
    pushes: u64,
    observer: Option<Observer<'a, N>>,
}

impl<'a, const N: usize> Seat<'a, N> {
    /// An arm that is to take so many steps, one at least.
    pub(super) fn new(
        arm: &'a mut Simulation<N>,
        steps: u64,
        observer: Option<Observer<'a, N>>,
    ) -> Self {
        let pushes = pushes(arm, steps);
        Self {
            arm,
            taken: 0,
            left: steps,
            pushes,
            observer,
        }
    }

    /// Takes the steps alone, in no lane.
    pub(super) fn alone(self) {
        match self.observer {
            Some(mut observe) => self.arm.advance_with(self.left, |arm| observe(arm.state())),
            None => self.arm.advance(self.left),
        };
    }

    /// How many steps it still has to take at most.
    pub(super) fn left(&self) -> u64 {
        self.left
    }

    /// How many steps can be taken before it is looked at: each, or until the disturbance ends or all are taken.
    pub(super) fn until_look(&self) -> u64 {
        if self.observer.is_some() {
            1
        } else if self.is_pushed() {
            self.left.min(self.pushes - self.taken)
        } else {
            self.left
        }
    }

    /// Whether the disturbance acts in the next step.
    pub(super) fn is_pushed(&self) -> bool {
        self.taken < self.pushes
    }

    /// Counts steps that were taken. Returns whether the disturbance ended with the last of them.
    pub(super) fn count(&mut self, steps: u64) -> bool {
        let was_pushed = self.is_pushed();
        self.taken += steps;
        self.left -= steps;
        was_pushed && !self.is_pushed()
    }

    /// Whether no more steps are to be taken from `state` on.
    pub(super) fn is_done(&mut self, state: impl FnOnce() -> State<N>) -> bool {
        let ended = match &mut self.observer {
            Some(observe) => observe(&state()).is_break(),
            None => false,
        };
        ended || self.left == 0
    }

    /// Notes the steps that were taken on the arm, and whether the next one was tried and not taken.
    pub(super) fn end(&mut self, diverged: bool) {
        self.arm.steps += self.taken;
        self.arm.steps_since_base += self.taken;
        if diverged {
            self.arm.diverge();
        }
        if self.taken + u64::from(diverged) > self.pushes {
            self.arm.disturbance = None;
        }
    }
}

/// How many of the next `steps`, one at least, begin before the arm's disturbance ends.
fn pushes<const N: usize>(arm: &Simulation<N>, steps: u64) -> u64 {
    let Some(disturbance) = arm.disturbance else {
        return 0;
    };
    // Times do not fall from step to step, rounding included.
    partition_point(steps, |step| arm.time_after(step) < disturbance.ends)
}

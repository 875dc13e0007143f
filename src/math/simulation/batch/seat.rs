//! An arm and the steps that it is still to take.
//!
//! **Invariant:** an arm is written back once, when its last step is taken or its result is not finite.

use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::math::simulation::increments::leaves_out_first_angle;
use crate::math::simulation::{Divergence, Simulation};

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
    /// How many there are.
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

/// An arm on its way.
#[derive(Debug)]
pub(super) struct Seat<'a, const N: usize> {
    pub(super) arm: &'a mut Simulation<N>,
    /// Steps taken, and to be taken still; none once it has been written back.
    pub(super) taken: u64,
    pub(super) left: u64,
    /// How many steps its disturbance acts in.
    pushes: u64,
}

impl<'a, const N: usize> Seat<'a, N> {
    pub(super) fn new(arm: &'a mut Simulation<N>, steps: u64) -> Self {
        let pushes = pushes(arm, steps);
        Self {
            arm,
            taken: 0,
            left: steps,
            pushes,
        }
    }

    /// Takes the steps without anybody beside it.
    pub(super) fn alone(&mut self) {
        self.arm.advance(self.left);
    }

    /// How many steps can be taken before the disturbance ends or all are taken.
    pub(super) fn until_change(&self) -> u64 {
        if self.is_pushed() {
            self.left.min(self.pushes - self.taken)
        } else {
            self.left
        }
    }

    /// Whether the disturbance acts in the next step.
    pub(super) fn is_pushed(&self) -> bool {
        self.taken < self.pushes
    }

    /// Notes the steps that were taken, and whether the next one was tried and not taken.
    pub(super) fn end(&mut self, taken: u64, diverged: bool) {
        self.left = 0;
        self.arm.steps += taken;
        self.arm.steps_since_base += taken;
        if diverged {
            self.arm.divergence = Some(Divergence {
                step: self.arm.steps + 1,
                time: self.arm.time(),
            });
        }
        if taken + u64::from(diverged) > self.pushes {
            self.arm.disturbance = None;
        }
    }
}

/// How many of the next `steps`, one at least, begin before the arm's disturbance ends.
fn pushes<const N: usize>(arm: &Simulation<N>, steps: u64) -> u64 {
    let Some(disturbance) = arm.disturbance else {
        return 0;
    };
    let acts = |step: u64| {
        arm.base + in_f64(arm.steps_since_base + step) * arm.timestep < disturbance.ends
    };
    if acts(steps - 1) {
        return steps;
    }
    // Times do not fall from step to step, rounding included, so halving finds the first that is too late.
    let (mut early, mut late) = (0, steps - 1);
    while early < late {
        let middle = early + (late - early) / 2;
        if acts(middle) {
            early = middle + 1;
        } else {
            late = middle;
        }
    }
    early
}

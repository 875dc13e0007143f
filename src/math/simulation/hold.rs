//! Where a step's effort comes from: the control law, run once per control period and held meanwhile; commands while
//! the controller is off; or the effort that an outside controller sets.
//!
//! A control period is `k` steps, `k` the whole number nearest to the period that was asked for over the timestep, and
//! at least 1. The law runs on the state at the start of the period, with `k` timesteps as its `dt`. With a delay, its
//! result is in force one period later, as where the computation takes as long as the period (Åström and Wittenmark,
//! Computer-Controlled Systems, 3rd ed., section 1.3).
//!
//! **Invariant:** with a period of one step and no delay the law runs in every step, with the timestep as its `dt`.

use crate::math::arm::State;
use crate::math::count::in_f64;
use crate::math::pid::{Control, Pid};

/// Most steps of a control period: whole numbers up to it are exact as `f64`. They take years.
const MOST_STEPS: u64 = 1 << 53;

/// The time between two runs of the law, and whether their answers come late.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ControlPeriod {
    /// Time as asked for \[s\], not negative; 0 stands for every step.
    pub period: f64,
    /// Whether an answer is in force one period after the state that it is about.
    pub delay: bool,
}

impl ControlPeriod {
    /// How many steps of `timestep` \[s\] it has, at least 1.
    #[must_use]
    pub fn steps(&self, timestep: f64) -> u64 {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a cast to an integer saturates, and what is no number becomes 0"
        )]
        let steps = (self.period / timestep).round() as u64;
        steps.clamp(1, MOST_STEPS)
    }

    /// Its length in whole steps of `timestep` \[s\].
    #[must_use]
    pub fn effective(&self, timestep: f64) -> f64 {
        in_f64(self.steps(timestep)) * timestep
    }
}

/// All that is held between two runs of the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Held<const N: usize> {
    /// When the law runs.
    pub period: ControlPeriod,
    /// Steps until it runs again; 0 if it does in the next step.
    pub due: u64,
    /// The controller's effort in force \[N m\].
    pub effort: [f64; N],
    /// With a delay, the effort that will be in force after it \[N m\].
    pub computed: [f64; N],
    /// Effort of clients, applied while the controller is off \[N m\].
    pub command: [f64; N],
    /// Effort that is applied instead of the controller's and of `command`, if there is one \[N m\].
    pub driven: Option<[f64; N]>,
}

/// Nothing is held: the law runs in every step.
impl<const N: usize> Default for Held<N> {
    fn default() -> Self {
        Self {
            period: ControlPeriod::default(),
            due: 0,
            effort: [0.0; N],
            computed: [0.0; N],
            command: [0.0; N],
            driven: None,
        }
    }
}

/// The held effort, with the values that follow from it and the timestep.
#[derive(Debug, Clone, PartialEq)]
pub struct Hold<const N: usize> {
    pub(in crate::math) held: Held<N>,
    /// Steps of a period.
    steps: u64,
    /// Their time \[s\].
    length: f64,
    /// Whether the law, if it is on, runs in every step and takes effect at once, and no other effort is given.
    pub(in crate::math) every_step: bool,
}

impl<const N: usize> Hold<N> {
    /// The held effort, in steps of `timestep` \[s\].
    #[must_use]
    pub fn new(held: Held<N>, timestep: f64) -> Self {
        let steps = held.period.steps(timestep);
        Self {
            steps,
            length: in_f64(steps) * timestep,
            every_step: steps == 1
                && !held.period.delay
                && held.driven.is_none()
                && held.command.iter().all(|effort| effort.to_bits() == 0),
            held,
        }
    }

    /// A period begins with the next step; `change` is made before.
    pub(super) fn begin_period(&mut self, timestep: f64, change: impl FnOnce(&mut Held<N>)) {
        let mut held = self.held;
        held.due = 0;
        change(&mut held);
        *self = Self::new(held, timestep);
    }

    /// Holds another effort of clients \[N m\].
    pub(super) fn set_command(&mut self, command: [f64; N], timestep: f64) {
        *self = Self::new(
            Held {
                command,
                ..self.held
            },
            timestep,
        );
    }

    /// Forgets all efforts; a period begins with the next step.
    pub(super) fn forget(&mut self, timestep: f64) {
        self.begin_period(timestep, |held| {
            *held = Held {
                period: held.period,
                ..Held::default()
            };
        });
    }

    /// The control of the step that begins now, from `state`, and what is held after it. The law runs if it is due.
    #[must_use]
    pub fn begin_step(&self, pid: &Pid<N>, state: &State<N>) -> (Control<N>, Held<N>) {
        let mut held = self.held;
        let mut integral = *pid.integral();
        let effort = match held.driven {
            Some(effort) => effort,
            None if !pid.is_enabled() => held.command,
            None => {
                if held.due == 0 {
                    let control = pid.control(state, self.length);
                    held.effort = if held.period.delay {
                        std::mem::replace(&mut held.computed, control.effort)
                    } else {
                        control.effort
                    };
                    integral = control.integral;
                    held.due = self.steps;
                }
                held.due -= 1;
                held.effort
            }
        };
        (Control { effort, integral }, held)
    }

    /// The step has been taken: its effort is held from now on.
    pub fn commit(&mut self, held: Held<N>) {
        self.held = held;
    }
}

//! The source of a step's effort: the control law, evaluated once per control period and held between; commands
//! while the controller is off; or the effort of an external controller.
//!
//! A control period has `k` steps. `k` is the whole number nearest to the requested period divided by the timestep,
//! and at least 1. The law runs on the state at the start of the period, with `k` timesteps as its `dt`. With a delay,
//! its result is applied one period later, as if the computation took a whole period (Åström and Wittenmark,
//! Computer-Controlled Systems, 3rd ed., section 1.3).
//!
//! Limits of the motors bound the effort when it is applied, so a new limit also bounds an effort that is already held.
//!
//! **Invariant:** with a period of one step, no delay and no limits the law runs in every step, with the timestep as its `dt`.

use crate::math::arm::State;
use crate::math::count::{in_f64, whole};
use crate::math::limits::Limits;
use crate::math::pid::{Control, Pid};

/// Most steps of a control period. Whole numbers up to it are exact as `f64`, and this number of steps takes years.
const MOST_STEPS: u64 = 1 << 53;

/// The time between two runs of the law, and whether their results are delayed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ControlPeriod {
    /// Requested time \[s\], not negative; 0 means every step.
    pub period: f64,
    /// Whether a result is applied one period after its state was read.
    pub delay: bool,
}

impl ControlPeriod {
    /// The number of steps of `timestep` \[s\] in it, at least 1.
    #[must_use]
    pub fn steps(&self, timestep: f64) -> u64 {
        whole((self.period / timestep).round()).clamp(1, MOST_STEPS)
    }

    /// Its length in whole steps of `timestep` \[s\].
    #[must_use]
    pub fn effective(&self, timestep: f64) -> f64 {
        in_f64(self.steps(timestep)) * timestep
    }
}

/// The values held between two runs of the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Held<const N: usize> {
    /// When the law runs.
    pub period: ControlPeriod,
    /// Steps until it runs again; 0 if it runs in the next step.
    pub due: u64,
    /// The controller's present effort \[N m\].
    pub effort: [f64; N],
    /// With a delay, the effort of the next period \[N m\].
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

/// The held effort, with values computed from it and the timestep.
#[derive(Debug, Clone, PartialEq)]
pub struct Hold<const N: usize> {
    pub(in crate::math) held: Held<N>,
    /// What the motors can apply. It holds for every effort here.
    pub(in crate::math) limits: Limits<N>,
    /// Steps per period.
    steps: u64,
    /// Duration of a period \[s\].
    length: f64,
    /// Whether the law, if it is on, runs in every step without delay and limits, and no other effort replaces it.
    pub(in crate::math) every_step: bool,
}

impl<const N: usize> Hold<N> {
    /// The held effort, in steps of `timestep` \[s\].
    #[must_use]
    pub fn new(held: Held<N>, limits: Limits<N>, timestep: f64) -> Self {
        let steps = held.period.steps(timestep);
        Self {
            steps,
            length: in_f64(steps) * timestep,
            every_step: steps == 1
                && !held.period.delay
                && held.driven.is_none()
                && limits.are_absent()
                && held.command.iter().all(|effort| effort.to_bits() == 0),
            held,
            limits,
        }
    }

    /// A period begins with the next step; `change` is made before.
    pub(super) fn begin_period(&mut self, timestep: f64, change: impl FnOnce(&mut Held<N>)) {
        let mut held = self.held;
        held.due = 0;
        change(&mut held);
        *self = Self::new(held, self.limits, timestep);
    }

    /// Changes the limits from the next step on, within the period.
    pub(super) fn set_limits(&mut self, limits: Limits<N>, timestep: f64) {
        *self = Self::new(self.held, limits, timestep);
    }

    /// Sets the clients' effort \[N m\].
    pub(super) fn set_command(&mut self, command: [f64; N], timestep: f64) {
        *self = Self::new(
            Held {
                command,
                ..self.held
            },
            self.limits,
            timestep,
        );
    }

    /// Clears all efforts. A period begins with the next step.
    pub(super) fn forget(&mut self, timestep: f64) {
        self.begin_period(timestep, |held| {
            *held = Held {
                period: held.period,
                ..Held::default()
            };
        });
    }

    /// The control for the step that begins now, from `state`, and the held values after it. The law runs if it is due.
    #[must_use]
    pub fn begin_step(&self, pid: &Pid<N>, state: &State<N>) -> (Control<N>, Held<N>) {
        let mut held = self.held;
        let mut integral = *pid.integral();
        let effort = match held.driven {
            Some(effort) => effort,
            None if !pid.is_enabled() => held.command,
            None => {
                if held.due == 0 {
                    let control = self.limits.control(pid, state, self.length);
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
        let effort = self.limits.applied(effort);
        (Control { effort, integral }, held)
    }

    /// The joints whose motor was at its limit in the latest step.
    pub(super) fn at_limit(&self, is_enabled: bool) -> [bool; N] {
        let held = &self.held;
        let demanded = match held.driven {
            Some(effort) => effort,
            None if is_enabled => held.effort,
            None => held.command,
        };
        self.limits.reached(&demanded)
    }

    /// Commits a step: its effort is held from now on.
    pub fn commit(&mut self, held: Held<N>) {
        self.held = held;
    }
}

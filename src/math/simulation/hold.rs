//! The source of a step's effort: the control law, evaluated once per control period and held between; commands
//! while the controller is off; or the effort of an external controller.
//!
//! A control period has `k` steps. `k` is the whole number nearest to the requested period divided by the timestep,
//! and at least 1. The law runs on what the sensors measure at the start of the period, with `k` timesteps as its `dt`.
//! With a delay, its result is applied whole periods later, as if measurement, bus and computation took so long (Åström and
//! Wittenmark, Computer-Controlled Systems, 3rd ed., section 1.3).
//!
//! Limits of the motors bound the effort when it is applied, so a new limit also bounds an effort that is already held.
//!
//! **Invariant:** with a period of one step, no delay, exact sensors and no limits the law runs in every step, with the
//! timestep as its `dt`.

use crate::math::arm::State;
use crate::math::count::{in_f64, whole};
use crate::math::limits::Limits;
use crate::math::pid::{Control, Pid};
use crate::math::sensors::{MAX_DELAY, Sensors};

/// Most steps of a control period. Whole numbers up to it are exact as `f64`, and this number of steps takes years.
const MOST_STEPS: u64 = 1 << 53;

/// The time between two runs of the law, and the delay of their results.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ControlPeriod {
    /// Requested time \[s\], not negative; 0 means every step.
    pub period: f64,
    /// The number of periods after which a result is applied, up to [`MAX_DELAY`].
    pub delay: u8,
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
    /// With a delay, the latest result of the law \[N m\].
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

/// Results of the law that wait before [`Held::computed`], if the delay is that long.
const WAITING: usize = MAX_DELAY as usize - 1;

/// What sensors and a delay of several periods remember between two runs of the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Memory<const N: usize> {
    /// The latest measurement, since the arm was last put into another state and a control period began.
    pub measured: Option<State<N>>,
    /// The efforts \[N m\] that are applied before [`Held::computed`], the next one first. There is one less than the
    /// delay has periods.
    pub waiting: [[f64; N]; WAITING],
}

impl<const N: usize> Default for Memory<N> {
    fn default() -> Self {
        Self {
            measured: None,
            waiting: [[0.0; N]; WAITING],
        }
    }
}

/// What a step changes, once it is taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct After<const N: usize> {
    /// Steps until the law runs again.
    pub(super) due: u64,
    /// The controller's effort in this step \[N m\].
    effort: [f64; N],
    /// If the law ran: what it measured, and its result \[N m\].
    ran: Option<(State<N>, [f64; N])>,
}

/// The value of [`Hold::every_step`].
#[inline(always)]
fn runs_every_step<const N: usize>(
    steps: u64,
    held: &Held<N>,
    limits: &Limits<N>,
    remembers: bool,
) -> bool {
    steps == 1
        && held.period.delay == 0
        && held.driven.is_none()
        && limits.are_absent()
        && !remembers
        && held.command.iter().all(|effort| effort.to_bits() == 0)
}

/// The held effort, with values computed from it and the timestep.
#[derive(Debug, Clone, PartialEq)]
pub struct Hold<const N: usize> {
    pub(in crate::math) held: Held<N>,
    /// What the motors can apply. It holds for every effort here.
    pub(in crate::math) limits: Limits<N>,
    pub(in crate::math) sensors: Sensors<N>,
    memory: Memory<N>,
    /// Whether the memory is used: for sensors that are not exact, and a delay of several periods.
    remembers: bool,
    /// Steps per period.
    steps: u64,
    /// Duration of a period \[s\].
    length: f64,
    /// Whether the law, if it is on, runs in every step without delay, sensors and limits, and no other effort replaces
    /// it.
    pub(in crate::math) every_step: bool,
}

impl<const N: usize> Hold<N> {
    /// The held effort, in steps of `timestep` \[s\].
    #[must_use]
    pub fn new(
        held: Held<N>,
        limits: Limits<N>,
        (sensors, memory): (Sensors<N>, Memory<N>),
        timestep: f64,
    ) -> Self {
        let steps = held.period.steps(timestep);
        let remembers = held.period.delay > 1 || !sensors.are_exact();
        Self {
            steps,
            length: in_f64(steps) * timestep,
            every_step: runs_every_step(steps, &held, &limits, remembers),
            held,
            limits,
            sensors,
            memory: if remembers { memory } else { Memory::default() },
            remembers,
        }
    }

    /// What is remembered between two runs of the law.
    pub(super) fn memory(&self) -> Memory<N> {
        self.memory
    }

    /// The same effort with other values.
    fn change(&mut self, timestep: f64, change: impl FnOnce(&mut Held<N>, &mut Memory<N>)) {
        let (mut held, mut memory) = (self.held, self.memory());
        change(&mut held, &mut memory);
        *self = Self::new(held, self.limits, (self.sensors, memory), timestep);
    }

    /// A period begins with the next step; `change` is made before. A difference of positions begins too.
    pub(super) fn begin_period(&mut self, timestep: f64, change: impl FnOnce(&mut Held<N>)) {
        self.change(timestep, |held, memory| {
            held.due = 0;
            memory.measured = None;
            let delay = held.period.delay;
            change(held);
            if held.period.delay != delay {
                memory.waiting = [held.computed; WAITING];
            }
        });
    }

    /// Changes the limits from the next step on, within the period.
    pub(super) fn set_limits(&mut self, limits: Limits<N>, timestep: f64) {
        self.limits = limits;
        self.change(timestep, |_, _| ());
    }

    /// Changes the sensors from the next run of the law on, within the period.
    pub(super) fn set_sensors(&mut self, sensors: Sensors<N>, timestep: f64) {
        self.sensors = sensors;
        self.change(timestep, |_, memory| memory.measured = None);
    }

    /// The arm is in another state, so a difference to the old one is no velocity.
    pub(super) fn forget_measurement(&mut self) {
        self.memory.measured = None;
    }

    /// Sets or ends the effort that replaces the others \[N m\]. A period begins with the next step, as in
    /// [`Hold::begin_period`], but nothing is copied: a batch does this for each arm of each call.
    pub(super) fn drive(&mut self, effort: Option<[f64; N]>) {
        self.held.due = 0;
        self.held.driven = effort;
        self.memory.measured = None;
        self.every_step = runs_every_step(self.steps, &self.held, &self.limits, self.remembers);
    }

    /// Sets the clients' effort \[N m\].
    pub(super) fn set_command(&mut self, command: [f64; N], timestep: f64) {
        self.change(timestep, |held, _| held.command = command);
    }

    /// Clears all efforts. A period begins with the next step.
    pub(super) fn forget(&mut self, timestep: f64) {
        self.change(timestep, |held, memory| {
            *held = Held {
                period: held.period,
                ..Held::default()
            };
            *memory = Memory::default();
        });
    }

    /// The control for the step that begins now, from `state`, and the held values after it. The law runs if it is due.
    #[must_use]
    pub fn begin_step(&self, pid: &Pid<N>, state: &State<N>) -> (Control<N>, After<N>) {
        let held = &self.held;
        let mut integral = *pid.integral();
        let mut after = After {
            due: held.due,
            effort: held.effort,
            ran: None,
        };
        let effort = match held.driven {
            Some(effort) => effort,
            None if !pid.is_enabled() => held.command,
            None => {
                if held.due == 0 {
                    let before = self.memory.measured.as_ref();
                    let seen = if self.remembers {
                        self.sensors.measured(state, before, self.length)
                    } else {
                        *state
                    };
                    let control = self.limits.control(pid, &seen, self.length);
                    after.effort = match held.period.delay {
                        0 => control.effort,
                        1 => held.computed,
                        _ => self.memory.waiting[0],
                    };
                    after.ran = Some((seen, control.effort));
                    after.due = self.steps;
                    integral = control.integral;
                }
                after.due -= 1;
                after.effort
            }
        };
        let effort = self.limits.applied(effort);
        (Control { effort, integral }, after)
    }

    /// What the law measured in its latest run, or what it would measure in its first one.
    pub(super) fn measured(&self, state: &State<N>) -> State<N> {
        let latest = self.memory.measured;
        latest.unwrap_or_else(|| self.sensors.measured(state, None, self.length))
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
    #[cold]
    pub fn commit(&mut self, after: After<N>) {
        let held = &mut self.held;
        held.due = after.due;
        held.effort = after.effort;
        let Some((seen, result)) = after.ran else {
            return;
        };
        if self.remembers {
            self.memory.measured = Some(seen);
            // The result before this one waits in its turn.
            let last = usize::from(held.period.delay).saturating_sub(2);
            self.memory.waiting.copy_within(1.., 0);
            if let Some(place) = self.memory.waiting.get_mut(last) {
                *place = held.computed;
            }
        }
        if held.period.delay > 0 {
            held.computed = result;
        }
    }
}

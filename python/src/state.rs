//! Simulations as bytes: a head, and the numbers of each checkpoint.
//!
//! **Invariant:** a simulation of read bytes is valid, and takes the steps of the written one, bit for bit.

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::limits::{AntiWindup, Limits};
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::sensors::{MAX_DELAY, Sensors, VelocitySource};
use pendularm::math::simulation::{Checkpoint, ControlPeriod, Held, Memory, Simulation};
use pyo3::prelude::{PyErr, PyResult, Python};
use pyo3::types::{PyBytes, PyBytesMethods};

use crate::arrays::room;
use crate::fields::{self, Bound, Object, refused};
use crate::floats::Promised;

/// The start of a state. Its last character is the version of this form.
const HEAD: &[u8] = b"pendularm state 2";

/// Most steps of a state, years of simulation. One more step fits into a `u64`.
const MOST_STEPS: u64 = 1 << 62;

/// Bytes of the checkpoint of an arm of `links` links.
const fn length(links: usize) -> usize {
    8 * (38 * links + 21)
}

/// The state of some simulations.
pub(crate) fn written<'py, const N: usize>(
    py: Python<'py>,
    all: &[Simulation<N>],
) -> PyResult<fields::Held<'py, PyBytes>> {
    let size = HEAD.len() + all.len() * length(N);
    PyBytes::new_with(py, size, |bytes| {
        let (head, rest) = bytes.split_at_mut(HEAD.len());
        head.copy_from_slice(HEAD);
        for (one, place) in all.iter().zip(rest.chunks_exact_mut(length(N))) {
            let words = words(&one.checkpoint());
            for (word, place) in words.zip(place.chunks_exact_mut(8)) {
                place.copy_from_slice(&word.to_le_bytes());
            }
        }
        Ok(())
    })
}

/// The numbers of a checkpoint, in the order of [`Reader::checkpoint`].
fn words<const N: usize>(one: &Checkpoint<N>) -> impl Iterator<Item = u64> + use<N> {
    let (pushed, push, ends) = match one.disturbance {
        Some((effort, ends)) => (1, effort, ends),
        None => (0, [0.0; N], 0.0),
    };
    let (diverged, step, time) = match one.divergence {
        Some((step, time)) => (1, step, time),
        None => (0, 0, 0.0),
    };
    let wholes = [
        u64::from(one.enabled),
        u64::from(one.held.period.delay),
        one.held.due,
        u64::from(one.held.driven.is_some()),
        place(&Method::ALL, one.method),
        one.steps_since_base,
        one.steps,
        pushed,
        diverged,
        step,
        place(&AntiWindup::ALL, one.limits.anti_windup),
        place(&VelocitySource::ALL, one.sensors.velocity),
        u64::from(one.limits.effort.is_some()),
        u64::from(one.memory.measured.is_some()),
    ];
    let numbers = [
        one.arm.gravity(),
        one.held.period.period,
        one.timestep,
        one.base,
        ends,
        time,
        one.limits.tracking_time,
    ];
    let measured = one.memory.measured.unwrap_or(State::rest());
    let joints = [
        *one.arm.lengths(),
        *one.arm.masses(),
        one.gains.kp,
        one.gains.ki,
        one.gains.kd,
        one.setpoint.position,
        one.setpoint.velocity,
        one.integral,
        one.held.effort,
        one.held.computed,
        one.held.command,
        one.held.driven.unwrap_or([0.0; N]),
        one.state.position,
        one.state.velocity,
        one.carry.position,
        one.carry.velocity,
        one.effort,
        push,
        *one.arm.viscous(),
        one.limits.effort.unwrap_or([0.0; N]),
        one.sensors.encoder_step,
        measured.position,
        measured.velocity,
    ];
    let joints = joints.into_iter().chain(one.memory.waiting);
    let numbers = numbers.into_iter().chain(joints.flatten());
    wholes.into_iter().chain(numbers.map(f64::to_bits))
}

/// The index of a choice.
fn place<T: PartialEq>(all: &[T], one: T) -> u64 {
    let found = all.iter().position(|each| *each == one);
    u64::try_from(found.unwrap_or(0)).unwrap_or(0)
}

/// The simulations of a state, as many as `count`.
///
/// # Errors
/// `ValueError` for bytes that are not the state of so many arms of `N` links, or for a `further` argument.
pub(crate) fn read<const N: usize>(
    state: &fields::Held<'_, PyBytes>,
    count: usize,
    further: Option<&Object<'_>>,
) -> PyResult<Vec<Simulation<N>>> {
    if let Some(further) = further {
        return Err(refused(format_args!(
            "a state of get_state must be the only argument, got {}",
            fields::shown(further)
        )));
    }
    let wrong = || -> PyErr {
        refused(format_args!(
            "q must be an array of numbers, or a state of get_state of {count} arms of {N} links"
        ))
    };
    let _floats = Promised::begin();
    let body = state.as_bytes().strip_prefix(HEAD).ok_or_else(wrong)?;
    if body.len() != count * length(N) {
        return Err(wrong());
    }
    let mut all = room(count)?;
    for part in body.chunks_exact(length(N)) {
        all.push(Reader(part).checkpoint().ok_or_else(wrong)?);
    }
    Ok(all)
}

/// The rest of a checkpoint's bytes.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn whole(&mut self) -> Option<u64> {
        let (word, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(u64::from_le_bytes(*word))
    }

    fn flag(&mut self) -> Option<bool> {
        let whole = self.whole()?;
        (whole <= 1).then_some(whole == 1)
    }

    fn number(&mut self, bound: Bound) -> Option<f64> {
        let number = f64::from_bits(self.whole()?);
        bound.admits(number).then_some(number)
    }

    fn joints<const N: usize>(&mut self, bound: Bound) -> Option<[f64; N]> {
        let mut joints = [0.0; N];
        for joint in &mut joints {
            *joint = self.number(bound)?;
        }
        Some(joints)
    }

    fn state<const N: usize>(&mut self) -> Option<State<N>> {
        Some(State {
            position: self.joints(Bound::Finite)?,
            velocity: self.joints(Bound::Finite)?,
        })
    }

    /// A choice by its index.
    fn choice<T: Copy>(&mut self, all: &[T]) -> Option<T> {
        all.get(usize::try_from(self.whole()?).ok()?).copied()
    }

    fn checkpoint<const N: usize>(mut self) -> Option<Simulation<N>> {
        let enabled = self.flag()?;
        let delay = u8::try_from(self.whole()?).ok();
        let delay = delay.filter(|delay| *delay <= MAX_DELAY)?;
        let due = self.whole()?;
        let is_driven = self.flag()?;
        let method = self.choice(&Method::ALL)?;
        let (steps_since_base, steps) = (self.whole()?, self.whole()?);
        let (is_pushed, has_diverged) = (self.flag()?, self.flag()?);
        let step = self.whole()?;
        let (anti_windup, velocity) = (
            self.choice(&AntiWindup::ALL)?,
            self.choice(&VelocitySource::ALL)?,
        );
        let (is_limited, has_measured) = (self.flag()?, self.flag()?);
        let gravity = self.number(Bound::NotNegative)?;
        let period = self.number(Bound::NotNegative)?;
        let timestep = self.number(Bound::Positive)?;
        let base = self.number(Bound::NotNegative)?;
        let (ends, time) = (
            f64::from_bits(self.whole()?),
            self.number(Bound::NotNegative)?,
        );
        let tracking_time = self.number(Bound::Positive)?;
        let (lengths, masses) = (self.joints(Bound::Positive)?, self.joints(Bound::Positive)?);
        let mut gain = || self.joints(Bound::NotNegative);
        let gains = Gains {
            kp: gain()?,
            ki: gain()?,
            kd: gain()?,
        };
        let mut joints = || self.joints(Bound::Finite);
        let setpoint = Setpoint {
            position: joints()?,
            velocity: joints()?,
        };
        let integral = joints()?;
        let (effort, computed, command) = (joints()?, joints()?, joints()?);
        let driven = joints()?;
        let held = Held {
            period: ControlPeriod { period, delay },
            due,
            effort,
            computed,
            command,
            driven: is_driven.then_some(driven),
        };
        let (state, carry) = (self.state()?, self.state()?);
        let (effort_of_step, push) = (self.joints(Bound::Finite)?, self.joints(Bound::Finite)?);
        let viscous = self.joints(Bound::NotNegative)?;
        let limit = self.joints(Bound::Limit)?;
        let encoder_step = self.joints(Bound::NotNegative)?;
        let measured = self.state()?;
        let mut memory = Memory {
            measured: has_measured.then_some(measured),
            ..Memory::default()
        };
        for waiting in &mut memory.waiting {
            *waiting = self.joints(Bound::Finite)?;
        }
        let arm = Arm::new(lengths, masses, gravity).ok()?;
        let checkpoint = Checkpoint {
            arm: arm.with_friction(viscous).ok()?,
            gains,
            setpoint,
            integral,
            enabled,
            held,
            limits: Limits {
                effort: is_limited.then_some(limit),
                anti_windup,
                tracking_time,
            },
            sensors: Sensors {
                encoder_step,
                velocity,
            },
            memory,
            method,
            timestep,
            state,
            carry,
            effort: effort_of_step,
            disturbance: Some((push, ends)).filter(|_| is_pushed && !ends.is_nan()),
            base,
            steps_since_base,
            steps,
            divergence: has_diverged.then_some((step, time)),
        };
        let one = Simulation::continued(&checkpoint);
        let is_counted = steps.max(steps_since_base).max(step) <= MOST_STEPS;
        (is_counted && one.time().is_finite()).then_some(one)
    }
}

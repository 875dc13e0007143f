//! Arms in the lanes of a few pairs of registers, and their steps.
//!
//! **Invariant:** a lane whose arm has left holds one that rests without gravity, so that it can go on stepping beside
//! the others without ever diverging.

#![allow(
    clippy::indexing_slicing,
    reason = "joints run over 0..N of arrays that have N elements, lanes over those of a pair of registers"
)]

use std::array::from_fn;

use fearless_simd::Simd;

use super::seat::{Seat, StepKind};
use crate::math::arm::{Rod, State};
use crate::math::dynamics::recursion;
use crate::math::integrator::Method;
use crate::math::number::{Number, Wide, entries};
use crate::math::pid::{Control, Gains, Setpoint, law};
use crate::math::simulation::Simulation;
use crate::math::simulation::increments::stepped;

/// Registers that do each operation one behind the other.
const K: usize = 2;

/// Pairs of registers that take each step in turn.
pub(super) const PAIRS: usize = 2;

/// A few pairs' worth of arms of one kind.
pub(super) struct Formation<'s, 'a, S: Simd, const N: usize> {
    pairs: [Lanes<Wide<S, K>, N>; PAIRS],
    seats: &'s mut [Seat<'a, N>],
}

impl<'s, 'a, S: Simd, const N: usize> Formation<'s, 'a, S, N> {
    /// Gives every arm a lane; there are enough.
    #[inline(always)]
    pub(super) fn new(simd: S, seats: &'s mut [Seat<'a, N>]) -> Self {
        let mut pairs = [Lanes::resting(Wide::<S, K>::splat(simd, 0.0)); PAIRS];
        for (lanes, seats) in pairs.iter_mut().zip(seats.chunks(Wide::<S, K>::LANES)) {
            for (lane, seat) in seats.iter().enumerate() {
                lanes.seat(lane, seat);
            }
        }
        Self { pairs, seats }
    }

    /// Takes all steps of all arms.
    #[inline(always)]
    pub(super) fn run(mut self, kind: StepKind) {
        while let Some(steps) = self.until_change() {
            if kind.weighs {
                self.take_steps::<true>(kind, steps);
            } else {
                self.take_steps::<false>(kind, steps);
            }
            self.look(steps);
        }
    }

    /// How many steps all arms take before one of them has a change.
    fn until_change(&self) -> Option<u64> {
        let still = self.seats.iter().filter(|seat| seat.left > 0);
        still.map(Seat::until_change).min()
    }

    #[inline(always)]
    fn take_steps<const WEIGHS: bool>(&mut self, kind: StepKind, steps: u64) {
        let used = self.seats.len().div_ceil(Wide::<S, K>::LANES);
        for step in 0..steps {
            for (index, lanes) in self.pairs.iter_mut().take(used).enumerate() {
                let mut next = lanes.next::<WEIGHS>(kind.method, kind.controlled);
                if !Wide::<S, K>::all_finite(&next.state.position, &next.state.velocity) {
                    // Moved out of the way, so that otherwise nothing has to be in memory.
                    let mut parted = next;
                    let first = index * Wide::<S, K>::LANES;
                    part(lanes, &mut parted, &mut self.seats[first..], step);
                    next = parted;
                }
                lanes.moving = next;
            }
        }
    }

    /// Counts the steps, has arms leave that have taken theirs, and ends disturbances.
    fn look(&mut self, steps: u64) {
        let chunks = self.seats.chunks_mut(Wide::<S, K>::LANES);
        for (lanes, seats) in self.pairs.iter_mut().zip(chunks) {
            for (lane, seat) in seats
                .iter_mut()
                .enumerate()
                .filter(|(_, seat)| seat.left > 0)
            {
                seat.taken += steps;
                seat.left -= steps;
                if seat.left == 0 {
                    lanes.moving.write(lane, seat.arm);
                    seat.end(seat.taken, false);
                    lanes.rest(lane);
                } else if !seat.is_pushed() {
                    lanes
                        .push
                        .iter_mut()
                        .for_each(|push| push.set_lane(lane, -0.0));
                }
            }
        }
    }
}

/// Has the arms leave whose next state is not finite; before it they took `step` steps of this run.
#[cold]
#[inline(never)]
fn part<T: Number, const N: usize>(
    lanes: &mut Lanes<T, N>,
    next: &mut Moving<T, N>,
    seats: &mut [Seat<'_, N>],
    step: u64,
) {
    for (lane, seat) in (0..T::LANES).zip(seats) {
        if !next.is_finite(lane) {
            lanes.moving.write(lane, seat.arm);
            seat.end(seat.taken + step, true);
            lanes.rest(lane);
            next.set(lane, &Moving::resting(0.0));
        }
    }
}

/// The parts of arms that a step changes.
#[derive(Clone, Copy)]
struct Moving<T, const N: usize> {
    state: State<N, T>,
    carry: State<N, T>,
    effort: [T; N],
    integral: [T; N],
}

impl<T: Number, const N: usize> Moving<T, N> {
    #[inline(always)]
    fn resting(zero: T) -> Self {
        let at_rest = State {
            position: [zero; N],
            velocity: [zero; N],
        };
        Self {
            state: at_rest,
            carry: at_rest,
            effort: [zero; N],
            integral: [zero; N],
        }
    }

    fn set(&mut self, lane: usize, arm: &Moving<f64, N>) {
        let into = |lanes: &mut [T; N], values: &[f64; N]| {
            for (lanes, value) in lanes.iter_mut().zip(values) {
                lanes.set_lane(lane, *value);
            }
        };
        into(&mut self.state.position, &arm.state.position);
        into(&mut self.state.velocity, &arm.state.velocity);
        into(&mut self.carry.position, &arm.carry.position);
        into(&mut self.carry.velocity, &arm.carry.velocity);
        into(&mut self.effort, &arm.effort);
        into(&mut self.integral, &arm.integral);
    }

    fn write(&self, lane: usize, arm: &mut Simulation<N>) {
        let from = |lanes: &[T; N]| from_fn(|i| lanes[i].lane(lane));
        let state = |state: &State<N, T>| State {
            position: from(&state.position),
            velocity: from(&state.velocity),
        };
        arm.state = state(&self.state);
        arm.carry = state(&self.carry);
        arm.effort = from(&self.effort);
        arm.pid.commit(from(&self.integral));
    }

    fn is_finite(&self, lane: usize) -> bool {
        let State { position, velocity } = &self.state;
        position
            .iter()
            .chain(velocity)
            .all(|values| values.lane(lane).is_finite())
    }
}

/// As many arms as a pair of registers has lanes.
#[derive(Clone, Copy)]
struct Lanes<T, const N: usize> {
    moving: Moving<T, N>,
    rods: [Rod<T>; N],
    gravity: T,
    gains: Gains<N, T>,
    setpoint: Setpoint<N, T>,
    timestep: T,
    /// The disturbance; -0 where there is none, which is what changes no number by being added to it.
    push: [T; N],
}

impl<T: Number, const N: usize> Lanes<T, N> {
    /// Lanes without arms.
    #[inline(always)]
    fn resting(zero: T) -> Self {
        let one = zero.like(1.0);
        Self {
            moving: Moving::resting(zero),
            rods: [Rod {
                length: one,
                beyond: zero,
                mass_ratio: one,
                per_length: one,
                per_mass_length: one,
            }; N],
            gravity: zero,
            gains: Gains {
                kp: [zero; N],
                ki: [zero; N],
                kd: [zero; N],
            },
            setpoint: Setpoint {
                position: [zero; N],
                velocity: [zero; N],
            },
            timestep: zero,
            push: [zero; N],
        }
    }

    /// Puts an arm into a lane.
    fn seat(&mut self, lane: usize, seat: &Seat<'_, N>) {
        let arm = &*seat.arm;
        let (gains, setpoint) = (arm.pid.gains(), arm.pid.setpoint());
        let moving = Moving {
            state: arm.state,
            carry: arm.carry,
            effort: arm.effort,
            integral: *arm.pid.integral(),
        };
        let push = match arm.disturbance {
            Some(disturbance) if seat.is_pushed() => disturbance.effort,
            _ => [-0.0; N],
        };
        self.set(
            lane,
            &Lanes {
                moving,
                rods: arm.arm.rods,
                gravity: arm.arm.gravity(),
                gains: *gains,
                setpoint: *setpoint,
                timestep: arm.timestep,
                push,
            },
        );
    }

    /// Has nobody in a lane.
    fn rest(&mut self, lane: usize) {
        self.set(lane, &Lanes::resting(0.0));
    }

    fn set(&mut self, lane: usize, arm: &Lanes<f64, N>) {
        let set = |lanes: &mut T, value: f64| lanes.set_lane(lane, value);
        self.moving.set(lane, &arm.moving);
        for i in 0..N {
            set(&mut self.rods[i].length, arm.rods[i].length);
            set(&mut self.rods[i].mass_ratio, arm.rods[i].mass_ratio);
            set(&mut self.rods[i].per_length, arm.rods[i].per_length);
            set(
                &mut self.rods[i].per_mass_length,
                arm.rods[i].per_mass_length,
            );
            set(&mut self.gains.kp[i], arm.gains.kp[i]);
            set(&mut self.gains.ki[i], arm.gains.ki[i]);
            set(&mut self.gains.kd[i], arm.gains.kd[i]);
            set(&mut self.setpoint.position[i], arm.setpoint.position[i]);
            set(&mut self.setpoint.velocity[i], arm.setpoint.velocity[i]);
            set(&mut self.push[i], arm.push[i]);
        }
        set(&mut self.gravity, arm.gravity);
        set(&mut self.timestep, arm.timestep);
    }

    /// Where the next step leads to.
    #[inline(always)]
    fn next<const WEIGHS: bool>(&self, method: Method, controlled: bool) -> Moving<T, N> {
        let Moving {
            state,
            carry,
            integral,
            ..
        } = &self.moving;
        let zero = self.timestep.like(0.0);
        let Control { effort, integral } = if controlled {
            law(&self.gains, &self.setpoint, integral, state, self.timestep)
        } else {
            Control {
                effort: [zero; N],
                integral: *integral,
            }
        };
        let effort = entries!(zero, i => effort[i] + self.push[i]);
        let (state, carry) = stepped(
            #[inline(always)]
            |_, q: &[T; N], v: &[T; N]| {
                recursion::<T, N, WEIGHS>(&self.rods, &self.gravity, q, v, &effort)
            },
            method,
            state,
            carry,
            self.timestep,
        );
        Moving {
            state,
            carry,
            effort,
            integral,
        }
    }
}

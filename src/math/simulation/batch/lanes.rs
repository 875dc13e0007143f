//! The arms in the lanes of a pair of registers: loading, storing and stepping.
//!
//! **Invariant:** no lane depends on another.

#![allow(
    clippy::indexing_slicing,
    reason = "joints run over 0..N of arrays that have N elements, lanes over those of a pair of registers"
)]

use std::array::from_fn;

use fearless_simd::Simd;

use super::job::BatchJob;
use crate::math::arm::{Rod, State};
use crate::math::dynamics::{less_friction, recursion};
use crate::math::integrator::Method;
use crate::math::number::{Arithmetic, Number, Wide, apart, entries};
use crate::math::pid::{Control, Gains, Setpoint, law};
use crate::math::simulation::Simulation;
use crate::math::simulation::increments::stepped;

/// The parts of arms that a step changes.
#[derive(Clone, Copy)]
pub(super) struct Moving<T, const N: usize> {
    pub(super) state: State<N, T>,
    carry: State<N, T>,
    effort: [T; N],
    integral: [T; N],
}

impl<T: Number, const N: usize> Moving<T, N> {
    #[inline(always)]
    pub(super) fn resting(zero: T) -> Self {
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

    pub(super) fn set(&mut self, lane: usize, arm: &Moving<f64, N>) {
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

    pub(super) fn write(&self, lane: usize, arm: &mut Simulation<N>) {
        arm.state = self.state(lane);
        arm.carry = state_in(lane, &self.carry);
        arm.effort = joints_in(lane, &self.effort);
        arm.pid.commit(joints_in(lane, &self.integral));
    }

    /// The state in a lane.
    pub(super) fn state(&self, lane: usize) -> State<N> {
        state_in(lane, &self.state)
    }

    pub(super) fn is_finite(&self, lane: usize) -> bool {
        let State { position, velocity } = &self.state;
        position
            .iter()
            .chain(velocity)
            .all(|values| values.lane(lane).is_finite())
    }
}

fn state_in<T: Number, const N: usize>(lane: usize, state: &State<N, T>) -> State<N> {
    State {
        position: joints_in(lane, &state.position),
        velocity: joints_in(lane, &state.velocity),
    }
}

fn joints_in<T: Number, const N: usize>(lane: usize, joints: &[T; N]) -> [f64; N] {
    from_fn(|i| joints[i].lane(lane))
}

/// As many arms as a pair of registers has lanes.
#[derive(Clone, Copy)]
pub(super) struct Lanes<T, const N: usize> {
    pub(super) moving: Moving<T, N>,
    rods: [Rod<T>; N],
    gravity: T,
    viscous: [T; N],
    gains: Gains<N, T>,
    setpoint: Setpoint<N, T>,
    timestep: T,
    /// The effort if no law runs: held, commanded, or set by a client.
    given: [T; N],
    /// The disturbance. Without one it is -0, because adding -0 changes no number.
    push: [T; N],
}

impl<T: Number, const N: usize> Lanes<T, N> {
    /// Lanes without arms.
    #[inline(always)]
    pub(super) fn resting(zero: T) -> Self {
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
            viscous: [zero; N],
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
            given: [zero; N],
            push: [zero; N],
        }
    }

    /// Loads an arm into a lane.
    pub(super) fn place(&mut self, lane: usize, job: &mut BatchJob<'_, N>) {
        let state = job.arm.state;
        let integral = job.begin_period(&state, || [0.0; N]);
        let arm = &*job.arm;
        let (gains, setpoint) = (arm.pid.gains(), arm.pid.setpoint());
        let moving = Moving {
            state: arm.state,
            carry: arm.carry,
            effort: arm.effort,
            integral,
        };
        let push = match arm.disturbance {
            Some(disturbance) if job.is_pushed() => disturbance.effort,
            _ => [-0.0; N],
        };
        self.set(
            lane,
            &Lanes {
                moving,
                rods: arm.arm.rods,
                gravity: arm.arm.gravity(),
                viscous: *arm.arm.viscous(),
                gains: *gains,
                setpoint: *setpoint,
                timestep: arm.timestep,
                given: job.given(),
                push,
            },
        );
    }

    /// Ends the disturbance in a lane.
    pub(super) fn end_push(&mut self, lane: usize) {
        for push in &mut self.push {
            push.set_lane(lane, -0.0);
        }
    }

    /// Begins a control period in a lane.
    pub(super) fn begin_period(&mut self, lane: usize, job: &mut BatchJob<'_, N>) {
        let integral = job.begin_period(&self.moving.state(lane), || {
            joints_in(lane, &self.moving.integral)
        });
        let given = job.given();
        for i in 0..N {
            self.moving.integral[i].set_lane(lane, integral[i]);
            self.given[i].set_lane(lane, given[i]);
        }
    }

    /// Empties a lane.
    pub(super) fn rest(&mut self, lane: usize) {
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
            set(&mut self.viscous[i], arm.viscous[i]);
            set(&mut self.given[i], arm.given[i]);
            set(&mut self.push[i], arm.push[i]);
        }
        set(&mut self.gravity, arm.gravity);
        set(&mut self.timestep, arm.timestep);
    }
}

impl<S: Simd, const K: usize, const N: usize> Lanes<Wide<S, K>, N> {
    /// The state after the next step.
    #[inline(always)]
    pub(super) fn next<const USES_FIRST_ANGLE: bool, const HAS_FRICTION: bool>(
        &self,
        method: Method,
        controlled: bool,
    ) -> Moving<Wide<S, K>, N> {
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
                effort: self.given,
                integral: *integral,
            }
        };
        let effort = entries!(zero, i => effort[i] + self.push[i]);
        // All methods except Euler's share one copy of the dynamics here too, instead of eight.
        let (state, carry) = if method == Method::Euler {
            stepped(
                #[inline(always)]
                |_, q, v| self.accelerations::<USES_FIRST_ANGLE, HAS_FRICTION>(q, v, &effort),
                Method::Euler,
                state,
                carry,
                self.timestep,
            )
        } else {
            let shared = |_, q: &_, v: &_| {
                apart(
                    self.timestep.token(),
                    #[inline(always)]
                    || self.accelerations::<USES_FIRST_ANGLE, HAS_FRICTION>(q, v, &effort),
                )
            };
            stepped(shared, method, state, carry, self.timestep)
        };
        Moving {
            state,
            carry,
            effort,
            integral,
        }
    }

    #[inline(always)]
    fn accelerations<const USES_FIRST_ANGLE: bool, const HAS_FRICTION: bool>(
        &self,
        q: &[Wide<S, K>; N],
        v: &[Wide<S, K>; N],
        effort: &[Wide<S, K>; N],
    ) -> [Wide<S, K>; N] {
        if HAS_FRICTION {
            let effort = &less_friction(&self.viscous, v, effort);
            recursion::<_, N, USES_FIRST_ANGLE>(&self.rods, &self.gravity, q, v, effort)
        } else {
            recursion::<_, N, USES_FIRST_ANGLE>(&self.rods, &self.gravity, q, v, effort)
        }
    }
}

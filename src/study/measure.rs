//! The largest stable timestep, measured: the arm itself is nudged off its equilibrium and watched.
//!
//! Held control runs through [`Simulation`], the live loop; control in every stage through [`ContinuousLoop`], where the
//! method steps the arm and its law as one system. Stable means that the deviation decays. "Did it overflow?" would be
//! the wrong question: just past the limit a nonlinear arm chatters between two poses for ever. And decay is judged by
//! energy, `½ v M v + ½ x (Kp + ∂G/∂q) x`, which a loop with damping can only lose; single joints may well move further off
//! for a while, as others come back.
//!
//! **Invariant:** no prediction enters but the equilibrium and a timestep to start the search from.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N and 0..2N of arrays of these lengths"
)]

use super::linear::{equilibrium, gravity_gradient, no_control};
use super::stability::Sampling;
use crate::math::arm::{Arm, State};
use crate::math::dynamics::{forward_dynamics, gravity_load, mass_matrix};
use crate::math::integrator::{Method, increment};
use crate::math::pid::{Gains, INTEGRAL_LIMIT, Pid, Setpoint};
use crate::math::simulation::Simulation;

/// Steps for which a deviation is watched: a mode that is off the unit circle by 0.1 % changes 50-fold meanwhile.
pub const STEPS: u64 = 4000;

/// The nudge \[rad\]; small, so that what is linear shows, and a billion units of rounding.
const NUDGE: f64 = 1e-6;

/// A deviation, or a velocity times the timestep, that has made its point \[rad\]: two thousand nudges, and still less than
/// the chatter past a limit.
const ESCAPED: f64 = 2e-3;

/// A deviation that has died \[rad\]; a hundred thousand units of rounding, which would otherwise be compared next.
const DEAD: f64 = 1e-11;

/// Halvings of the search interval; the last one is narrower than 0.005 %.
const HALVINGS: u32 = 15;

/// Widenings of the search interval before the search is given up.
const WIDENINGS: u32 = 12;

/// An arm under control, and how it is stepped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting<const N: usize> {
    /// The arm.
    pub arm: Arm<N>,
    /// Gains; all zero for an arm left to itself.
    pub gains: Gains<N>,
    /// What it is held at.
    pub setpoint: Setpoint<N>,
    /// The method.
    pub method: Method,
    /// When the control law looks at the state.
    pub sampling: Sampling,
}

impl<const N: usize> Setting<N> {
    /// The largest timestep \[s\] at which a deviation decays, searched around `guess`; `None` if none within some
    /// thousandfold of it divides what decays from what does not.
    #[must_use]
    pub fn measured_limit(&self, guess: f64) -> Option<f64> {
        boundary(guess, |timestep| self.decays(timestep))
    }

    /// As [`Setting::measured_limit`] for the control period, with `substeps` steps of the method in each; `delayed`: every
    /// effort acts one period late.
    #[must_use]
    pub fn measured_period(&self, guess: f64, substeps: u32, delayed: bool) -> Option<f64> {
        boundary(guess, |period| {
            self.sampled_growth(period, substeps, delayed)
                .is_some_and(|growth| growth < 1.0)
        })
    }

    /// Whether a small deviation from the equilibrium has less energy at the end of [`STEPS`] steps of `timestep` \[s\] than
    /// soon after their beginning.
    #[must_use]
    pub fn decays(&self, timestep: f64) -> bool {
        self.growth(timestep).is_some_and(|growth| growth < 1.0)
    }

    /// Largest energy of the deviation in the last eighth of the steps, per largest in the second eighth: in the first, modes
    /// die out that say nothing about the last to do so. `None` once the deviation has escaped.
    #[must_use]
    pub fn growth(&self, timestep: f64) -> Option<f64> {
        let rest = equilibrium(&self.arm, &self.gains, &self.setpoint);
        let start = nudged(&rest.position, timestep);
        let energy = self.energy_about(&rest.position, timestep);
        match self.sampling {
            Sampling::Held => {
                let mut live = self.primed(&rest.integral, timestep)?;
                live.set_state(start);
                watch(|| live.step().then(|| energy(live.state())).flatten())
            }
            Sampling::Continuous => {
                let mut whole = ContinuousLoop {
                    setting: *self,
                    state: start,
                    integral: rest.integral,
                };
                watch(|| whole.step(timestep).then(|| energy(&whole.state)).flatten())
            }
        }
    }

    /// As [`Setting::growth`], per control period of `substeps` steps, each effort one period late if `delayed`.
    #[must_use]
    pub fn sampled_growth(&self, period: f64, substeps: u32, delayed: bool) -> Option<f64> {
        let rest = equilibrium(&self.arm, &self.gains, &self.setpoint);
        let energy = self.energy_about(&rest.position, period);
        let mut state = nudged(&rest.position, period);
        let mut pid = Pid::new(self.gains);
        pid.set_setpoint(self.setpoint);
        pid.enable(true);
        pid.commit(rest.integral);
        let h = period / f64::from(substeps.max(1));
        let mut late = gravity_load(&self.arm, &rest.position);
        watch(|| {
            let control = pid.control(&state, period);
            pid.commit(control.integral);
            let acting = if delayed { late } else { control.effort };
            late = control.effort;
            for _ in 0..substeps.max(1) {
                let (dq, dv) = increment(
                    self.method,
                    |_, q, v| forward_dynamics(&self.arm, q, v, &acting),
                    0.0,
                    &state.position,
                    &state.velocity,
                    h,
                );
                state = moved(&state, &dq, &dv);
            }
            energy(&state)
        })
    }

    /// The energy of a deviation from `rest` \[J\], zero below [`DEAD`]; `None` beyond [`ESCAPED`].
    fn energy_about(&self, rest: &[f64; N], h: f64) -> impl Fn(&State<N>) -> Option<f64> {
        let mass = mass_matrix(&self.arm, rest);
        let gravity = gravity_gradient(&self.arm, rest);
        let (rest, kp) = (*rest, self.gains.kp);
        move |state| {
            let x: [f64; N] = std::array::from_fn(|i| state.position[i] - rest[i]);
            let v = &state.velocity;
            if (0..N).all(|i| x[i].abs() < DEAD && h * v[i].abs() < DEAD) {
                return Some(0.0);
            }
            let mut energy = 0.0;
            for i in 0..N {
                energy += 0.5 * kp[i] * x[i] * x[i];
                for j in 0..N {
                    let kinetic = v[i] * mass[i][j] * v[j];
                    energy += 0.5 * (kinetic + x[i] * gravity[i.max(j)] * x[j]);
                }
            }
            // Past a flip of held control the velocity chatters, and the position hardly moves. NaN has escaped too.
            (0..N)
                .all(|i| x[i].abs() <= ESCAPED && h * v[i].abs() <= ESCAPED)
                .then_some(energy.abs())
        }
    }

    /// The live loop with its integral where the equilibrium needs it. An integral cannot be set; but one step without
    /// gains, at a setpoint that is off by the right amount, leaves just that.
    fn primed(&self, integral: &[f64; N], timestep: f64) -> Option<Simulation<N>> {
        let mut live = Simulation::new(self.arm, no_control());
        live.set_method(self.method);
        live.set_timestep(timestep);
        live.enable(true);
        live.set_setpoint(Setpoint {
            position: integral.map(|integral| integral / timestep),
            velocity: [0.0; N],
        });
        let primed = live.step();
        live.set_gains(self.gains);
        live.set_setpoint(self.setpoint);
        primed.then_some(live)
    }
}

/// A state a little off `position`, no two joints alike, so that every mode gets its part: fast ones through the velocity.
pub(super) fn nudged<const N: usize>(position: &[f64; N], timestep: f64) -> State<N> {
    let mut state = State {
        position: *position,
        velocity: [0.0; N],
    };
    let mut nudge = NUDGE;
    for i in 0..N {
        state.position[i] += nudge;
        state.velocity[i] -= 0.5 * nudge / timestep;
        nudge *= -0.618;
    }
    state
}

pub(super) fn moved<const N: usize>(state: &State<N>, dq: &[f64; N], dv: &[f64; N]) -> State<N> {
    State {
        position: std::array::from_fn(|i| state.position[i] + dq[i]),
        velocity: std::array::from_fn(|i| state.velocity[i] + dv[i]),
    }
}

/// The boundary above which `holds` no longer does, by bisection around `guess`.
pub(super) fn boundary(guess: f64, holds: impl Fn(f64) -> bool) -> Option<f64> {
    let (mut below, mut above) = (0.5 * guess, 2.0 * guess);
    let mut widenings = 0;
    while !holds(below) {
        above = below;
        below *= 0.5;
        widenings += 1;
        if widenings > WIDENINGS {
            return None;
        }
    }
    while holds(above) {
        below = above;
        above *= 2.0;
        widenings += 1;
        if widenings > WIDENINGS {
            return None;
        }
    }
    for _ in 0..HALVINGS {
        let middle = (below * above).sqrt();
        if holds(middle) {
            below = middle;
        } else {
            above = middle;
        }
    }
    Some(below)
}

/// Largest of the last eighth of [`STEPS`] energies per largest of the second; zero once one is zero, `None` once one is
/// missing.
fn watch(mut energy: impl FnMut() -> Option<f64>) -> Option<f64> {
    let window = STEPS / 8;
    let (mut early, mut late) = (0.0_f64, 0.0_f64);
    for step in 0..STEPS {
        let energy = energy()?;
        if energy == 0.0 {
            return Some(0.0);
        }
        if step / window == 1 {
            early = early.max(energy);
        } else if step >= STEPS - window {
            late = late.max(energy);
        }
    }
    Some(late / early)
}

/// An arm whose control law is evaluated in every stage, integral and all: the method steps `(q, s)`, where the integral
/// `s` of the position error has the velocity `q* - q` and the acceleration `-q̇`.
#[derive(Debug, Clone, PartialEq)]
pub struct ContinuousLoop<const N: usize> {
    /// Arm, gains, setpoint and method.
    pub setting: Setting<N>,
    /// Joint positions and velocities.
    pub state: State<N>,
    /// Integral of the position error \[rad s\].
    pub integral: [f64; N],
}

impl<const N: usize> ContinuousLoop<N> {
    /// One step of `h` \[s\]; `false`, and nothing changes, if its result would not be finite. Integrals are stepped for up
    /// to three joints; more are not, which is `false` too.
    pub fn step(&mut self, h: f64) -> bool {
        let integrates = self.setting.gains.ki.iter().any(|&ki| ki > 0.0);
        match N {
            _ if !integrates => self.step_arm(h),
            1 => self.step_all::<2>(h),
            2 => self.step_all::<4>(h),
            3 => self.step_all::<6>(h),
            _ => false,
        }
    }

    fn acceleration(&self, q: &[f64; N], v: &[f64; N], integral: &[f64; N]) -> [f64; N] {
        let Gains { kp, ki, kd } = &self.setting.gains;
        let Setpoint { position, velocity } = &self.setting.setpoint;
        let effort = std::array::from_fn(|i| {
            kp[i] * (position[i] - q[i])
                + ki[i] * integral[i].clamp(-INTEGRAL_LIMIT, INTEGRAL_LIMIT)
                + kd[i] * (velocity[i] - v[i])
        });
        forward_dynamics(&self.setting.arm, q, v, &effort)
    }

    fn step_arm(&mut self, h: f64) -> bool {
        let State { position, velocity } = self.state;
        let (dq, dv) = increment(
            self.setting.method,
            |_, q, v| self.acceleration(q, v, &[0.0; N]),
            0.0,
            &position,
            &velocity,
            h,
        );
        self.take(&dq, &dv, &[0.0; N])
    }

    /// `M` is twice `N`, which the language can't say yet.
    fn step_all<const M: usize>(&mut self, h: f64) -> bool {
        debug_assert_eq!(M, 2 * N, "a position and an integral for every joint");
        let State { position, velocity } = self.state;
        let joint = |i: usize| i % N;
        let whole: [f64; M] = std::array::from_fn(|i| {
            if i < N {
                position[i]
            } else {
                self.integral[joint(i)]
            }
        });
        let rates: [f64; M] = std::array::from_fn(|i| {
            if i < N {
                velocity[i]
            } else {
                self.setting.setpoint.position[joint(i)] - position[joint(i)]
            }
        });
        let (moved, changed) = increment(
            self.setting.method,
            |_, x, rate| {
                let q = std::array::from_fn(|i| x[i]);
                let v: [f64; N] = std::array::from_fn(|i| rate[i]);
                let a = self.acceleration(&q, &v, &std::array::from_fn(|i| x[N + i]));
                std::array::from_fn(|i| if i < N { a[i] } else { -v[joint(i)] })
            },
            0.0,
            &whole,
            &rates,
            h,
        );
        self.take(
            &std::array::from_fn(|i| moved[i]),
            &std::array::from_fn(|i| changed[i]),
            &std::array::from_fn(|i| moved[N + i]),
        )
    }

    fn take(&mut self, dq: &[f64; N], dv: &[f64; N], ds: &[f64; N]) -> bool {
        let next = moved(&self.state, dq, dv);
        let finite = next.is_finite();
        if finite {
            self.state = next;
            self.integral = std::array::from_fn(|i| {
                (self.integral[i] + ds[i]).clamp(-INTEGRAL_LIMIT, INTEGRAL_LIMIT)
            });
        }
        finite
    }
}

//! A setpoint that moves, and the cost of holding it between two control steps.
//!
//! The truth is the motion under the law at every instant, behind a setpoint that is known at every instant too,
//! velocity and all. Three ways fall short of it:
//!
//! | [`LookedAt`] | law | setpoint | order |
//! | --- | --- | --- | --- |
//! | `EveryStage` | in every stage | in every stage | the method's |
//! | `SetpointHeld` | in every stage | that of the start of the step | 1 |
//! | `BothHeld` | once a step | that of the start of the step | 1: the live arm |
//!
//! **Invariant:** `BothHeld` steps the live arm's own simulation.

use super::error::{OUTPUTS, REACH_GAINS, REACH_SETPOINT, SAMPLES};
use super::reference::{MovingSetpoint, ReferenceMotion};
use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::dynamics::forward_dynamics;
use crate::math::integrator::{Method, increment};
use crate::math::pid::{Gains, Pid, Setpoint};
use crate::math::simulation::Simulation;
use crate::study::control_loop::ControlLoop;

/// How long the setpoint takes \[s\].
pub const DURATION: f64 = 2.0;

/// Timestep of [`distance_behind`] \[s\].
pub const TIMESTEP: f64 = 1.0 / 1024.0;

/// When law and setpoint are looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LookedAt {
    /// Both at the start of the step.
    BothHeld,
    /// The law in every stage, the setpoint at the start of the step.
    SetpointHeld,
    /// Both in every stage.
    EveryStage,
}

impl LookedAt {
    /// All three.
    pub const ALL: [Self; 3] = [Self::BothHeld, Self::SetpointHeld, Self::EveryStage];

    /// In words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::BothHeld => "law and setpoint once a step",
            Self::SetpointHeld => "law in every stage, setpoint once a step",
            Self::EveryStage => "law and setpoint in every stage",
        }
    }

    /// The order that is left of a method's own.
    #[must_use]
    pub const fn order(self, method: Method) -> u32 {
        match self {
            Self::EveryStage => method.order(),
            Self::BothHeld | Self::SetpointHeld => 1,
        }
    }
}

/// From the starting pose to where the study reaches, smoothly.
#[must_use]
pub const fn smooth_move() -> MovingSetpoint<2> {
    MovingSetpoint {
        from: [0.0; 2],
        to: REACH_SETPOINT.position,
        duration: DURATION,
    }
}

/// The 2-link arm behind the moving setpoint, with the gains of the study's reach.
#[derive(Debug)]
pub struct MovingScene {
    arm: Arm<2>,
    setpoint: MovingSetpoint<2>,
    truth: ReferenceMotion<2>,
}

impl Default for MovingScene {
    fn default() -> Self {
        Self::new()
    }
}

impl MovingScene {
    /// The scene with its reference, which is computed here.
    #[must_use]
    pub fn new() -> Self {
        let (arm, setpoint) = (Arm::default(), smooth_move());
        let spacing = DURATION / in_f64(OUTPUTS);
        let start = State::rest();
        let truth =
            ReferenceMotion::behind(&arm, &start, &REACH_GAINS, &setpoint, spacing, SAMPLES);
        Self {
            arm,
            setpoint,
            truth,
        }
    }

    /// How far the reference itself may be off \[rad\].
    #[must_use]
    pub fn uncertainty(&self) -> f64 {
        self.truth.uncertainty().iter().copied().fold(0.0, f64::max)
    }

    /// The largest angle error \[rad\] over the outputs of a run of `steps` steps, a multiple of [`OUTPUTS`].
    #[must_use]
    pub fn error(&self, behind: LookedAt, method: Method, steps: u64) -> f64 {
        let h = DURATION / in_f64(steps);
        let control = ControlLoop::new(self.arm, REACH_GAINS, Setpoint::default());
        let mut live = control
            .with_method(method)
            .with_timestep(h)
            .simulation(State::rest());
        let mut state = State::rest();
        let every = (steps / OUTPUTS).max(1);
        let mut worst = 0.0_f64;
        let mut output = 0;
        for step in 0..steps {
            let time = h * in_f64(step);
            if behind == LookedAt::BothHeld {
                live.set_setpoint(self.setpoint.at(time));
                if !live.step() {
                    return f64::NAN;
                }
                state = *live.state();
            } else {
                state = state.plus(&self.increment(behind, method, &state, time, h));
            }
            if (step + 1) % every == 0 {
                let error = self.truth.angle_error(output, &state.position);
                let error = error.filter(|error| error.is_finite());
                let Some(error) = error else {
                    return f64::NAN;
                };
                worst = worst.max(error);
                output += 1;
            }
        }
        worst
    }

    fn increment(
        &self,
        behind: LookedAt,
        method: Method,
        state: &State<2>,
        time: f64,
        h: f64,
    ) -> ([f64; 2], [f64; 2]) {
        let held = self.setpoint.at(time);
        let mut pid = Pid::new(REACH_GAINS);
        let acceleration = |at: f64, q: &[f64; 2], v: &[f64; 2]| {
            let setpoint = match behind {
                LookedAt::EveryStage => self.setpoint.at(at),
                LookedAt::BothHeld | LookedAt::SetpointHeld => held,
            };
            pid.set_setpoint(setpoint);
            let now = State {
                position: *q,
                velocity: *v,
            };
            forward_dynamics(&self.arm, q, v, &pid.control(&now, 0.0).effort)
        };
        increment(
            method,
            acceleration,
            time,
            &state.position,
            &state.velocity,
            h,
        )
    }
}

/// How far the live arm with its default gains comes to be from the moving setpoint \[rad\], if that is moved every
/// `every` steps of [`TIMESTEP`], with its velocity or with none. The arm has settled where the setpoint begins.
#[must_use]
pub fn distance_behind(every: u64, with_velocity: bool) -> f64 {
    let setpoint = smooth_move();
    let mut live = Simulation::new(Arm::default(), Gains::<2>::default());
    live.set_timestep(TIMESTEP);
    live.set_setpoint(setpoint.at(0.0));
    live.enable(true);
    // Ten seconds leave nothing of the jolt that gravity gives at the start.
    live.advance(10 * 1024);
    let mut worst = 0.0_f64;
    for step in 0..2 * 1024 {
        if step % every == 0 {
            let mut now = setpoint.at(TIMESTEP * in_f64(step));
            if !with_velocity {
                now.velocity = [0.0; 2];
            }
            live.set_setpoint(now);
        }
        live.step();
        let wanted = setpoint.at(TIMESTEP * in_f64(step + 1)).position;
        let pairs = wanted.iter().zip(&live.state().position);
        worst = pairs.fold(worst, |worst, (wanted, q)| worst.max((wanted - q).abs()));
    }
    worst
}

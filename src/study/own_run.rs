//! The live arm's loop, stepped by a method of one's own: the law, its hold, limits and sensors are the live arm's.
//!
//! **Invariant:** a step whose result is not finite changes nothing.

use super::beside::Steppable;
use super::control_loop::ControlLoop;
use super::tableau::Pair;
use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::dynamics::{forward_dynamics, less_friction};
use crate::math::pid::Pid;
use crate::math::simulation::{Divergence, Hold, Simulation, add_carried};

/// A run whose samples can be written.
pub(super) trait Recorded<const N: usize>: Steppable<N> {
    /// Steps taken.
    fn steps(&self) -> u64;
    /// Its time \[s\].
    fn time(&self) -> f64;
    /// The effort of the latest step \[N m\].
    fn effort(&self) -> [f64; N];
    /// Whether a motor was at its limit in the latest step.
    fn is_at_limit(&self) -> bool;
    /// The step that was not taken.
    fn divergence(&self) -> Option<Divergence>;
    /// Applies `effort` \[N m\] from the next step on, in place of the controller's.
    fn drive(&mut self, effort: [f64; N]);
}

impl<const N: usize> Recorded<N> for Simulation<N> {
    fn steps(&self) -> u64 {
        Simulation::steps(self)
    }

    fn time(&self) -> f64 {
        Simulation::time(self)
    }

    fn effort(&self) -> [f64; N] {
        *Simulation::effort(self)
    }

    fn is_at_limit(&self) -> bool {
        self.at_limit().contains(&true)
    }

    fn divergence(&self) -> Option<Divergence> {
        Simulation::divergence(self)
    }

    fn drive(&mut self, effort: [f64; N]) {
        Simulation::drive(self, Some(effort));
    }
}

/// The run of a loop by a method of one's own.
pub(super) struct OwnRun<const N: usize> {
    control: ControlLoop<N>,
    pair: Pair,
    pid: Pid<N>,
    hold: Hold<N>,
    state: State<N>,
    /// The rounding error of the state, as in the live arm.
    carry: State<N>,
    effort: [f64; N],
    /// The effort that acts in place of the controller's.
    driven: Option<[f64; N]>,
    steps: u64,
    divergence: Option<Divergence>,
}

impl<const N: usize> OwnRun<N> {
    pub(super) fn new(control: ControlLoop<N>, pair: Pair, start: State<N>) -> Self {
        Self {
            pid: control.simulation(start).pid().clone(),
            hold: control.hold(),
            control,
            pair,
            state: start,
            carry: State::rest(),
            effort: [0.0; N],
            driven: None,
            steps: 0,
            divergence: None,
        }
    }

    fn step(&mut self) -> bool {
        let (mut control, held) = self.hold.begin_step(&self.pid, &self.state);
        if let Some(effort) = self.driven {
            control.effort = self.control.limits.applied(effort);
        }
        let ControlLoop { arm, timestep, .. } = &self.control;
        let (dq, dv) = increment(&self.pair, arm, &self.state, &control.effort, *timestep);
        let (next, carry) = add_carried(&self.state, &self.carry, &dq, &dv);
        let is_finite = next.is_finite() && (in_f64(self.steps + 1) * timestep).is_finite();
        if is_finite {
            self.hold.commit(held);
            self.pid.commit(control.integral);
            (self.state, self.carry) = (next, carry);
            self.effort = control.effort;
            self.steps += 1;
        } else {
            self.divergence = Some(Divergence {
                step: self.steps + 1,
                time: self.time(),
            });
        }
        is_finite
    }
}

/// The changes of positions and velocities in a step of `h` \[s\] under a constant `effort` \[N m\].
pub(super) fn increment<const N: usize>(
    pair: &Pair,
    arm: &Arm<N>,
    state: &State<N>,
    effort: &[f64; N],
    h: f64,
) -> ([f64; N], [f64; N]) {
    let (dq, dv) = pair.increment(h, &state.velocity, |dq, v| {
        let position = std::array::from_fn(|j| state.position[j] + dq[j]);
        let velocity = std::array::from_fn(|j| v[j]);
        let effort = if arm.has_friction() {
            less_friction(arm.viscous(), &velocity, effort)
        } else {
            *effort
        };
        forward_dynamics(arm, &position, &velocity, &effort).to_vec()
    });
    let joints = |change: Vec<f64>| std::array::from_fn(|j| change[j]);
    (joints(dq), joints(dv))
}

impl<const N: usize> Steppable<N> for OwnRun<N> {
    fn advance(&mut self, steps: u64) -> u64 {
        (0..steps)
            .take_while(|_| self.divergence.is_none() && self.step())
            .count() as u64
    }

    fn evaluations(&self) -> u64 {
        self.steps * self.pair.evaluations() as u64
    }

    fn state(&self) -> &State<N> {
        &self.state
    }
}

impl<const N: usize> Recorded<N> for OwnRun<N> {
    fn steps(&self) -> u64 {
        self.steps
    }

    fn time(&self) -> f64 {
        in_f64(self.steps) * self.control.timestep
    }

    fn effort(&self) -> [f64; N] {
        self.effort
    }

    fn is_at_limit(&self) -> bool {
        !self.control.is_free() && self.control.limits.reached(&self.effort).contains(&true)
    }

    fn divergence(&self) -> Option<Divergence> {
        self.divergence
    }

    fn drive(&mut self, effort: [f64; N]) {
        self.driven = Some(effort);
    }
}

//! All limits of a control loop: at its setpoint, and the smallest over all poses.
//!
//! **Invariant:** a search cut into slices finds the same bits as one made at once.

use super::linear::Linear;
use super::poses::PoseSearch;
use super::stability::{Sampling, largest_timestep};
use crate::math::arm::Arm;
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};

/// Part of the smallest limit over all poses that is advised: what linearisation leaves out (a start of 0.3 rad off
/// costs up to a third of a stiff limit, poses on the way have limits of their own) stays within it.
pub const ADVISED_PART: f64 = 0.8;

/// Largest stable timesteps \[s\]. `Some(0.0)`: unstable at every timestep. `None`: no timestep found unstable, as for a
/// free arm without gravity, which linear methods carry at any pace.
///
/// Gains that are all zero mean an arm left to itself, and its hanging pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// At the setpoint's equilibrium, effort held over the step.
    pub held: Option<f64>,
    /// At the setpoint's equilibrium, control in every stage.
    pub continuous: Option<f64>,
    /// The smallest over a grid of poses, effort held over the step.
    pub minimum_held: Option<f64>,
    /// The smallest over a grid of poses, control in every stage.
    pub minimum_continuous: Option<f64>,
    /// [`ADVISED_PART`] of the smaller of `held` and `minimum_held`, the live arm's way.
    pub advised: Option<f64>,
}

/// All limits of a loop. Some 5 ms of one core for two links, 0.1 s for three (optimised build).
#[must_use]
pub fn limits<const N: usize>(
    arm: &Arm<N>,
    gains: &Gains<N>,
    setpoint: &Setpoint<N>,
    method: Method,
) -> Limits {
    let mut search = LimitSearch::new(arm, gains, setpoint, method);
    loop {
        if let Some(limits) = search.advance() {
            return limits;
        }
    }
}

/// [`limits`], to be paused: no advance takes longer than a millisecond or so of one core (optimised build).
#[derive(Debug, Clone)]
pub struct LimitSearch<const N: usize> {
    arm: Arm<N>,
    gains: Gains<N>,
    method: Method,
    stage: Stage<N>,
}

#[derive(Debug, Clone)]
enum Stage<const N: usize> {
    Setpoint(Setpoint<N>),
    Held(Linear),
    Continuous(Linear, Option<f64>),
    /// At the setpoint with held and with continuous control, then over the poses, one after the other.
    Poses([Option<f64>; 2], [PoseSearch<N>; 2]),
    Done(Limits),
}

impl<const N: usize> LimitSearch<N> {
    /// A search that has not begun.
    #[must_use]
    pub fn new(arm: &Arm<N>, gains: &Gains<N>, setpoint: &Setpoint<N>, method: Method) -> Self {
        Self {
            arm: *arm,
            gains: *gains,
            method,
            stage: Stage::Setpoint(*setpoint),
        }
    }

    /// Goes on by one piece; the limits, once they are all found.
    pub fn advance(&mut self) -> Option<Limits> {
        let (arm, gains, method) = (&self.arm, &self.gains, self.method);
        let next = match &mut self.stage {
            Stage::Setpoint(setpoint) => Stage::Held(Linear::at_setpoint(arm, gains, setpoint)),
            Stage::Held(linear) => {
                let held = largest_timestep(linear, method, Sampling::Held);
                Stage::Continuous(linear.clone(), held)
            }
            Stage::Continuous(linear, held) => {
                let continuous = largest_timestep(linear, method, Sampling::Continuous);
                let over_poses =
                    |sampling, bound| PoseSearch::new(arm, gains, method, sampling, bound);
                Stage::Poses(
                    [*held, continuous],
                    [
                        over_poses(Sampling::Held, *held),
                        over_poses(Sampling::Continuous, continuous),
                    ],
                )
            }
            Stage::Poses([held, continuous], searches) => {
                if searches.iter_mut().any(PoseSearch::advance) {
                    return None;
                }
                let [minimum_held, minimum_continuous] = searches;
                let minimum_held = minimum_held.smallest();
                Stage::Done(Limits {
                    held: *held,
                    continuous: *continuous,
                    minimum_held,
                    minimum_continuous: minimum_continuous.smallest(),
                    advised: minimum_held.map(|limit| ADVISED_PART * limit),
                })
            }
            Stage::Done(limits) => return Some(*limits),
        };
        self.stage = next;
        match &self.stage {
            Stage::Done(limits) => Some(*limits),
            _ => None,
        }
    }
}

/// [`Limits::held`] alone: what the live arm is up against at its present setpoint. Half a millisecond of one core for two
/// links, one for three (optimised build).
#[must_use]
pub fn limit_held<const N: usize>(
    arm: &Arm<N>,
    gains: &Gains<N>,
    setpoint: &Setpoint<N>,
    method: Method,
) -> Option<f64> {
    largest_timestep(
        &Linear::at_setpoint(arm, gains, setpoint),
        method,
        Sampling::Held,
    )
}

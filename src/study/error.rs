//! Error against cost: the same scenes for all four methods, each against one reference.
//!
//! A [`Scene`] is an arm (or the particle of `/arm_sim/integration_step`), a start, a control law and a duration, cut into
//! [`OUTPUTS`] equal intervals. A run takes `64 k` equal steps, so that every method at every timestep lands on the same output
//! times. Its error is the largest, over outputs and joints, of the angles' distances to the reference. Cost is counted in
//! evaluations of the dynamics here; who wants seconds times [`Scene::replay`], which takes the same steps and does no
//! more.
//!
//! **Invariant:** nothing is chosen per method: same starts, same timesteps, same reference, same measure.

mod arm_scene;
mod particle_scene;

pub use arm_scene::{ArmScene, Drive, energy_scale};
pub use particle_scene::ParticleScene;

use crate::math::arm::{Arm, State};
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};

/// Output times of every run. Enough that no swing hides between two of them; a power of two, so that the timesteps of
/// a duration that is one too are exact.
pub const OUTPUTS: u64 = 64;

/// [`OUTPUTS`] as a length.
pub(super) const SAMPLES: usize = 64;

/// A run whose angles are off by a whole turn \[rad\] shows nothing any more, and counts as diverged.
pub const LOST: f64 = std::f64::consts::TAU;

/// What a run came to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Steps that were to be taken.
    pub steps: u64,
    /// Length of each \[s\].
    pub timestep: f64,
    /// Evaluations of the dynamics, counted.
    pub evaluations: u64,
    /// Largest angle error over all outputs and joints \[rad\] (\[m\] for the particle).
    pub error: f64,
    /// Largest angle error at the last output \[rad\].
    pub end_error: f64,
    /// Largest distance of the tip from where it should be \[m\].
    pub tip_error: f64,
    /// Largest `|E - E(0)|` over the scene's energy scale; `None` where energy is not conserved.
    pub energy_drift: Option<f64>,
    /// The output time at which the run was lost or left the finite numbers \[s\], if it was.
    pub diverged: Option<f64>,
}

/// Something to be computed by every method.
pub trait Scene {
    /// Short name, as files and tables use it.
    fn name(&self) -> &'static str;
    /// What it is, for a heading.
    fn title(&self) -> &'static str;
    /// Parameters in one line.
    fn about(&self) -> String;
    /// Number of links; 0 for the particle.
    fn links(&self) -> usize;
    /// How the effort is found: `none`, `continuous` or `held`.
    fn control(&self) -> &'static str;
    /// Simulated time \[s\].
    fn duration(&self) -> f64;
    /// How far the reference itself may be off \[rad\].
    fn uncertainty(&self) -> f64;
    /// Runs `steps` steps, a multiple of [`OUTPUTS`], and compares.
    fn run(&self, method: Method, steps: u64) -> Outcome;
    /// The same steps without counting or comparing. What comes back only keeps them from being optimised away.
    fn replay(&self, method: Method, steps: u64) -> f64;
    /// What [`Scene::replay`] must come back with, taken from the run that is judged.
    fn judged_end(&self, method: Method, steps: u64) -> f64;
    /// The largest stable timestep \[s\] as predicted for the scene's control at its setpoint, if it has one.
    fn predicted_limit(&self, method: Method) -> Option<f64>;
    /// Most steps of one run.
    fn most_steps(&self) -> u64 {
        u64::MAX
    }
}

/// All scenes, in the order in which they are shown.
#[must_use]
pub fn scenes() -> Vec<Box<dyn Scene>> {
    let reach =
        |name, title, law| ArmScene::new(name, title, Arm::<2>::default(), State::rest(), law, 2.0);
    let whirling = Arm::new([1.0; 2], [1.0; 2], 0.0).unwrap_or_default();
    vec![
        Box::new(ParticleScene),
        Box::new(ArmScene::new(
            "swing-2",
            "Free swing, 2 links",
            Arm::<2>::default(),
            State::rest(),
            Drive::Free,
            2.0,
        )),
        Box::new(ArmScene::new(
            "swing-3",
            "Free swing, 3 links",
            Arm::<3>::default(),
            State::rest(),
            Drive::Free,
            2.0,
        )),
        Box::new(ArmScene::new(
            "whirl-2",
            "Whirl at 10 rad/s, no gravity",
            whirling,
            State {
                position: [0.0, 0.5],
                velocity: [10.0, 0.0],
            },
            Drive::Free,
            2.0,
        )),
        Box::new(reach(
            "reach-continuous",
            "PD reach, law in every stage",
            Drive::Continuous(REACH_GAINS, REACH_SETPOINT),
        )),
        Box::new(reach(
            "reach-held",
            "PD reach, effort held for the step",
            Drive::Held(REACH_GAINS, REACH_SETPOINT),
        )),
    ]
}

/// Gains of the reach: soft enough that timesteps of tens of milliseconds are on both sides of the stability edge.
pub const REACH_GAINS: Gains<2> = Gains {
    kp: [200.0, 100.0],
    ki: [0.0; 2],
    kd: [30.0, 12.0],
};

/// Where the reach goes, from the starting pose.
pub const REACH_SETPOINT: Setpoint<2> = Setpoint {
    position: [0.8, -0.6],
    velocity: [0.0; 2],
};

/// The largest errors so far of a run in progress.
struct Worst {
    error: f64,
    end_error: f64,
    tip_error: f64,
    diverged: Option<f64>,
}

impl Worst {
    const NONE: Self = Self {
        error: 0.0,
        end_error: 0.0,
        tip_error: 0.0,
        diverged: None,
    };

    /// Takes in one output; `false` once there is nothing left to compare.
    fn take(&mut self, time: f64, error: f64, tip_error: f64) -> bool {
        if error.is_nan() || error > LOST {
            self.diverged = Some(time);
            self.error = f64::INFINITY;
            self.end_error = f64::INFINITY;
            self.tip_error = f64::INFINITY;
            return false;
        }
        self.error = self.error.max(error);
        self.end_error = error;
        self.tip_error = self.tip_error.max(tip_error);
        true
    }
}

#[allow(
    clippy::cast_precision_loss,
    reason = "step counts of a run are far below 2^53"
)]
fn in_f64(count: u64) -> f64 {
    count as f64
}

//! A scene, which every method computes, and the outcome of a run.
//!
//! **Invariant:** every run lands on the same output times, whatever its timestep.

use crate::math::integrator::Method;

/// Output times of every run. Enough that no swing hides between two of them; a power of two, so that the timesteps of
/// a duration that is one too are exact.
pub const OUTPUTS: u64 = 64;

/// [`OUTPUTS`] as a length.
pub(in crate::report::experiments) const SAMPLES: usize = 64;

/// A run whose angles are off by a whole turn \[rad\] shows nothing any more, and counts as diverged.
pub const LOST: f64 = std::f64::consts::TAU;

/// The outcome of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunOutcome {
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
    /// Largest distance of the end effector from where it should be \[m\].
    pub end_effector_error: f64,
    /// Largest `|E - E(0)|` over the scene's energy scale; `None` where energy is not conserved.
    pub energy_drift: Option<f64>,
    /// The output time at which the run was lost or left the finite numbers \[s\], if it was.
    pub diverged: Option<f64>,
}

/// Something to be computed by every method.
pub trait Scene {
    /// Short name, as files and tables use it.
    fn name(&self) -> &'static str;
    /// The scene in words, for a heading.
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
    fn run(&self, method: Method, steps: u64) -> RunOutcome;
    /// The same steps without counting or comparing. What comes back only keeps them from being optimised away.
    fn replay(&self, method: Method, steps: u64) -> f64;
    /// The value that [`Scene::replay`] must come back with, taken from the run that is judged.
    fn judged_end(&self, method: Method, steps: u64) -> f64;
    /// The largest stable timestep \[s\] as predicted for the scene's control at its setpoint, if it has one.
    fn predicted_limit(&self, method: Method) -> Option<f64>;
    /// Most steps of one run.
    fn most_steps(&self) -> u64 {
        u64::MAX
    }
}

/// The largest errors so far of a run in progress.
pub(super) struct Worst {
    pub(super) error: f64,
    pub(super) end_error: f64,
    pub(super) end_effector_error: f64,
    pub(super) diverged: Option<f64>,
}

impl Worst {
    pub(super) const NONE: Self = Self {
        error: 0.0,
        end_error: 0.0,
        end_effector_error: 0.0,
        diverged: None,
    };

    /// Takes in one output; `false` once there is nothing left to compare.
    pub(super) fn take(&mut self, time: f64, error: f64, end_effector_error: f64) -> bool {
        if error.is_nan() || error > LOST {
            self.diverged = Some(time);
            self.error = f64::INFINITY;
            self.end_error = f64::INFINITY;
            self.end_effector_error = f64::INFINITY;
            return false;
        }
        self.error = self.error.max(error);
        self.end_error = error;
        self.end_effector_error = self.end_effector_error.max(end_effector_error);
        true
    }
}

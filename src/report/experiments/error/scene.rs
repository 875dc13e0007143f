//! A scene, which every method computes, and the outcome of a run.
//!
//! **Invariant:** every run is looked at after each of its steps, or evenly at [`MOST_LOOKS`] or so of them.

use crate::math::integrator::Method;

/// Steps of the coarsest run of a row: a power of two, so that the timesteps of a duration that is one too are exact.
pub const OUTPUTS: u64 = 64;

/// Steps after which a run is compared, at most twice as many: a millisecond apart in two seconds, where no peak of an
/// error hides in between.
pub const MOST_LOOKS: u64 = 2048;

/// Says after which steps of a run of `steps` steps it is compared: all of them, every second, every third..., and the
/// last one.
pub(super) fn looks(steps: u64) -> impl Fn(u64) -> bool {
    let every = steps.div_ceil(MOST_LOOKS).max(1);
    move |step| step.is_multiple_of(every) || step == steps
}

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
    /// Largest angle error over all comparisons and joints \[rad\] (\[m\] for the particle).
    pub error: f64,
    /// Largest angle error after the last step \[rad\].
    pub end_error: f64,
    /// Largest distance of the end effector from where it should be \[m\].
    pub end_effector_error: f64,
    /// Largest `|E - E(0)|` over the scene's energy scale; `None` where energy is not conserved.
    pub energy_drift: Option<f64>,
    /// The time at which the run was lost or left the finite numbers \[s\], if it was.
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
    /// Runs `steps` steps and compares.
    fn run(&self, method: Method, steps: u64) -> RunOutcome {
        self.run_within(method, steps, LOST)
    }
    /// As [`Scene::run`], but a run whose error exceeds `most` ends there and counts as diverged.
    fn run_within(&self, method: Method, steps: u64, most: f64) -> RunOutcome;
    /// The same steps without counting or comparing. The results only keep them from being optimised away.
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
    most: f64,
    pub(super) error: f64,
    pub(super) end_error: f64,
    pub(super) end_effector_error: f64,
    pub(super) diverged: Option<f64>,
}

impl Worst {
    /// None so far; a run is lost beyond `most`.
    pub(super) const fn within(most: f64) -> Self {
        Self {
            most,
            error: 0.0,
            end_error: 0.0,
            end_effector_error: 0.0,
            diverged: None,
        }
    }

    /// Takes in one comparison; `false` once there is nothing left to compare.
    pub(super) fn take(&mut self, time: f64, error: f64, end_effector_error: f64) -> bool {
        if error.is_nan() || error > self.most {
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

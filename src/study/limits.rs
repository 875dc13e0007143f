//! All timestep limits of a control loop: at its setpoint, and the smallest over all poses, with a lower bound if there
//! is one.
//!
//! **Invariant:** the work is bounded, and no piece of it takes longer than about a millisecond (optimised build).

use super::control_loop::ControlLoop;
use super::critical::{Critical, critical};
use super::linear::{Linear, equilibrium};
use super::motion::Motion;
use super::paused::{at_once, pause};
use super::poses::{PoseCandidate, smallest_of_all_poses};
use super::proof::{BOXES, MAX_BOXES, Proven, prove};
use super::stability::{Modes, Sampling, Stepping, largest_timestep};
use crate::math::integrator::Method;

/// Advised part of the smallest limit over all poses, a margin for effects outside the linearisation. A start 0.3 rad
/// off the setpoint reduces the limit of a stiff loop by up to a third. Poses on the way have limits of their own.
pub const ADVISED_PART: f64 = 0.8;

/// Advised part if some pose is unstable in continuous time. A link can spin then, which changes the inertia of the
/// joints before it. One such arm, with Verlet, kept spinning at 0.76 of its smallest limit over poses at rest.
const SPINNING_PART: f64 = 0.5;

/// Largest relative distance from the bound at which the smallest limit found counts as certified.
const AGREEMENT: f64 = 0.01;

/// A bound below this part of the smallest limit found is too low to be used as advice.
const USEFUL: f64 = 0.5;

/// Largest distance from the setpoint at which an arm counts as at it \[rad\].
const AT_SETPOINT: f64 = 1e-6;

/// The kind of equilibrium to which the limits belong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Rest {
    /// At the setpoint.
    Setpoint,
    /// Off the setpoint: the springs yield to the load.
    Sagging,
    /// A free arm.
    Hanging,
    /// The setpoint is an unstable equilibrium, from which the arm falls to either side. The pose is on one of the
    /// sides.
    Saddle,
    /// No rest: the loop is unstable at the pose even in continuous time.
    Unstable,
}

impl Rest {
    /// The name in lower case.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Setpoint => "setpoint",
            Self::Sagging => "sagging",
            Self::Hanging => "hanging",
            Self::Saddle => "saddle",
            Self::Unstable => "unstable",
        }
    }
}

/// Largest stable timesteps \[s\]. `Some(0.0)`: none was found stable. `None`: no timestep was found unstable. An
/// example is a free arm without gravity, whose linearised motion every method reproduces at any timestep.
///
/// If all gains are zero, the arm is free, and the pose is the hanging one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits<const N: usize> {
    /// The pose that `held` and `continuous` belong to \[rad\].
    pub equilibrium: [f64; N],
    /// The kind of equilibrium there.
    pub rest: Rest,
    /// At the setpoint's equilibrium, effort held over the step.
    pub held: Option<f64>,
    /// At the setpoint's equilibrium, control in every stage.
    pub continuous: Option<f64>,
    /// The smallest over all poses, effort held over the step. Zero if a joint integrates and the loop is unstable in
    /// some pose, since the arm can be sent there.
    pub minimum_held: Option<f64>,
    /// The smallest over all poses, control in every stage, found by a search.
    pub minimum_continuous: Option<f64>,
    /// A timestep up to which every pose is stable, effort held over the step; `None` if no useful bound is known.
    pub bound: Option<f64>,
    /// Whether `bound` holds without an estimate, up to rounding: with Euler, and without gravity.
    pub bound_is_proven: bool,
    /// Whether `minimum_held` and `bound` agree to 1 %. The smallest limit may then be up to 1 % below `minimum_held`.
    pub certified: bool,
    /// The pose of `minimum_held` \[rad\]; `None` where nothing limits.
    pub worst_pose: Option<[f64; N]>,
    /// The motion that grows there first; `None` if nothing grows 10 % beyond the limit.
    pub critical: Option<Critical>,
    /// [`ADVISED_PART`] of the smallest over all poses, the live arm's way: of `minimum_held` if that is certified, or
    /// of the bound if that is less and still useful. If the loop is unstable in some pose, neither applies. Then it is
    /// half of the smaller of `held` and the smallest of all poses without gravity, and holds for this setpoint alone.
    pub advised: Option<f64>,
    /// The control period of the loop \[s\].
    period: f64,
}

impl<const N: usize> Limits<N> {
    /// The advised timestep for a motion \[s\]: [`ADVISED_PART`] of the limit of poses and motion. `None` if there is no
    /// limit, or if the control period is longer: the limits over all poses are those of a law that runs in every step.
    pub fn advised_for(&self, motion: &Motion) -> Option<f64> {
        let carried = Some(ADVISED_PART * motion.timestep).filter(|it| it.is_finite());
        let both = [self.advised, carried].into_iter().flatten();
        both.reduce(f64::min)
            .filter(|timestep| self.period <= *timestep)
    }

    /// A reliable value of the smallest limit over all poses, effort held over the step \[s\]. It is `minimum_held` if
    /// that is certified or there is no bound, else the bound.
    pub fn trusted(&self) -> Option<f64> {
        self.bound.filter(|_| !self.certified).or(self.minimum_held)
    }
}

/// All limits of a loop. Takes some 15 ms of one core for two links, 0.3 s for three (optimised build).
pub fn limits<const N: usize>(control: &ControlLoop<N>) -> Limits<N> {
    at_once(search_limits(*control))
}

/// Does what [`limits`] does, in pieces.
pub async fn search_limits<const N: usize>(control: ControlLoop<N>) -> Limits<N> {
    let (equilibrium, rest, linear) = settle(&control);
    pause().await;
    let held = Stepping::of(&linear, &control, Sampling::Held).limit();
    pause().await;
    let continuous = largest_timestep(&linear, control.method, Sampling::Continuous);
    pause().await;
    let here = PoseCandidate::as_it_is(equilibrium);
    let mut limits = Limits {
        equilibrium,
        rest,
        held,
        continuous,
        minimum_held: None,
        minimum_continuous: Some(0.0),
        bound: None,
        bound_is_proven: false,
        certified: false,
        worst_pose: None,
        critical: None,
        advised: None,
        period: control.given_period(),
    };
    if let Some(proven) = prove(&control, MAX_BOXES).await {
        return with_bound(control, limits, proven).await;
    }
    // A joint without a restoring force drifts, but a loop that is stable at some timestep is not unstable in
    // continuous time.
    if held == Some(0.0) && Modes::of(&linear).run_away() {
        limits.rest = Rest::Unstable;
    }
    if let Some(pose) = runaway_pose(control, here).await {
        // No timestep is stable there. The advice is for the poses without gravity.
        let mut weightless = control;
        weightless.arm = control.arm.weightless();
        let search = smallest_of_all_poses(weightless, Some(Sampling::Held), (held, here));
        let (least, _) = search.await;
        return Limits {
            minimum_held: Some(0.0),
            worst_pose: Some(pose.pose),
            critical: critical(&pose.linear(&control), &control, 0.0),
            advised: least.map(|limit| SPINNING_PART * limit),
            ..limits
        };
    }
    let search = smallest_of_all_poses(control, Some(Sampling::Held), (held, here));
    with_smallest(control, limits, search.await).await
}

/// The limits of a loop with a bound for all poses.
async fn with_bound<const N: usize>(
    control: ControlLoop<N>,
    mut limits: Limits<N>,
    Proven { timestep, pose }: Proven<N>,
) -> Limits<N> {
    let bound = Some(timestep);
    let mut smallest = (limits.held, PoseCandidate::as_it_is(limits.equilibrium));
    // The pose at which the bound is tightest.
    let nearest = PoseCandidate::as_it_is(pose);
    let there = Stepping::of(&nearest.linear(&control), &control, Sampling::Held).limit();
    let is_less = |there| there > 0.0 && limits.held.is_none_or(|held| there < held);
    if there.is_some_and(is_less) {
        smallest = (there, nearest);
    }
    if limits.held == Some(0.0) {
        // When rates differ by a factor of a trillion, rounding alone can make slow modes seem to grow. The proof
        // is not affected by this rounding.
        limits.held = bound;
        smallest.0 = bound;
    }
    if !is_near(bound, smallest.0) {
        smallest = smallest_of_all_poses(control, Some(Sampling::Held), smallest).await;
    }
    let least = smallest.0;
    limits.certified = is_near(bound, least);
    limits.bound = bound.filter(|bound| least.is_some_and(|least| *bound >= USEFUL * least));
    limits.bound_is_proven =
        limits.bound.is_some() && (control.method == Method::Euler || control.arm.gravity() == 0.0);
    with_smallest(control, limits, smallest).await
}

/// The limits with the smallest one over all poses, and its pose.
async fn with_smallest<const N: usize>(
    control: ControlLoop<N>,
    mut limits: Limits<N>,
    (least, worst): (Option<f64>, PoseCandidate<N>),
) -> Limits<N> {
    limits.minimum_held = least;
    limits.worst_pose = least.map(|_| worst.pose);
    limits.critical = least.and_then(|limit| critical(&worst.linear(&control), &control, limit));
    limits.advised = limits.trusted().map(|limit| ADVISED_PART * limit);
    pause().await;
    let known = (
        limits.continuous,
        PoseCandidate::as_it_is(limits.equilibrium),
    );
    let search = smallest_of_all_poses(control, Some(Sampling::Continuous), known);
    (limits.minimum_continuous, _) = search.await;
    limits
}

/// A pose at which the loop is unstable at every timestep, if an integral makes it so under gravity.
async fn runaway_pose<const N: usize>(
    control: ControlLoop<N>,
    here: PoseCandidate<N>,
) -> Option<PoseCandidate<N>> {
    if !control.integrating().contains(&true) || control.arm.gravity() <= 0.0 {
        return None;
    }
    let (found, pose) = smallest_of_all_poses(control, None, (None, here)).await;
    found.map(|_| pose)
}

/// The equilibrium, its kind, and the linearised loop there.
fn settle<const N: usize>(control: &ControlLoop<N>) -> ([f64; N], Rest, Linear) {
    let rest = equilibrium(control);
    let linear = Linear::at(control, &rest.position, &rest.integrating);
    let mut off = rest.position.iter().zip(&control.setpoint.position);
    let kind = if rest.balanced {
        Rest::Saddle
    } else if control.is_free() {
        Rest::Hanging
    } else if off.all(|(rest, setpoint)| (rest - setpoint).abs() <= AT_SETPOINT) {
        Rest::Setpoint
    } else {
        Rest::Sagging
    };
    (rest.position, kind, linear)
}

/// Whether a bound and a smallest limit exist and agree. The limit may be slightly below the bound, since only growth
/// above a threshold counts.
fn is_near(bound: Option<f64>, least: Option<f64>) -> bool {
    let both = bound.zip(least);
    both.is_some_and(|(bound, least)| (least / bound - 1.0).abs() <= AGREEMENT)
}

/// The limit [`Limits::held`] alone, for the live arm at its present setpoint. Takes 0.5 ms of one core for two links,
/// 1 ms for three (optimised build).
pub fn limit_held<const N: usize>(control: &ControlLoop<N>) -> Option<f64> {
    let linear = Linear::at_setpoint(control);
    match Stepping::of(&linear, control, Sampling::Held).limit() {
        // The same rule as in the search for all limits.
        Some(0.0) => {
            let proven = at_once(prove(control, BOXES));
            Some(proven.map_or(0.0, |proven| proven.timestep))
        }
        limit => limit,
    }
}

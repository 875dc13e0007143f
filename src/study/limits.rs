//! All limits of a control loop: at its setpoint, and the smallest over all poses, bounded from below where it can be.
//!
//! **Invariant:** the work is bounded, and no piece of it takes longer than about a millisecond (optimised build).

use super::control_loop::ControlLoop;
use super::critical::{Critical, critical};
use super::linear::{Linear, equilibrium};
use super::motion::Motion;
use super::paused::{at_once, pause};
use super::poses::{self, PoseCandidate, Sought, smallest_of_all_poses};
use super::proof::{Proof, Proven};
use super::stability::{Modes, Sampling, largest_timestep};
use crate::math::integrator::Method;

/// Part of the smallest limit over all poses that is advised, to allow for effects outside the linearisation. A
/// start of 0.3 rad off costs up to a third of a stiff limit, and poses on the way have limits of their own.
pub const ADVISED_PART: f64 = 0.8;

/// How near to the bound the smallest limit found must be to count as certified.
const AGREEMENT: f64 = 0.01;

/// The part of the smallest limit found below which a bound is no advice any more.
const USEFUL: f64 = 0.5;

/// Boxes that a proof cuts in one piece: half a millisecond (optimised build).
const BOXES: u32 = 200;

/// How far from the setpoint an arm may rest that is said to be at it \[rad\].
const AT_SETPOINT: f64 = 1e-6;

/// How a loop rests in the pose that its limits belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Rest {
    /// At the setpoint.
    Setpoint,
    /// Elsewhere: the springs give under the load.
    Sagging,
    /// Left to itself.
    Hanging,
    /// The setpoint is an exact balance, from which the arm falls to either side; the pose is that of one of them.
    Saddle,
    /// Not at all: even in continuous time the loop runs away from the pose.
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

/// Largest stable timesteps \[s\]. `Some(0.0)`: unstable at every timestep. `None`: no timestep found unstable, as for
/// a free arm without gravity, which linear methods carry at any pace.
///
/// Gains that are all zero mean an arm left to itself, and its hanging pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits<const N: usize> {
    /// The pose that `held` and `continuous` belong to \[rad\].
    pub equilibrium: [f64; N],
    /// How the loop rests there.
    pub rest: Rest,
    /// At the setpoint's equilibrium, effort held over the step.
    pub held: Option<f64>,
    /// At the setpoint's equilibrium, control in every stage.
    pub continuous: Option<f64>,
    /// The smallest over all poses, effort held over the step. Zero where a joint integrates and the loop runs away in
    /// some pose: the arm can be sent there.
    pub minimum_held: Option<f64>,
    /// The smallest over all poses, control in every stage: found by a search.
    pub minimum_continuous: Option<f64>,
    /// A timestep up to which every pose is stable, effort held over the step; `None` where nothing useful is known.
    pub bound: Option<f64>,
    /// Whether no estimate is inside `bound`: with Euler, and without gravity.
    pub bound_is_proven: bool,
    /// Whether `minimum_held` and `bound` agree to 1 %.
    pub certified: bool,
    /// The pose of `minimum_held` \[rad\]; `None` where nothing limits.
    pub worst_pose: Option<[f64; N]>,
    /// The motion that grows there first.
    pub critical: Option<Critical>,
    /// [`ADVISED_PART`] of the smallest over all poses, the live arm's way: of `minimum_held` where that is certified,
    /// of the bound where that is less and still of use. Where the loop runs away in some pose that can't be. Then it
    /// is of the smaller of `held` and the smallest of all poses without gravity, which is for this setpoint alone.
    pub advised: Option<f64>,
}

impl<const N: usize> Limits<N> {
    /// The timestep that is advised for a motion \[s\]: [`ADVISED_PART`] of what poses and motion allow; `None` where
    /// nothing limits.
    #[must_use]
    pub fn advised_for(&self, motion: &Motion) -> Option<f64> {
        let carried = ADVISED_PART * motion.timestep;
        let carried = Some(carried).filter(|timestep| timestep.is_finite());
        [self.advised, carried]
            .into_iter()
            .flatten()
            .reduce(f64::min)
    }

    /// The smallest over all poses that can be relied on, effort held over the step \[s\]: `minimum_held` where it is
    /// certified or there is no bound, else the bound.
    #[must_use]
    pub fn trusted(&self) -> Option<f64> {
        self.bound.filter(|_| !self.certified).or(self.minimum_held)
    }
}

/// All limits of a loop. Some 15 ms of one core for two links, 0.3 s for three (optimised build).
#[must_use]
pub fn limits<const N: usize>(control: &ControlLoop<N>) -> Limits<N> {
    at_once(search_limits(*control))
}

/// The most memory that [`search_limits`] takes, in bytes.
#[must_use]
pub const fn most_bytes<const N: usize>() -> usize {
    Proof::<N>::MOST_BYTES + poses::most_bytes::<N>()
}

/// Does what [`limits`] does, in pieces.
pub async fn search_limits<const N: usize>(control: ControlLoop<N>) -> Limits<N> {
    let method = control.method;
    let (equilibrium, kind, linear) = settle(&control);
    pause().await;
    let mut held = largest_timestep(&linear, method, Sampling::Held);
    // A joint that nothing draws back drifts, but a loop that is stable at some timestep does not run away.
    let mut runs_away = held == Some(0.0) && Modes::of(&linear).run_away();
    pause().await;
    let continuous = largest_timestep(&linear, method, Sampling::Continuous);
    pause().await;
    let here = PoseCandidate::as_it_is(equilibrium);
    let (mut least, mut worst) = (held, here);
    let (mut bound, mut runaway) = (None, None);
    if let Some(Proven { timestep, pose }) = prove(&control).await {
        bound = Some(timestep);
        // The pose where the bound comes nearest to fail.
        let nearest = PoseCandidate::as_it_is(pose);
        let there = largest_timestep(&nearest.linear(&control), method, Sampling::Held);
        if there.is_some_and(|there| there > 0.0 && least.is_none_or(|least| there < least)) {
            (least, worst) = (there, nearest);
        }
        if held == Some(0.0) {
            // Rounding alone can make slow modes seem to grow beside rates a trillion times their own. A proof does not
            // round.
            (held, least, runs_away) = (bound, bound, false);
        }
    } else if control.integrating().contains(&true) && control.arm.gravity() > 0.0 {
        let known = (None, here);
        let (found, pose) = smallest_of_all_poses(control, Sought::Runaway, known).await;
        runaway = found.map(|_| pose);
    }
    let mut agrees = is_near(bound, least);
    if !agrees {
        // All poses, or those without gravity where some pose with it runs away.
        let sought = match runaway {
            Some(_) => Sought::WeightlessLimit,
            None => Sought::Limit(Sampling::Held),
        };
        (least, worst) = smallest_of_all_poses(control, sought, (least, worst)).await;
        agrees = is_near(bound, least);
    }
    let useful = bound.filter(|bound| least.is_some_and(|least| *bound >= USEFUL * least));
    let has_no_estimate = method == Method::Euler || control.arm.gravity() == 0.0;
    let mut limits = Limits {
        equilibrium,
        rest: if runs_away { Rest::Unstable } else { kind },
        held,
        continuous,
        minimum_held: least,
        minimum_continuous: Some(0.0),
        bound: useful,
        bound_is_proven: useful.is_some() && has_no_estimate,
        certified: agrees,
        worst_pose: None,
        critical: None,
        advised: None,
    };
    if let Some(pose) = runaway {
        limits.advised = least.map(|limit| ADVISED_PART * limit);
        limits.minimum_held = Some(0.0);
        limits.worst_pose = Some(pose.pose);
        limits.critical = critical(&pose.linear(&control), method, 0.0);
        return limits;
    }
    limits.advised = limits.trusted().map(|limit| ADVISED_PART * limit);
    if let Some(limit) = least {
        limits.worst_pose = Some(worst.pose);
        limits.critical = critical(&worst.linear(&control), method, limit);
    }
    pause().await;
    let sought = Sought::Limit(Sampling::Continuous);
    let found = smallest_of_all_poses(control, sought, (continuous, here)).await;
    limits.minimum_continuous = found.0;
    limits
}

/// The bound for all poses, if there is something to prove it with.
async fn prove<const N: usize>(control: &ControlLoop<N>) -> Option<Proven<N>> {
    let mut proof = Proof::new(control)?;
    loop {
        if let Some(proven) = proof.advance(BOXES) {
            return Some(proven);
        }
        pause().await;
    }
}

/// The pose in which the loop rests, how it does so, and the loop there.
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

/// Whether there are a bound and a smallest limit, and they agree. The limit may fall short of the bound a little,
/// since growth counts only from some size on.
fn is_near(bound: Option<f64>, least: Option<f64>) -> bool {
    let both = bound.zip(least);
    both.is_some_and(|(bound, least)| (least / bound - 1.0).abs() <= AGREEMENT)
}

/// The limit [`Limits::held`] alone, for the live arm at its present setpoint. Half a millisecond of one core for two
/// links, one for three (optimised build).
#[must_use]
pub fn limit_held<const N: usize>(control: &ControlLoop<N>) -> Option<f64> {
    let linear = Linear::at_setpoint(control);
    match largest_timestep(&linear, control.method, Sampling::Held) {
        // This is as in the search for all limits.
        Some(0.0) => Proof::new(control)
            .and_then(|mut proof| proof.advance(BOXES))
            .map_or(Some(0.0), |proven| Some(proven.timestep)),
        limit => limit,
    }
}

//! All limits of a control loop: at its setpoint, and the smallest over all poses, bounded from below where it can be.
//!
//! **Invariant:** a search cut into slices finds the same bits as one made at once.

use super::control_loop::ControlLoop;
use super::critical::{Critical, critical};
use super::linear::{Linear, equilibrium};
use super::motion::Motion;
use super::poses::{PoseCandidate, PoseSearch, Sought};
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
    let mut search = LimitSearch::new(control);
    loop {
        if let Some(limits) = search.advance() {
            return limits;
        }
    }
}

/// A search for [`limits`] that can be paused: no advance takes longer than about a millisecond of one core (optimised
/// build).
#[derive(Debug, Clone)]
pub struct LimitSearch<const N: usize> {
    control: ControlLoop<N>,
    limits: Limits<N>,
    /// How the loop rests, unless it runs away.
    kind: Rest,
    /// A pose in which the loop runs away.
    runaway: Option<PoseCandidate<N>>,
    stage: LimitStage<N>,
}

#[derive(Debug, Clone)]
enum LimitStage<const N: usize> {
    Setpoint,
    Held(Linear),
    Continuous(Linear),
    Proving(Box<Proof<N>>),
    Runaway(PoseSearch<N>),
    Poses(Sampling, PoseSearch<N>),
    Done,
}

impl<const N: usize> LimitSearch<N> {
    /// The most memory that a search takes, in bytes.
    pub const MOST_BYTES: usize = size_of::<Self>() + Proof::<N>::MOST_BYTES;

    /// A search that has not begun.
    #[must_use]
    pub fn new(control: &ControlLoop<N>) -> Self {
        Self {
            control: *control,
            limits: Limits {
                equilibrium: control.setpoint.position,
                rest: Rest::Setpoint,
                held: None,
                continuous: None,
                minimum_held: None,
                minimum_continuous: None,
                bound: None,
                bound_is_proven: false,
                certified: false,
                worst_pose: None,
                critical: None,
                advised: None,
            },
            kind: Rest::Setpoint,
            runaway: None,
            stage: LimitStage::Setpoint,
        }
    }

    /// Goes on by one piece. Returns the limits once they are all found.
    pub fn advance(&mut self) -> Option<Limits<N>> {
        let method = self.control.method;
        let limits = &mut self.limits;
        self.stage = match std::mem::replace(&mut self.stage, LimitStage::Done) {
            LimitStage::Setpoint => LimitStage::Held(self.settle()),
            LimitStage::Held(linear) => {
                limits.held = largest_timestep(&linear, method, Sampling::Held);
                // A joint that nothing draws back drifts, but a loop that is stable at some timestep does not run away.
                if limits.held == Some(0.0) && Modes::of(&linear).run_away() {
                    limits.rest = Rest::Unstable;
                }
                LimitStage::Continuous(linear)
            }
            LimitStage::Continuous(linear) => {
                limits.continuous = largest_timestep(&linear, method, Sampling::Continuous);
                match Proof::new(&self.control) {
                    Some(proof) => LimitStage::Proving(Box::new(proof)),
                    None => self.search_without_bound(),
                }
            }
            LimitStage::Proving(mut proof) => match proof.advance(BOXES) {
                None => LimitStage::Proving(proof),
                Some(proven) => self.compare(&proven),
            },
            LimitStage::Runaway(mut search) => {
                if search.advance() {
                    LimitStage::Runaway(search)
                } else {
                    let (found, pose) = search.smallest();
                    self.runaway = found.map(|_| pose);
                    self.search_held(self.at_rest(self.limits.held))
                }
            }
            LimitStage::Poses(sampling, mut search) => {
                if search.advance() {
                    LimitStage::Poses(sampling, search)
                } else {
                    self.conclude(sampling, search.smallest())
                }
            }
            LimitStage::Done => return Some(self.limits),
        };
        matches!(self.stage, LimitStage::Done).then_some(self.limits)
    }

    /// The loop where it rests.
    fn settle(&mut self) -> Linear {
        let control = &self.control;
        let rest = equilibrium(control);
        let linear = Linear::at(control, &rest.position, &rest.integrating);
        let mut off = rest.position.iter().zip(&control.setpoint.position);
        self.limits.equilibrium = rest.position;
        self.kind = if rest.balanced {
            Rest::Saddle
        } else if control.is_free() {
            Rest::Hanging
        } else if off.all(|(rest, setpoint)| (rest - setpoint).abs() <= AT_SETPOINT) {
            Rest::Setpoint
        } else {
            Rest::Sagging
        };
        self.limits.rest = self.kind;
        linear
    }

    /// A limit of the pose in which the loop rests.
    fn at_rest(&self, limit: Option<f64>) -> (Option<f64>, PoseCandidate<N>) {
        (limit, PoseCandidate::as_it_is(self.limits.equilibrium))
    }

    /// Looks for a pose that runs away, where there may be one, before all poses are searched.
    fn search_without_bound(&self) -> LimitStage<N> {
        let control = &self.control;
        if control.integrating().contains(&true) && control.arm.gravity() > 0.0 {
            let search = PoseSearch::new(control, Sought::Runaway, self.at_rest(None));
            LimitStage::Runaway(search)
        } else {
            self.search_held(self.at_rest(self.limits.held))
        }
    }

    /// Compares the bound with the limit in the pose where it comes nearest to fail. If they agree, no search follows.
    fn compare(&mut self, &Proven { timestep, pose }: &Proven<N>) -> LimitStage<N> {
        let control = &self.control;
        let mut found = self.at_rest(self.limits.held);
        let linear = Linear::at_pose(control, &pose);
        let there = largest_timestep(&linear, control.method, Sampling::Held);
        if let Some(limit) = there
            && limit > 0.0
            && found.0.is_none_or(|least| limit < least)
        {
            found = (there, PoseCandidate::as_it_is(pose));
        }
        self.limits.bound = Some(timestep);
        if self.limits.held == Some(0.0) {
            // Rounding alone can make slow modes seem to grow beside rates a trillion times their own. A proof does not
            // round.
            self.limits.held = Some(timestep);
            self.limits.rest = self.kind;
            found.0 = self.limits.held;
        }
        if found.0.is_some_and(|least| agree(timestep, least)) {
            return self.conclude(Sampling::Held, found);
        }
        self.search_held(found)
    }

    /// Searches all poses, or those without gravity where some pose with it runs away.
    fn search_held(&self, found: (Option<f64>, PoseCandidate<N>)) -> LimitStage<N> {
        let sought = match self.runaway {
            Some(_) => Sought::WeightlessLimit,
            None => Sought::Limit(Sampling::Held),
        };
        let search = PoseSearch::new(&self.control, sought, found);
        LimitStage::Poses(Sampling::Held, search)
    }

    /// Notes the smallest limit over all poses, and goes on with the next search, if there is one.
    fn conclude(
        &mut self,
        sampling: Sampling,
        (least, worst): (Option<f64>, PoseCandidate<N>),
    ) -> LimitStage<N> {
        let control = &self.control;
        let limits = &mut self.limits;
        if sampling == Sampling::Continuous {
            limits.minimum_continuous = least;
            return LimitStage::Done;
        }
        if let Some(pose) = self.runaway {
            limits.advised = least.map(|limit| ADVISED_PART * limit);
            limits.minimum_held = Some(0.0);
            limits.minimum_continuous = Some(0.0);
            limits.worst_pose = Some(pose.pose);
            limits.critical = critical(&pose.linear(control), control.method, 0.0);
            return LimitStage::Done;
        }
        limits.minimum_held = least;
        limits.bound = limits
            .bound
            .filter(|bound| least.is_some_and(|least| *bound >= USEFUL * least));
        limits.bound_is_proven = limits.bound.is_some()
            && (control.method == Method::Euler || control.arm.gravity() == 0.0);
        limits.certified =
            matches!((limits.bound, least), (Some(bound), Some(least)) if agree(bound, least));
        limits.advised = limits.trusted().map(|limit| ADVISED_PART * limit);
        if let Some(limit) = least {
            limits.worst_pose = Some(worst.pose);
            limits.critical = critical(&worst.linear(control), control.method, limit);
        }
        let known = self.at_rest(self.limits.continuous);
        let sought = Sought::Limit(Sampling::Continuous);
        let search = PoseSearch::new(&self.control, sought, known);
        LimitStage::Poses(Sampling::Continuous, search)
    }
}

/// Whether a bound and the smallest limit found agree. The limit may fall short of the bound a little, since
/// growth counts only from some size on.
fn agree(bound: f64, least: f64) -> bool {
    (least / bound - 1.0).abs() <= AGREEMENT
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

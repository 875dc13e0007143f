//! A plan: the method and the timestep that keep the end effector within an allowed error at least cost.
//!
//! | question | the truth that errors are measured from |
//! | --- | --- |
//! | an arm left to itself | its motion |
//! | an arm under control | the loop whose law acts at every instant ([`ContinuousLoop`]): holding is an error |
//!
//! The truth is followed with ever smaller steps, or, for an arm left to itself, within ever smaller tolerances, until
//! two truths agree to a part of the allowed error. Then each method is run beside the truth, as the live arm runs it.
//! Its steps are made smaller until it stays within the rest of the error after each of them, and then larger again by
//! bisection. The cheapest run, in evaluations of the dynamics, is the plan, and its error is the one that was seen. A
//! run that could only be dearer than another is not made.
//!
//! On the live arm the control period is the timestep. Under control no timestep is planned beyond what is advised for
//! every pose, since the error of one move says nothing about the next.
//!
//! **Invariant:** the work is bounded when a plan is asked for, and every candidate that is answered has been run.

use std::f64::consts::PI;

use super::beside::{Beside, FreeMotion, Truth};
use super::continuous::ContinuousLoop;
use super::control_loop::ControlLoop;
use super::follower::ROUNDING;
use super::limits::LimitSearch;
use crate::math::arm::State;
use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::math::shown::Shown;
use crate::math::simulation::Simulation;

/// Longest timestep that is planned \[s\].
const LONGEST: f64 = 0.05;

/// Fewest steps of a run.
const FEWEST_STEPS: f64 = 16.0;

/// Longest duration that is planned \[s\].
pub const MAX_DURATION: f64 = 1000.0;

/// Most steps of the truth, and of one run.
const MAX_STEPS: u64 = 4_000_000;

/// The part of the allowed error that the truth itself may be off by.
const PART_OF_TRUTH: f64 = 0.05;

/// A tolerance that was too large is multiplied by this: two digits more cost less than half as much work again.
const FINER: f64 = 0.01;

/// The motion to be planned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Task<const N: usize> {
    /// The loop; its method and timestep are looked for. Gains of zero mean an arm left to itself.
    pub control: ControlLoop<N>,
    /// The arm's state at the start.
    pub start: State<N>,
    /// How long \[s\].
    pub duration: f64,
    /// Largest distance of the end effector from where it ought to be \[m\].
    pub error: f64,
}

/// A run that keeps within the allowed error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Its method.
    pub method: Method,
    /// Its timestep \[s\].
    pub timestep: f64,
    /// Evaluations of the dynamics that it made.
    pub evaluations: u64,
    /// How far the end effector was off at most, after any of its steps \[m\].
    pub error: f64,
}

/// A plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// The runs that were within the error, the cheapest last; the others are dearer, or cannot be had.
    pub candidates: Vec<Candidate>,
    /// How far the truth itself may be off \[m\].
    pub uncertainty: f64,
}

impl Planned {
    /// The cheapest run.
    #[must_use]
    pub fn best(&self) -> Option<&Candidate> {
        self.candidates.last()
    }
}

/// Why there is no plan.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// A duration that is too long.
    #[error("duration must be at most {MAX_DURATION} s, got {}", Shown(*.duration))]
    TooLong {
        /// The given duration \[s\].
        duration: f64,
    },
    /// The motion amplifies rounding beyond the allowed error, or is too wild to be followed.
    #[error("error must be larger or duration shorter: {}", known(*.uncertainty))]
    Unknown {
        /// By how much two of the truths differ \[m\]; infinite where there are no two.
        uncertainty: f64,
    },
    /// No method stays within the error.
    #[error("error must be larger: no method stays within {error:e} m in {MAX_STEPS} steps")]
    NotFound {
        /// The given error \[m\].
        error: f64,
    },
}

/// The search for a plan, to be paused: no piece takes longer than a millisecond or so of one core (optimised build).
#[derive(Debug, Clone)]
pub struct Planning<const N: usize> {
    task: Task<N>,
    /// The longest timestep \[s\], a whole part of the duration; others are whole parts of it.
    longest: f64,
    /// Number of steps of that length.
    fewest: u64,
    /// How finely the truth is followed.
    fineness: Fineness,
    uncertainty: f64,
    /// Methods that have not been tried, the next one last.
    methods: Vec<Method>,
    candidates: Vec<Candidate>,
    stage: PlanStage<N>,
}

/// How finely a truth is followed.
#[derive(Debug, Clone, Copy)]
enum Fineness {
    /// Each longest timestep is cut into so many steps.
    Steps(u64),
    /// Within a tolerance.
    Tolerance(f64),
}

impl Fineness {
    fn finer(self) -> Self {
        match self {
            Self::Steps(steps) => Self::Steps(2 * steps),
            Self::Tolerance(tolerance) => Self::Tolerance(FINER * tolerance),
        }
    }
}

#[derive(Debug, Clone)]
enum PlanStage<const N: usize> {
    Comparing(Box<Beside<Truth<N>, N>>),
    Limiting(Method, Box<LimitSearch<N>>),
    /// Each longest timestep is cut into so many steps.
    Running(Bracket, u64, Box<Beside<Simulation<N>, N>>),
    Done(Result<Planned, PlanError>),
}

/// Numbers of steps in the longest timestep: one that is too few, and one that is enough, once it is known.
#[derive(Debug, Clone, Copy)]
struct Bracket {
    method: Method,
    too_few: u64,
    enough: Option<u64>,
}

impl<const N: usize> Planning<N> {
    /// The most memory that a plan takes, in bytes.
    pub const MOST_BYTES: usize = size_of::<Self>()
        + size_of::<Beside<Truth<N>, N>>()
        + size_of::<Beside<Simulation<N>, N>>()
        + LimitSearch::<N>::MOST_BYTES;

    /// A plan about to be made.
    ///
    /// # Errors
    /// A duration that is too long.
    pub fn new(task: Task<N>) -> Result<Self, PlanError> {
        let Task { duration, .. } = task;
        if duration.is_nan() || duration > MAX_DURATION {
            return Err(PlanError::TooLong { duration });
        }
        let fewest = whole(duration / LONGEST).max(whole(FEWEST_STEPS));
        let fineness = if task.control.is_free() {
            // This part of half a turn moves the end effector of the stretched arm by the truth's part of the error.
            let reach = task.control.arm.reach();
            let tolerance = PART_OF_TRUTH * task.error / (PI * reach);
            // The truth that it is first compared with must be finer.
            Fineness::Tolerance(tolerance.max(ROUNDING / FINER))
        } else {
            Fineness::Steps(4)
        };
        let mut planning = Self {
            task,
            longest: duration / in_f64(fewest),
            fewest,
            fineness,
            uncertainty: f64::INFINITY,
            methods: Method::ALL.to_vec(),
            candidates: Vec::new(),
            stage: PlanStage::Done(Err(PlanError::Unknown {
                uncertainty: f64::INFINITY,
            })),
        };
        planning.compare_truths();
        Ok(planning)
    }

    /// Goes on by one piece. Returns the plan once it is made.
    pub fn advance(&mut self) -> Option<Result<Planned, PlanError>> {
        match &mut self.stage {
            PlanStage::Done(answer) => return Some(answer.clone()),
            PlanStage::Comparing(truths) => {
                if let Some(apart) = truths.advance() {
                    self.judge_truths(apart);
                }
            }
            PlanStage::Limiting(method, search) => {
                let method = *method;
                if let Some(limits) = search.advance() {
                    let most = limits.advised.unwrap_or(f64::INFINITY);
                    self.begin(method, most);
                }
            }
            PlanStage::Running(bracket, steps, run) => {
                if let Some(error) = run.advance() {
                    let (bracket, steps) = (*bracket, *steps);
                    self.narrow(bracket, steps, error);
                }
            }
        }
        None
    }

    /// The truth, followed so finely, and how many of its steps make one of a run. The run takes `steps` steps in the
    /// longest timestep.
    fn truth(&self, fineness: Fineness, steps: u64) -> (Truth<N>, u64) {
        let Task { control, start, .. } = self.task;
        match fineness {
            Fineness::Steps(finest) => {
                let each = finest.div_ceil(steps);
                let timestep = self.longest / in_f64(steps * each);
                let law = ContinuousLoop {
                    control: control.with_method(Method::Rk4).with_timestep(timestep),
                    state: start,
                    integral: [0.0; N],
                };
                (Truth::Law(law), each)
            }
            Fineness::Tolerance(tolerance) => {
                let timestep = self.longest / in_f64(steps);
                let motion = FreeMotion::new(control.arm, start, timestep, tolerance);
                (Truth::Free(motion), 1)
            }
        }
    }

    /// Begins to compare the truth with one that is followed more finely.
    fn compare_truths(&mut self) {
        let steps = match self.fineness {
            Fineness::Steps(steps) => steps,
            Fineness::Tolerance(_) => 1,
        };
        let (coarse, _) = self.truth(self.fineness, steps);
        let (fine, each) = self.truth(self.fineness.finer(), steps);
        let truths = Beside::new(coarse, steps * self.fewest, fine, each, f64::INFINITY);
        self.stage = PlanStage::Comparing(Box::new(truths));
    }

    /// Goes on with the finer of two truths that came so far apart \[m\], if they are near enough or can't come nearer.
    fn judge_truths(&mut self, apart: f64) {
        if apart.is_finite() {
            self.uncertainty = apart;
        }
        self.fineness = self.fineness.finer();
        let can_be_finer = match self.fineness {
            Fineness::Steps(steps) => 2 * steps * self.fewest <= MAX_STEPS,
            Fineness::Tolerance(tolerance) => apart.is_finite() && tolerance > ROUNDING,
        };
        if apart <= PART_OF_TRUTH * self.task.error {
            self.next_method();
        } else if can_be_finer {
            self.compare_truths();
        } else {
            let uncertainty = self.uncertainty;
            self.stage = PlanStage::Done(Err(PlanError::Unknown { uncertainty }));
        }
    }

    fn next_method(&mut self) {
        let Some(method) = self.methods.pop() else {
            let error = self.task.error;
            self.candidates
                .sort_by_key(|one| std::cmp::Reverse(one.evaluations));
            self.stage = PlanStage::Done(if self.candidates.is_empty() {
                Err(PlanError::NotFound { error })
            } else {
                Ok(Planned {
                    candidates: std::mem::take(&mut self.candidates),
                    uncertainty: self.uncertainty,
                })
            });
            return;
        };
        if self.task.control.is_free() {
            self.begin(method, f64::INFINITY);
        } else {
            let search = LimitSearch::new(&self.task.control.with_method(method));
            self.stage = PlanStage::Limiting(method, Box::new(search));
        }
    }

    /// Begins with the longest timestep, `most` \[s\] at most.
    fn begin(&mut self, method: Method, most: f64) {
        let steps = whole(self.longest / most).max(1);
        let bracket = Bracket {
            method,
            too_few: steps - 1,
            enough: None,
        };
        self.run(bracket, steps);
    }

    /// Runs a method with so many steps in the longest timestep, unless there is a cheaper candidate already.
    fn run(&mut self, bracket: Bracket, steps: u64) {
        let Bracket { method, .. } = bracket;
        let all = steps.saturating_mul(self.fewest);
        let cost = all.saturating_mul(u64::from(method.evaluations()));
        if all > MAX_STEPS || self.candidates.iter().any(|one| one.evaluations <= cost) {
            return self.next_method();
        }
        let timestep = self.longest / in_f64(steps);
        let control = self
            .task
            .control
            .with_method(method)
            .with_timestep(timestep);
        let live = control.simulation(self.task.start);
        let (truth, each) = self.truth(self.fineness, steps);
        let allowed = self.task.error - self.uncertainty;
        let run = Beside::new(live, all, truth, each, allowed);
        self.stage = PlanStage::Running(bracket, steps, Box::new(run));
    }

    fn narrow(&mut self, bracket: Bracket, steps: u64, error: f64) {
        let Bracket { method, .. } = bracket;
        let bracket = if error + self.uncertainty <= self.task.error {
            self.candidates.retain(|one| one.method != method);
            self.candidates.push(Candidate {
                method,
                timestep: self.longest / in_f64(steps),
                evaluations: steps * self.fewest * u64::from(method.evaluations()),
                error,
            });
            Bracket {
                enough: Some(steps),
                ..bracket
            }
        } else {
            Bracket {
                too_few: steps,
                ..bracket
            }
        };
        let next = match bracket.enough {
            None => 2 * steps,
            Some(enough) => bracket.too_few + (enough - bracket.too_few) / 2,
        };
        if next == bracket.too_few || bracket.enough == Some(next) {
            self.next_method();
        } else {
            self.run(bracket, next);
        }
    }
}

/// Says how well a motion is known if two truths differ by so much.
fn known(uncertainty: f64) -> String {
    if uncertainty.is_finite() {
        format!("the motion itself can only be known to {uncertainty:.1e} m for so long")
    } else {
        "the motion itself can not be known so well for so long".to_owned()
    }
}

/// The least whole number that is not below `x`.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a count of steps; a cast saturates"
)]
fn whole(x: f64) -> u64 {
    x.ceil() as u64
}

//! A plan: the method and the timestep that keep the end effector within an allowed error at least cost.
//!
//! | question | the truth that errors are measured from |
//! | --- | --- |
//! | an arm left to itself | its motion |
//! | an arm under control | the loop whose law acts at every instant ([`ContinuousLoop`]): holding is an error |
//! | the same with a control period that is given | the loop whose law runs once a period: holding is none |
//!
//! The truth is computed with smaller and smaller steps, until two truths agree to a part of the allowed error. For a
//! free arm the tolerance becomes smaller instead. Then each method is run beside the truth, as the live arm runs it.
//! The fewest steps are searched ([`StepSearch`]) with which it stays within the rest of the error after each of them.
//! The cheapest run, in evaluations of the dynamics, is the plan, and its error is the one that was seen. A run that
//! could only be dearer than another is not made.
//!
//! Where no control period is given both are planned. The law then runs in every step, since a longer period at the
//! same timestep costs as much and is further from the truth. Under control no timestep is planned beyond what is
//! advised for every pose, since the error of one move says nothing about the next.
//!
//! **Invariant:** the work is bounded when a plan is asked for, and every candidate that is answered has been run.

use std::f64::consts::PI;

use super::beside::{Beside, FreeMotion, ReferenceRun};
use super::clocks::clock_limits;
use super::continuous::ContinuousLoop;
use super::control_loop::ControlLoop;
use super::fewest::StepSearch;
use super::limits::LimitSearch;
use super::taylor::ROUNDING;
use crate::math::arm::State;
use crate::math::count::{self, in_f64};
use crate::math::integrator::Method;
use crate::math::shown::{Shown, shown_against};
use crate::math::simulation::Simulation;

/// Longest time between two comparisons of truths \[s\], and how many there are at least.
const LONGEST_SPAN: f64 = 0.05;
const FEWEST_SPANS: f64 = 16.0;

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
    /// The loop; its method and timestep are looked for, and its control period where that is 0. Gains of zero mean an
    /// arm left to itself.
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
    #[error("duration must be at most {MAX_DURATION} s, got {}", shown_against(*.duration, MAX_DURATION))]
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
    #[error("error must be larger: no method stays within {} m in {MAX_STEPS} steps", Shown(*.error))]
    NotFound {
        /// The given error \[m\].
        error: f64,
    },
    /// Nothing was run, since the loop is stable at no timestep.
    #[error(
        "gains or control_period must be others: the loop is unstable at every timestep, at the setpoint or in a pose \
         on the way (/study/stability says where), so nothing was run"
    )]
    Unstable,
    /// Nothing was run, since the longest stable timestep is too short.
    #[error(
        "duration must be shorter: at the longest stable timestep, {} s, it takes more than {MAX_STEPS} steps, so \
         nothing was run",
        Shown(*.timestep)
    )]
    TooManySteps {
        /// The longest timestep that is stable with any method \[s\].
        timestep: f64,
    },
}

/// The search for a plan, to be paused: no piece takes longer than a millisecond or so of one core (optimised build).
#[derive(Debug, Clone)]
pub struct Planning<const N: usize> {
    task: Task<N>,
    /// The duration, or the control period \[s\]: timesteps are whole parts of it.
    whole: f64,
    /// How many of it there are.
    count: u64,
    /// The longest stable timestep of all methods so far \[s\], and whether any was run.
    longest_stable: f64,
    has_run: bool,
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
    /// Each whole is cut into so many steps.
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
    Comparing(Box<Beside<ReferenceRun<N>, N>>),
    Limiting(Method, Box<LimitSearch<N>>),
    /// The search looks for the number of steps in the whole.
    Running(Method, StepSearch, Box<Beside<Simulation<N>, N>>),
    Done(Result<Planned, PlanError>),
}

impl<const N: usize> Planning<N> {
    /// The most memory that a plan takes, in bytes.
    pub const MOST_BYTES: usize = size_of::<Self>()
        + size_of::<Beside<ReferenceRun<N>, N>>()
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
        let control = &task.control;
        let (count, whole) = if is_sampled(control) {
            let period = control.period.period;
            (ceiling((duration / period).round()).max(1), period)
        } else {
            (1, duration)
        };
        let fineness = if task.control.is_free() {
            // This part of half a turn moves the end effector of the stretched arm by the truth's part of the error.
            let reach = task.control.arm.reach();
            let tolerance = PART_OF_TRUTH * task.error / (PI * reach);
            // The truth that it is first compared with must be finer.
            Fineness::Tolerance(tolerance.max(ROUNDING / FINER))
        } else {
            Fineness::Steps(4 * spans(whole, count))
        };
        let mut planning = Self {
            task,
            whole,
            count,
            longest_stable: 0.0,
            has_run: false,
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
            PlanStage::Running(method, search, run) => {
                if let Some(error) = run.advance() {
                    let (method, search) = (*method, *search);
                    self.judge(method, search, error);
                }
            }
        }
        None
    }

    /// The truth, followed so finely, and how many of its steps make one of a run that takes `steps` steps in the
    /// whole.
    fn truth(&self, fineness: Fineness, steps: u64) -> (ReferenceRun<N>, u64) {
        let Task { control, start, .. } = self.task;
        match fineness {
            Fineness::Steps(finest) => {
                let each = finest.div_ceil(steps);
                let timestep = self.whole / in_f64(steps * each);
                if is_sampled(&control) {
                    let control = control.with_method(Method::Rk4).with_timestep(timestep);
                    let sampled = Box::new(control.simulation(start));
                    return (ReferenceRun::Sampled(sampled), each);
                }
                let law = ContinuousLoop {
                    control: control.with_method(Method::Rk4).with_timestep(timestep),
                    state: start,
                    integral: [0.0; N],
                };
                (ReferenceRun::Law(law), each)
            }
            Fineness::Tolerance(tolerance) => {
                let timestep = self.whole / in_f64(steps);
                let motion = FreeMotion::new(control.arm, start, timestep, tolerance);
                (ReferenceRun::Free(motion), 1)
            }
        }
    }

    /// Begins to compare the truth with one that is followed more finely.
    fn compare_truths(&mut self) {
        let steps = match self.fineness {
            Fineness::Steps(steps) => steps,
            Fineness::Tolerance(_) => spans(self.whole, self.count),
        };
        let (coarse, _) = self.truth(self.fineness, steps);
        let (fine, each) = self.truth(self.fineness.finer(), steps);
        let truths = Beside::new(coarse, steps * self.count, fine, each, f64::INFINITY);
        self.stage = PlanStage::Comparing(Box::new(truths));
    }

    /// Goes on with the finer of two truths that came so far apart \[m\], if they are near enough or can't come nearer.
    fn judge_truths(&mut self, apart: f64) {
        if apart.is_finite() {
            self.uncertainty = apart;
        }
        self.fineness = self.fineness.finer();
        let can_be_finer = match self.fineness {
            Fineness::Steps(steps) => 2 * steps * self.count <= MAX_STEPS,
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
            self.conclude();
            return;
        };
        if self.task.control.is_free() {
            self.begin(method, f64::INFINITY);
        } else if is_sampled(&self.task.control) {
            let limits = clock_limits(&self.task.control.with_method(method));
            let most = limits.timestep.unwrap_or(f64::INFINITY);
            // It is a whole part of the period, but for rounding.
            self.begin(method, most * (1.0 + count::ROUNDING));
        } else {
            let search = LimitSearch::new(&self.task.control.with_method(method));
            self.stage = PlanStage::Limiting(method, Box::new(search));
        }
    }

    fn conclude(&mut self) {
        self.candidates
            .sort_by_key(|one| std::cmp::Reverse(one.evaluations));
        self.stage = PlanStage::Done(if !self.candidates.is_empty() {
            Ok(Planned {
                candidates: std::mem::take(&mut self.candidates),
                uncertainty: self.uncertainty,
            })
        } else if self.has_run {
            let error = self.task.error;
            Err(PlanError::NotFound { error })
        } else if self.longest_stable > 0.0 {
            let timestep = self.longest_stable;
            Err(PlanError::TooManySteps { timestep })
        } else {
            Err(PlanError::Unstable)
        });
    }

    /// Begins to search the fewest steps of a method whose longest stable timestep is `most` \[s\].
    fn begin(&mut self, method: Method, most: f64) {
        self.longest_stable = self.longest_stable.max(most);
        let fewest = ceiling(self.whole / most * (1.0 - count::ROUNDING));
        // As many as cost less than the best run so far.
        let cheapest = self.candidates.iter().map(|one| one.evaluations).min();
        let affordable = cheapest.map_or(u64::MAX, |least| {
            least.saturating_sub(1) / u64::from(method.evaluations())
        });
        self.run(
            method,
            StepSearch::new(fewest, affordable.min(MAX_STEPS) / self.count),
        );
    }

    /// Makes the next run of a search.
    fn run(&mut self, method: Method, search: StepSearch) {
        let Some(steps) = search.wanted() else {
            return self.next_method();
        };
        self.has_run = true;
        let timestep = self.whole / in_f64(steps);
        let control = self
            .task
            .control
            .with_method(method)
            .with_timestep(timestep);
        let live = control.simulation(self.task.start);
        let (truth, each) = self.truth(self.fineness, steps);
        let allowed = self.task.error - self.uncertainty;
        let run = Beside::new(live, steps * self.count, truth, each, allowed);
        self.stage = PlanStage::Running(method, search, Box::new(run));
    }

    /// Takes the error of a run of a search, and goes on with the search.
    fn judge(&mut self, method: Method, mut search: StepSearch, error: f64) {
        let is_enough = error + self.uncertainty <= self.task.error;
        if let Some(steps) = search.wanted().filter(|_| is_enough) {
            self.candidates.retain(|one| one.method != method);
            self.candidates.push(Candidate {
                method,
                timestep: self.whole / in_f64(steps),
                evaluations: steps * self.count * u64::from(method.evaluations()),
                error,
            });
        }
        search.tell(is_enough);
        self.run(method, search);
    }
}

/// Parts of a whole \[s\], of which there are `count`, after which truths are compared.
fn spans(whole: f64, count: u64) -> u64 {
    ceiling((whole / LONGEST_SPAN).max(FEWEST_SPANS / in_f64(count)))
}

/// Whether the law runs at a period that is given.
fn is_sampled<const N: usize>(control: &ControlLoop<N>) -> bool {
    control.period.period > 0.0 && !control.is_free()
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
fn ceiling(x: f64) -> u64 {
    x.ceil() as u64
}

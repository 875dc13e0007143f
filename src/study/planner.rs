//! A plan: the method and the timestep that keep the end effector within an allowed error at least cost.
//!
//! | question | the truth that errors are measured from |
//! | --- | --- |
//! | an arm left to itself | its motion |
//! | an arm under control | the loop whose law acts at every instant ([`ContinuousLoop`]): holding is an error |
//!
//! The truth is followed with ever smaller steps, that of an arm left to itself within ever smaller tolerances, until
//! two of them agree to a part of the allowed error. Then each method is run as the live arm runs it, with ever smaller
//! steps until it stays within the rest at all samples, and a little larger again by bisection. The cheapest run, in
//! evaluations of the dynamics, is the plan: it has been run, and its error is that which was seen. A run that could
//! only be dearer than another is not made.
//!
//! On the live arm the control period is the timestep. Under control no timestep is planned beyond what is advised for
//! every pose, since the error of one move says nothing about the next.
//!
//! **Invariant:** the work is bounded when a plan is asked for, and every candidate that is answered has been run.

use std::f64::consts::PI;

use glam::DVec2;

use super::continuous::ContinuousLoop;
use super::control_loop::ControlLoop;
use super::follower::ROUNDING;
use super::limits::LimitSearch;
use super::track::{Followed, FreeMotion, apart};
use crate::math::arm::State;
use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::math::shown::Shown;
use crate::math::simulation::Simulation;

/// Longest time between two looks at the end effector \[s\]; also the longest timestep that is planned.
const SPACING: f64 = 0.05;

/// Fewest samples of a plan.
const FEWEST_SAMPLES: f64 = 16.0;

/// Longest duration that is planned \[s\].
pub const MAX_DURATION: f64 = 1000.0;

/// Most steps of the truth, and of one run.
const MAX_STEPS: u64 = 4_000_000;

/// Most samples of a plan, a few more than [`MAX_DURATION`] has.
const MAX_SAMPLES: usize = 20_001;

/// The part of the allowed error that the truth itself may be off by.
const PART_OF_TRUTH: f64 = 0.05;

/// The next tolerance's part of one that was too large: two digits more, for less than half as much work again.
const FINER: f64 = 0.01;

/// The motion to be planned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Task<const N: usize> {
    /// The loop; its method and timestep are what is looked for. Gains of zero: an arm left to itself.
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
    /// How far the end effector was off at most \[m\], with what it may have risen by between two samples.
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
    samples: u64,
    spacing: f64,
    /// End effector at the samples, as the finest of the truths has it.
    truth: Vec<DVec2>,
    uncertainty: f64,
    /// Methods that have not been tried, the next one last.
    methods: Vec<Method>,
    candidates: Vec<Candidate>,
    stage: PlanStage<N>,
}

/// How finely a truth is followed.
#[derive(Debug, Clone, Copy)]
enum Fineness {
    /// With so many steps between two samples.
    Steps(u64),
    /// Within a tolerance.
    Tolerance(f64),
}

#[derive(Debug, Clone)]
enum PlanStage<const N: usize> {
    Truth(Box<Followed<ContinuousLoop<N>>>),
    FreeTruth(Box<FreeMotion<N>>),
    Limiting(Method, Box<LimitSearch<N>>),
    Running(Bracket, Box<Followed<Simulation<N>>>),
    Done(Result<Planned, PlanError>),
}

/// Steps per sample: too few, and enough once they are known.
#[derive(Debug, Clone, Copy)]
struct Bracket {
    method: Method,
    too_few: u64,
    enough: Option<u64>,
}

impl<const N: usize> Planning<N> {
    /// The most memory that a plan takes, in bytes: two tracks, each of which may have grown to twice its length, and
    /// their differences.
    pub const MOST_BYTES: usize = size_of::<Self>()
        + size_of::<FreeMotion<N>>()
        + LimitSearch::<N>::MOST_BYTES
        + 5 * MAX_SAMPLES * size_of::<DVec2>();

    /// A plan about to be made.
    ///
    /// # Errors
    /// A duration that is too long.
    pub fn new(task: Task<N>) -> Result<Self, PlanError> {
        let Task { duration, .. } = task;
        if duration.is_nan() || duration > MAX_DURATION {
            return Err(PlanError::TooLong { duration });
        }
        let samples = whole(duration / SPACING).max(whole(FEWEST_SAMPLES));
        let spacing = duration / in_f64(samples);
        let mut planning = Self {
            task,
            samples,
            spacing,
            truth: Vec::new(),
            uncertainty: f64::INFINITY,
            methods: Method::ALL.to_vec(),
            candidates: Vec::new(),
            stage: PlanStage::Done(Err(PlanError::Unknown {
                uncertainty: f64::INFINITY,
            })),
        };
        planning.follow(if task.control.is_free() {
            // So much of half a turn moves the end effector of the stretched arm by the part of the error.
            let reach = task.control.arm.reach();
            Fineness::Tolerance(PART_OF_TRUTH * task.error / (PI * reach))
        } else {
            Fineness::Steps(4)
        });
        Ok(planning)
    }

    /// Goes on by one piece; the plan, once it is made.
    pub fn advance(&mut self) -> Option<Result<Planned, PlanError>> {
        match &mut self.stage {
            PlanStage::Done(answer) => return Some(answer.clone()),
            PlanStage::Truth(run) => {
                if let Some(finite) = run.advance(self.samples) {
                    let track = std::mem::take(&mut run.track);
                    let fineness = Fineness::Steps(run.per_sample);
                    self.compare(finite.then_some(track), fineness);
                }
            }
            PlanStage::FreeTruth(motion) => {
                if let Some(followed) = motion.advance(self.samples) {
                    let track = std::mem::take(&mut motion.track);
                    let fineness = Fineness::Tolerance(motion.tolerance);
                    self.compare(followed.then_some(track), fineness);
                }
            }
            PlanStage::Limiting(method, search) => {
                let method = *method;
                if let Some(limits) = search.advance() {
                    let most = limits.advised.unwrap_or(f64::INFINITY);
                    self.begin(method, most);
                }
            }
            PlanStage::Running(bracket, run) => {
                if let Some(finite) = run.advance(self.samples) {
                    let (bracket, per_sample) = (*bracket, run.per_sample);
                    let error = if finite {
                        apart(&run.track, &self.truth)
                    } else {
                        f64::INFINITY
                    };
                    self.narrow(bracket, per_sample, error);
                }
            }
        }
        None
    }

    fn follow(&mut self, fineness: Fineness) {
        let Task { control, start, .. } = self.task;
        self.stage = match fineness {
            Fineness::Steps(per_sample) => {
                let timestep = self.spacing / in_f64(per_sample);
                let truth = ContinuousLoop {
                    control: control.with_method(Method::Rk4).with_timestep(timestep),
                    state: start,
                    integral: [0.0; N],
                };
                PlanStage::Truth(Box::new(Followed::new(truth, per_sample)))
            }
            Fineness::Tolerance(tolerance) => {
                let motion = FreeMotion::new(control.arm, start, self.spacing, tolerance);
                PlanStage::FreeTruth(Box::new(motion))
            }
        };
    }

    /// Compares a truth, if it could be followed, with the one before, which was followed less finely.
    fn compare(&mut self, track: Option<Vec<DVec2>>, fineness: Fineness) {
        let followed = track.is_some();
        if let Some(track) = track {
            if self.truth.len() == track.len() {
                self.uncertainty = apart(&track, &self.truth);
            }
            self.truth = track;
        }
        let finer = match fineness {
            Fineness::Steps(steps) => {
                (2 * steps * self.samples <= MAX_STEPS).then_some(Fineness::Steps(2 * steps))
            }
            Fineness::Tolerance(tolerance) => {
                (followed && tolerance > ROUNDING).then_some(Fineness::Tolerance(FINER * tolerance))
            }
        };
        if self.uncertainty <= PART_OF_TRUTH * self.task.error {
            self.next_method();
        } else if let Some(finer) = finer {
            self.follow(finer);
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
        let fewest = whole(self.spacing / most).max(1);
        let bracket = Bracket {
            method,
            too_few: fewest - 1,
            enough: None,
        };
        self.run(bracket, fewest);
    }

    /// Runs a method with so many steps between two samples, unless there is a cheaper candidate already.
    fn run(&mut self, bracket: Bracket, per_sample: u64) {
        let steps = per_sample.saturating_mul(self.samples);
        let Bracket { method, .. } = bracket;
        let cost = steps.saturating_mul(u64::from(method.evaluations()));
        if steps > MAX_STEPS || self.candidates.iter().any(|one| one.evaluations <= cost) {
            return self.next_method();
        }
        let control = self.task.control.with_method(method);
        let timestep = self.spacing / in_f64(per_sample);
        let live = control.with_timestep(timestep).simulation(self.task.start);
        self.stage = PlanStage::Running(bracket, Box::new(Followed::new(live, per_sample)));
    }

    fn narrow(&mut self, bracket: Bracket, per_sample: u64, error: f64) {
        let Bracket { method, .. } = bracket;
        let bracket = if error + self.uncertainty <= self.task.error {
            self.candidates.retain(|one| one.method != method);
            let steps = per_sample * self.samples;
            self.candidates.push(Candidate {
                method,
                timestep: self.spacing / in_f64(per_sample),
                evaluations: steps * u64::from(method.evaluations()),
                error,
            });
            Bracket {
                enough: Some(per_sample),
                ..bracket
            }
        } else {
            Bracket {
                too_few: per_sample,
                ..bracket
            }
        };
        let next = match bracket.enough {
            None => 2 * per_sample,
            Some(enough) => bracket.too_few + (enough - bracket.too_few) / 2,
        };
        if next == bracket.too_few || bracket.enough == Some(next) {
            self.next_method();
        } else {
            self.run(bracket, next);
        }
    }
}

/// How well a motion is known of which two truths differ by so much.
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

//! A plan: the method and the timestep that keep the end effector within an allowed error at least cost.
//!
//! | question | the reference that errors are measured from |
//! | --- | --- |
//! | an arm left to itself | its motion |
//! | an arm under control | the loop whose law acts at every instant ([`ContinuousLoop`]): the hold is an error |
//! | the same with a control period that is given | the loop whose law runs once a period: the hold is no error |
//!
//! The reference of a law that acts at every instant is a run of Runge-Kutta 4, refined with smaller steps until two of
//! them agree to a part of the allowed error. The others are those of a rollout, known to rounding. Each method is then
//! simulated like the live arm and compared with the reference. A search ([`fewest`]) looks for the fewest steps with which
//! it stays within the rest of the error after every step. The plan is the cheapest run, in evaluations of the
//! dynamics, and its error is measured. Runs that cannot be cheaper are skipped.
//!
//! If no control period is given, it is planned too. The law then runs in every step: a longer period at the same
//! timestep costs as much and has a larger error. Under control the timestep never exceeds the advice for all poses,
//! since the error of one move does not bound that of the next.
//!
//! **Invariant:** the work is bounded by the request, and every returned candidate was simulated.

use super::beside::{Steppable, largest_distance};
use super::clocks::clock_limits;
use super::continuous::ContinuousLoop;
use super::control_loop::ControlLoop;
use super::fewest::{StepTrial, fewest};
use super::limits::{self, ADVISED_PART};
use super::method::loop_limits;
use super::own_run::OwnRun;
use super::paused::pause;
use super::rollout;
use super::tableau::Pair;
use crate::math::arm::State;
use crate::math::count::{self, in_f64};
use crate::math::integrator::Method;
use crate::math::shown::{Shown, shown_against};

/// Longest time between two comparisons of references \[s\], and the fewest intervals between comparisons.
const LONGEST_SPAN: f64 = 0.05;
const FEWEST_SPANS: f64 = 16.0;

/// Longest duration that is planned \[s\].
pub const MAX_DURATION: f64 = 1000.0;

/// Most steps of the reference, and of one run.
const MAX_STEPS: u64 = 4_000_000;

/// Uncertainty of the reference, relative to the allowed error: the wanted one, so that few steps are too many, and the
/// largest.
const PART_OF_REFERENCE: [f64; 2] = [0.001, 0.05];

/// Most evaluations of a run of one's own method, relative to the cheapest run.
pub const OWN_COST: u64 = 16;

/// The motion to be planned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Task<const N: usize> {
    /// The loop. Its method and timestep are planned, and its control period if that is 0. With gains of zero the arm
    /// is free.
    pub control: ControlLoop<N>,
    /// The arm's state at the start.
    pub start: State<N>,
    /// Duration of the motion \[s\], greater than 0.
    pub duration: f64,
    /// Largest allowed error of the end effector's position \[m\], greater than 0.
    pub error: f64,
}

/// A run within the allowed error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Its method.
    pub method: Method,
    /// Its timestep \[s\].
    pub timestep: f64,
    /// Its evaluations of the dynamics.
    pub evaluations: u64,
    /// Largest error of the end effector after any of its steps \[m\].
    pub error: f64,
}

/// A plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// The cheapest run.
    pub best: Candidate,
    /// The runs that were within the error, the cheapest last. No cheaper run of the other methods was found.
    pub candidates: Vec<Candidate>,
    /// Uncertainty of the reference \[m\].
    pub uncertainty: f64,
    /// The cheapest run found of a method of one's own. `None` if it costs more than [`OWN_COST`] times the best. Its
    /// `method` is that of the task, and has no effect.
    pub own: Option<Candidate>,
}

/// Why there is no plan.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// A duration that is too long \[s\].
    #[error("duration must be at most {MAX_DURATION} s, got {}", shown_against(*.0, MAX_DURATION))]
    TooLong(f64),
    /// A control period that is too long \[s\].
    #[error("control_period must be at most {MAX_DURATION} s, got {}", shown_against(*.0, MAX_DURATION))]
    PeriodTooLong(f64),
    /// More control periods than can be simulated.
    #[error(
        "duration / control_period must be at most {MAX_STEPS} periods, got {}",
        shown_against(*.0, in_f64(MAX_STEPS))
    )]
    TooManyPeriods(f64),
    /// The motion amplifies rounding beyond the allowed error, or changes too fast to be computed. The distance between
    /// two references \[m\]; infinite if there are no two.
    #[error("error must be larger or duration shorter: {}", known(*.0))]
    Unknown(f64),
    /// No method stays within the given error \[m\].
    #[error("error must be larger: no method stays within {} m in {MAX_STEPS} steps", Shown(*.0))]
    NotFound(f64),
    /// Nothing was simulated, since no stable timestep was found.
    #[error(
        "gains or control_period must be changed: the loop is unstable at all timesteps that were tried, at the \
         setpoint or in a pose on the way (/study/stability returns the pose), so nothing was simulated"
    )]
    Unstable,
    /// Nothing was simulated, since the longest timestep that is stable with any method is too small \[s\].
    #[error(
        "duration must be shorter: at the largest stable timestep, {} s, it takes more than {MAX_STEPS} steps, so \
         nothing was simulated",
        Shown(*.0)
    )]
    TooManySteps(f64),
}

/// Searches a plan, in pieces.
///
/// # Errors
/// The reason why there is no plan.
pub async fn plan<const N: usize>(task: Task<N>) -> Result<Planned, PlanError> {
    Ok(planned(task).await?.0)
}

/// The same, and the cheapest run of a method of one's own beside it.
///
/// # Errors
/// The reason why there is no plan.
pub async fn plan_beside<const N: usize>(
    task: Task<N>,
    own: Option<Pair>,
) -> Result<Planned, PlanError> {
    let (mut found, reference) = planned(task).await?;
    if let Some(pair) = own {
        found.own = own_run(&reference, pair, found.best.evaluations).await;
    }
    Ok(found)
}

/// A plan with its reference. A program without methods of one's own has no code of theirs.
async fn planned<const N: usize>(task: Task<N>) -> Result<(Planned, Reference<N>), PlanError> {
    if task.duration.is_nan() || task.duration > MAX_DURATION {
        return Err(PlanError::TooLong(task.duration));
    }
    let period = task.control.given_period();
    if period > MAX_DURATION {
        return Err(PlanError::PeriodTooLong(period));
    }
    let periods = (task.duration / period).ceil();
    if period > 0.0 && periods > in_f64(MAX_STEPS) {
        return Err(PlanError::TooManyPeriods(periods));
    }
    let mut loops = Vec::new();
    for method in Method::ALL.into_iter().rev() {
        pause().await;
        let control = task.control.with_method(method);
        loops.push((control, longest_timestep(&control).await));
    }
    let longest_stable = loops.iter().fold(0.0_f64, |most, (_, one)| most.max(*one));
    // The motion of such a loop is not known either, for this reason.
    if longest_stable <= 0.0 {
        return Err(PlanError::Unstable);
    }
    let reference = Reference::known_to(task).await?;
    let (mut candidates, mut has_run) = (Vec::<Candidate>::new(), false);
    for (control, most) in loops {
        let mut trials = MethodTrials {
            reference: &reference,
            control,
            run: |control: ControlLoop<N>| Box::new(control.simulation(task.start)),
            each: u64::from(control.method.evaluations()),
            best: None,
        };
        // A run that costs less than the best one so far.
        let cheapest = candidates.iter().map(|one| one.evaluations).min();
        has_run |= trials.search(most, cheapest.unwrap_or(u64::MAX) - 1).await;
        candidates.extend(trials.best);
    }
    candidates.sort_by_key(|one| std::cmp::Reverse(one.evaluations));
    let none = if has_run {
        PlanError::NotFound(task.error)
    } else {
        PlanError::TooManySteps(longest_stable)
    };
    let planned = Planned {
        best: *candidates.last().ok_or(none)?,
        candidates,
        uncertainty: reference.uncertainty,
        own: None,
    };
    Ok((planned, reference))
}

/// The cheapest run found of a method of one's own. Under control its timestep is at most a part of the limit near the
/// equilibrium, or the limit at a given period.
async fn own_run<const N: usize>(
    reference: &Reference<N>,
    pair: Pair,
    cheapest: u64,
) -> Option<Candidate> {
    let control = reference.task.control;
    let most = if control.is_free() {
        None
    } else {
        let (held, at_period) = loop_limits(&control, &pair).await;
        let advised = held.map(|limit| ADVISED_PART * limit);
        let is_given = control.given_period() > 0.0;
        if is_given { at_period } else { advised }
    };
    let mut trials = MethodTrials {
        reference,
        control,
        run: |control| Box::new(OwnRun::new(control, pair.clone(), reference.task.start)),
        each: u64::try_from(pair.evaluations()).unwrap_or(u64::MAX),
        best: None,
    };
    let most = most.unwrap_or(f64::INFINITY);
    trials.search(most, OWN_COST.saturating_mul(cheapest)).await;
    trials.best
}

/// Runs of one method.
struct MethodTrials<'a, F, const N: usize> {
    reference: &'a Reference<N>,
    control: ControlLoop<N>,
    /// The run of a loop.
    run: F,
    /// Evaluations of a step.
    each: u64,
    /// The last run that was accurate enough.
    best: Option<Candidate>,
}

impl<F, R: Steppable<N> + 'static, const N: usize> MethodTrials<'_, F, N>
where
    F: Fn(ControlLoop<N>) -> Box<R> + Send,
{
    /// Searches with timesteps up to `longest` \[s\] and at most these evaluations. Returns whether any run is allowed.
    async fn search(&mut self, longest: f64, evaluations: u64) -> bool {
        let (whole, wholes) = (self.reference.whole, self.reference.count);
        let least = count::whole((whole / longest * (1.0 - count::ROUNDING)).ceil());
        let affordable = (evaluations / self.each.max(1)).min(MAX_STEPS) / wholes;
        fewest(least, affordable, u64::MAX, self).await;
        least.max(1) <= affordable
    }
}

impl<F, R: Steppable<N> + 'static, const N: usize> StepTrial for &mut MethodTrials<'_, F, N>
where
    F: Fn(ControlLoop<N>) -> Box<R> + Send,
{
    async fn is_enough(&mut self, steps: u64) -> bool {
        let (reference, method) = (self.reference, self.control.method);
        let timestep = reference.whole / in_f64(steps);
        // The parts of a duration of 1e-323 s are zero.
        if timestep <= 0.0 {
            return false;
        }
        let control = self.control.with_timestep(timestep);
        let run = (self.run)(control);
        let allowed = reference.task.error - reference.uncertainty;
        let error = reference.off_by(run, steps, allowed).await;
        let is_enough = error + reference.uncertainty <= reference.task.error;
        if is_enough {
            self.best = Some(Candidate {
                method,
                timestep,
                evaluations: steps * reference.count * self.each,
                error,
            });
        }
        is_enough
    }
}

/// The largest stable timestep of a loop \[s\], or the one advised for all poses; infinite if there is no limit.
async fn longest_timestep<const N: usize>(control: &ControlLoop<N>) -> f64 {
    let most = if control.is_free() {
        None
    } else if control.given_period() > 0.0 {
        // It divides the period, up to rounding.
        let limit = clock_limits(control).timestep;
        limit.map(|limit| limit * (1.0 + count::ROUNDING))
    } else {
        limits::search_limits(*control).await.advised
    };
    most.unwrap_or(f64::INFINITY)
}

/// The motion from which the errors of runs are measured.
struct Reference<const N: usize> {
    task: Task<N>,
    /// The duration, or the control period \[s\]: a timestep divides it.
    whole: f64,
    /// The number of wholes, which last at least the duration.
    count: u64,
    /// The fewest steps per whole of Runge-Kutta 4.
    steps: u64,
    /// Uncertainty of the motion \[m\].
    uncertainty: f64,
}

impl<const N: usize> Reference<N> {
    /// The motion of a task, refined to the wanted uncertainty, or as far as possible.
    async fn known_to(task: Task<N>) -> Result<Self, PlanError> {
        let (control, duration) = (&task.control, task.duration);
        let (count, whole) = if control.given_period() > 0.0 {
            let periods = duration / control.period.period * (1.0 - count::ROUNDING);
            (count::whole(periods.ceil()).max(1), control.period.period)
        } else {
            (1, duration)
        };
        let spans = (whole / LONGEST_SPAN).max(FEWEST_SPANS / in_f64(count));
        let mut reference = Self {
            task,
            whole,
            count,
            steps: 4 * count::whole(spans.ceil()),
            uncertainty: f64::INFINITY,
        };
        // Two motions that are further apart have nothing in common.
        let reach = control.arm.reach();
        loop {
            let steps = reference.steps;
            let (coarse, _) = reference.motion(steps, 1);
            reference.steps *= 2;
            let apart = reference.off_by(coarse, steps, reach).await;
            if apart.is_finite() {
                reference.uncertainty = apart;
            }
            let [wanted, most] = PART_OF_REFERENCE.map(|part| part * task.error);
            let is_finest = !has_ideal(control) || 2 * reference.steps * count > MAX_STEPS;
            if apart <= if is_finest { most } else { wanted } {
                return Ok(reference);
            }
            if is_finest {
                return Err(PlanError::Unknown(reference.uncertainty));
            }
        }
    }

    /// Largest error of a run of `steps` steps per whole \[m\]. The run ends once the error exceeds `allowed`.
    async fn off_by(&self, run: Box<dyn Steppable<N>>, steps: u64, allowed: f64) -> f64 {
        let (arm, steps_of_run) = (&self.task.control.arm, steps * self.count);
        let reference = self.motion(steps, 0);
        largest_distance(arm, (run, steps_of_run), reference, allowed).await
    }

    /// A motion from its start, and the number of its steps per step of a run with `steps` steps per whole. Motions known
    /// to rounding differ by it if they have different indices.
    fn motion(&self, steps: u64, index: usize) -> (Box<dyn Steppable<N>>, u64) {
        let Task { control, start, .. } = self.task;
        if has_ideal(&control) {
            let each = self.steps.div_ceil(steps);
            let timestep = self.whole / in_f64(steps * each);
            let control = control.with_method(Method::Rk4).with_timestep(timestep);
            let law = ContinuousLoop::new(control, start, [0.0; N]);
            return (Box::new(law), each);
        }
        let control = control.with_timestep(self.whole / in_f64(steps));
        (Box::new(rollout::Reference::new(&control, start, index)), 1)
    }
}

/// Whether the law of the reference acts at every instant.
fn has_ideal<const N: usize>(control: &ControlLoop<N>) -> bool {
    !control.is_free() && control.given_period() == 0.0
}

/// The message for references that differ by `uncertainty` \[m\].
fn known(uncertainty: f64) -> String {
    if uncertainty.is_finite() {
        format!("the motion itself is known only to {uncertainty:.1e} m over this duration")
    } else {
        "the motion itself cannot be computed this accurately over this duration".to_owned()
    }
}

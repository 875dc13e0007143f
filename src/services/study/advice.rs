//! `/study/gains` and `/study/plan`: simulated suggestions, which change nothing.
//!
//! **Invariant:** every returned answer was simulated, and the live arm does not change.

use bytes::Bytes;

use super::{Beside, Changed, Computed, Present, Refused, StudyWork};
use crate::math::arm::ArmError;
use crate::math::pid::Gains;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::Address;
use crate::study::control_loop::no_control;
use crate::study::gains::{GainsError, GainsRequirements, SuggestedGains, search_gains};
use crate::study::planner::{PlanError, Planned, Task, plan_beside};

// ---- question -------------------------------------------------------------------------------------------------------

request! {
    whole
    /// Searches gains with which every move settles in time, with a stability margin.
    #[derive(Debug, Clone, PartialEq, Default)]
    pub struct SuggestGains<N> -> Result<Suggested<N>, Refused<GainsError>>, |fields| {
        /// Time in which every move must settle \[s\], greater than 0.
        settling_time: Option<f64> = fields.number("settling_time", Bound::Positive),
        /// The required ratio of the smallest timestep limit over all poses to the timestep, at least 1.
        margin: Option<f64> = read_margin(&mut fields),
        /// Changes of the present loop.
        changed: Changed<N> = Changed::read(&mut fields),
    }

    fn write(answer: Self::Answer, to: &Address) -> Bytes {
        to.outcome(answer.as_ref().map(|Suggested { found, timestep }| {
            object! {
                kp: found.gains.kp.as_slice(),
                ki: found.gains.ki.as_slice(),
                kd: found.gains.kd.as_slice(),
                timestep_limit: found.limit,
                certified: found.certified,
                margin: found.limit.map(|limit| limit / timestep),
                settled_after: found.settled_after,
            }
        }))
    }
}

fn read_margin(fields: &mut Fields<'_>) -> Option<f64> {
    let margin = fields.number("margin", Bound::Finite)?;
    if margin < 1.0 {
        fields.refuse("margin", &format_args!("must be at least 1, got {margin}"));
    }
    Some(margin)
}

/// Simulated gains.
#[derive(Debug, Clone, Copy)]
pub struct Suggested<const N: usize> {
    /// The gains and their results.
    pub found: SuggestedGains<N>,
    /// The timestep for these gains \[s\].
    pub timestep: f64,
}

request! {
    whole
    /// Searches the cheapest method and timestep that keep a run within an error.
    #[derive(Debug, Clone, PartialEq)]
    pub struct PlanRun<N> -> Result<PlannedRun, Refused<PlanError>>, |fields| {
        /// The allowed error of the end effector \[m\], greater than 0. The catalog requires it: without it the request
        /// is rejected.
        error: f64 = fields.number("error", Bound::Positive).unwrap_or(f64::NAN),
        /// The duration of the run \[s\], greater than 0.
        duration: Option<f64> = fields.number("duration", Bound::Positive),
        /// Whether the present gains apply if the request has none.
        controller: bool = fields.boolean("controller").unwrap_or(false),
        /// Changes of the present loop and state. Without a control period it is planned.
        changed: Changed<N> = Changed::read(&mut fields),
    }

    fn write(answer: Self::Answer, to: &Address) -> Bytes {
        to.outcome(answer.map(|run| {
            let best = run.planned.best;
            let all = || run.planned.candidates.iter().rev();
            object! {
                integrator: best.method.name(),
                timestep: best.timestep,
                control_period: run.control_period,
                evaluations_per_second: f64::from(best.method.evaluations()) / best.timestep,
                error: best.error,
                error_uncertainty: run.planned.uncertainty,
                methods: all().map(|one| one.method.name()).collect::<Vec<_>>(),
                timesteps: all().map(|one| one.timestep).collect::<Vec<_>>(),
                evaluations: all().map(|one| one.evaluations).collect::<Vec<_>>(),
                errors: all().map(|one| one.error).collect::<Vec<_>>(),
                own: run.planned.own.map(|own| {
                    object! { timestep: own.timestep, evaluations: own.evaluations, error: own.error }
                }),
            }
        }))
    }
}

/// A simulated plan.
#[derive(Debug, Clone)]
pub struct PlannedRun {
    /// The cheapest run, and all simulated runs within the error.
    pub planned: Planned,
    /// The control period \[s\], if a controller holds the arm: the timestep, unless another was requested.
    pub control_period: Option<f64>,
}

// ---- work -----------------------------------------------------------------------------------------------------------

/// Default settling time \[s\]: the default gains meet it on the default arms.
const DEFAULT_SETTLING: f64 = 4.0;
/// Default margin. The timestep is then at most the advice of `/study/stability`.
const DEFAULT_MARGIN: f64 = 1.25;
/// Default duration of a plan \[s\].
const DEFAULT_DURATION: f64 = 10.0;
/// Default duration of a plan under control \[s\]: a move has settled by then.
const DEFAULT_MOVE: f64 = 4.0;

// ---- gains ----------------------------------------------------------------------------------------------------------

impl<const N: usize> Computed<N> for SuggestGains<N> {
    type Work = StudyWork<Self::Answer>;

    fn work(self, present: Present<N>) -> Self::Work {
        StudyWork::new::<N>(async move {
            let control = self.changed.applied_to(&present.with_period(0.0))?;
            let requirements = GainsRequirements {
                settling_time: self.settling_time.unwrap_or(DEFAULT_SETTLING),
                margin: self.margin.unwrap_or(DEFAULT_MARGIN),
            };
            let found = search_gains(control, requirements).await;
            let found = found.map_err(Refused::Study)?;
            let timestep = control.timestep;
            Ok(Suggested { found, timestep })
        })
    }
}

// ---- plan -----------------------------------------------------------------------------------------------------------

impl<const N: usize> Computed<N> for Beside<PlanRun<N>> {
    type Work = StudyWork<Self::Answer>;

    fn work(self, present: Present<N>) -> Self::Work {
        StudyWork::new::<N>(async move {
            let task = task(&self.ask, &present)?;
            let planned = plan_beside(task, self.own).await.map_err(Refused::Study)?;
            let (period, timestep) = (task.control.period.period, planned.best.timestep);
            let period = if period > 0.0 { period } else { timestep };
            Ok(PlannedRun {
                planned,
                control_period: (!task.control.is_free()).then_some(period),
            })
        })
    }
}

/// The run to be planned, with the present settings and state for missing fields.
fn task<const N: usize>(ask: &PlanRun<N>, present: &Present<N>) -> Result<Task<N>, ArmError> {
    // With `controller` the present gains apply. Otherwise the arm is free, and a missing member is that of a new arm, as
    // in a rollout.
    let gains = present.control.gains;
    let (missing, base) = match ask.controller {
        true => (gains, gains),
        false => (no_control(), Gains::default()),
    };
    let present_loop = present.with_period(0.0);
    let control = ask.changed.with_gains(&present_loop, missing, &base)?;
    let usual = if control.is_free() {
        DEFAULT_DURATION
    } else {
        DEFAULT_MOVE
    };
    Ok(Task {
        control,
        start: ask.changed.state(&present.state),
        duration: ask.duration.unwrap_or(usual),
        error: ask.error,
    })
}

//! `/study/gains` and `/study/plan`: simulated suggestions, which change nothing.
//!
//! **Invariant:** every returned answer was simulated, and the live arm does not change.

use bytes::Bytes;

use super::{
    Beside, Computed, Present, Refused, RobotSettings, StudyWork, arm_of, state_of, with_period,
};
use crate::math::arm::ArmError;
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};
use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::arm::{SetGains, SetParams};
use crate::services::{Address, Ask};
use crate::study::control_loop::{ControlLoop, no_control};
use crate::study::gains::{GainsError, GainsRequirements, SuggestedGains, search_gains};
use crate::study::planner::{PlanError, Planned, Task, plan, plan_beside};

// ---- question -------------------------------------------------------------------------------------------------------

/// Searches gains with which every move settles in time, with a stability margin.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SuggestGains<const N: usize> {
    /// Time in which every move must settle \[s\], greater than 0.
    pub settling_time: Option<f64>,
    /// The required ratio of the smallest timestep limit over all poses to the timestep, at least 1.
    pub margin: Option<f64>,
    /// Length of a step \[s\], greater than 0.
    pub timestep: Option<f64>,
    /// The method that takes the steps.
    pub method: Option<Method>,
    /// Changed parameters of the arm.
    pub params: Option<SetParams<N>>,
    /// Friction, limits, sensors and delay.
    pub robot: RobotSettings<N>,
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
        /// Initial positions \[rad\].
        q: Option<[f64; N]> = super::joints(&mut fields, ["q", "q0"]),
        /// Initial velocities \[rad/s\].
        qd: Option<[f64; N]> = super::joints(&mut fields, ["qd", "qdot0"]),
        /// Changed parameters of the arm.
        params: Option<SetParams<N>> = fields.object("params", SetParams::from_fields),
        /// Changed gains.
        gains: Option<SetGains<N>> = fields.object("gains", SetGains::from_fields),
        /// The setpoint \[rad\], at rest.
        setpoint: Option<[f64; N]> = fields.array("setpoint", Bound::Finite),
        /// The control period \[s\]; `None` or 0 to plan it.
        control_period: Option<f64> = fields.number("control_period", Bound::NonNegative),
        /// Friction, limits, sensors and delay.
        robot: RobotSettings<N> = RobotSettings::read(&mut fields),
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

// ---- reading and writing --------------------------------------------------------------------------------------------

impl<const N: usize> Ask for SuggestGains<N> {
    type Answer = Result<Suggested<N>, Refused<GainsError>>;

    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let ask = Self {
            settling_time: fields.number("settling_time", Bound::Positive),
            margin: fields.number("margin", Bound::Finite),
            timestep: fields.number("timestep", Bound::Positive),
            method: fields.choice("integrator", &Method::ALL, Method::name),
            params: fields.object("params", SetParams::from_fields),
            robot: RobotSettings::read(&mut fields),
        };
        if let Some(margin) = ask.margin.filter(|margin| *margin < 1.0) {
            fields.refuse("margin", &format_args!("must be at least 1, got {margin}"));
        }
        fields.accept(ask)
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
            let (control, requirements) = demands(&self, &present.control)?;
            let found = search_gains(control, requirements).await;
            let found = found.map_err(Refused::Study)?;
            let timestep = control.timestep;
            Ok(Suggested { found, timestep })
        })
    }
}

/// The loop and the demands on its gains, with the present settings for missing fields.
fn demands<const N: usize>(
    ask: &SuggestGains<N>,
    present: &ControlLoop<N>,
) -> Result<(ControlLoop<N>, GainsRequirements), ArmError> {
    let arm = arm_of(ask.params.as_ref(), present.arm)?;
    let control = ask.robot.applied_to(ControlLoop {
        arm,
        method: ask.method.unwrap_or(present.method),
        timestep: ask.timestep.unwrap_or(present.timestep),
        period: with_period(present.period, Some(0.0)),
        ..*present
    })?;
    let requirements = GainsRequirements {
        settling_time: ask.settling_time.unwrap_or(DEFAULT_SETTLING),
        margin: ask.margin.unwrap_or(DEFAULT_MARGIN),
    };
    Ok((control, requirements))
}

// ---- plan -----------------------------------------------------------------------------------------------------------

impl<const N: usize> Computed<N> for PlanRun<N> {
    type Work = StudyWork<Self::Answer>;

    fn work(self, present: Present<N>) -> Self::Work {
        StudyWork::new::<N>(async move {
            let task = task(&self, &present)?;
            Ok(planned_run(
                &task,
                plan(task).await.map_err(Refused::Study)?,
            ))
        })
    }
}

impl<const N: usize> Computed<N> for Beside<PlanRun<N>> {
    type Work = StudyWork<Self::Answer>;

    fn work(self, present: Present<N>) -> Self::Work {
        StudyWork::new::<N>(async move {
            let task = task(&self.ask, &present)?;
            let planned = plan_beside(task, self.own).await.map_err(Refused::Study)?;
            Ok(planned_run(&task, planned))
        })
    }
}

fn planned_run<const N: usize>(task: &Task<N>, planned: Planned) -> PlannedRun {
    let period = task.control.period.period;
    let timestep = planned.best.timestep;
    let period = if period > 0.0 { period } else { timestep };
    PlannedRun {
        planned,
        control_period: (!task.control.is_free()).then_some(period),
    }
}

/// The run to be planned, with the present settings and state for missing fields.
fn task<const N: usize>(ask: &PlanRun<N>, present: &Present<N>) -> Result<Task<N>, ArmError> {
    let Present { control, state } = present;
    let arm = arm_of(ask.params.as_ref(), control.arm)?;
    // With `controller` the present gains apply. Otherwise the arm is free, and a missing member is that of a new arm, as
    // in a rollout.
    let (missing, present_or_new) = match ask.controller {
        true => (control.gains, control.gains),
        false => (no_control(), Gains::default()),
    };
    let gains = ask.gains.as_ref();
    let control = ask.robot.applied_to(ControlLoop {
        arm,
        gains: gains.map_or(missing, |gains| gains.applied_to(&present_or_new)),
        setpoint: ask.setpoint.map_or(control.setpoint, Setpoint::at),
        period: with_period(control.period, Some(ask.control_period.unwrap_or(0.0))),
        ..*control
    })?;
    let usual = if control.is_free() {
        DEFAULT_DURATION
    } else {
        DEFAULT_MOVE
    };
    Ok(Task {
        control,
        start: state_of(ask.q, ask.qd, state),
        duration: ask.duration.unwrap_or(usual),
        error: ask.error,
    })
}

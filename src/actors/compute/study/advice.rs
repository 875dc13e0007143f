//! `/study/gains` and `/study/plan`: advice that has been tried, and changes nothing.
//!
//! **Invariant:** every answer has been run, and the arm hears of none.

use super::{NotPlanned, NotSuggested, PlanRun, PlannedRun, SuggestGains, Suggested};
use crate::actors::arm::sim::Present;
use crate::actors::compute::answering::Work;
use crate::math::arm::{ArmError, State};
use crate::math::pid::Setpoint;
use crate::study::control_loop::ControlLoop;
use crate::study::gains::{GainsSearch, Wish};
use crate::study::linear::no_control;
use crate::study::planner::{Planning, Task};

/// Time to settle in unless it is said \[s\]: what the default gains promise of the default arms.
const DEFAULT_SETTLING: f64 = 4.0;
/// Margin unless it is said: the timestep is then no longer than `/study/stability` advises.
const DEFAULT_MARGIN: f64 = 1.25;
/// How long a plan is unless it is said \[s\].
const DEFAULT_DURATION: f64 = 10.0;
/// The same under control: a move has settled by then.
const DEFAULT_MOVE: f64 = 4.0;

// ---- gains ----------------------------------------------------------------------------------------------------------

/// A search for gains on its way.
pub(super) enum GainsWork<const N: usize> {
    Asked(Box<(SuggestGains<N>, Present<N>)>),
    /// The timestep that the gains are for goes with it.
    Searching(Box<GainsSearch<N>>, f64),
}

impl<const N: usize> GainsWork<N> {
    pub(super) fn new(ask: SuggestGains<N>, present: Present<N>) -> Self {
        Self::Asked(Box::new((ask, present)))
    }
}

impl<const N: usize> Work<Result<Suggested<N>, NotSuggested>> for GainsWork<N> {
    fn most_bytes(&self) -> usize {
        GainsSearch::<N>::MOST_BYTES
    }

    fn advance(&mut self) -> Option<Result<Suggested<N>, NotSuggested>> {
        match self {
            Self::Asked(asked) => match begin_search(&asked.0, &asked.1.control) {
                Ok((search, timestep)) => {
                    *self = Self::Searching(Box::new(search), timestep);
                    None
                }
                Err(why) => Some(Err(why)),
            },
            Self::Searching(search, timestep) => {
                let timestep = *timestep;
                let found = search.advance()?;
                Some(match found {
                    Ok(found) => Ok(Suggested { found, timestep }),
                    Err(why) => Err(why.into()),
                })
            }
        }
    }
}

/// Begins the search, with the present settings where the question leaves something out.
fn begin_search<const N: usize>(
    ask: &SuggestGains<N>,
    present: &ControlLoop<N>,
) -> Result<(GainsSearch<N>, f64), NotSuggested> {
    let arm = match &ask.params {
        None => present.arm,
        Some(params) => params.applied_to(&present.arm)?,
    };
    let control = ControlLoop {
        arm,
        method: ask.method.unwrap_or(present.method),
        timestep: ask.timestep.unwrap_or(present.timestep),
        ..*present
    };
    let wish = Wish {
        settling_time: ask.settling_time.unwrap_or(DEFAULT_SETTLING),
        margin: ask.margin.unwrap_or(DEFAULT_MARGIN),
    };
    Ok((GainsSearch::new(&control, wish)?, control.timestep))
}

// ---- plan -----------------------------------------------------------------------------------------------------------

/// A plan on its way.
pub(super) enum PlanWork<const N: usize> {
    Asked(Box<(PlanRun<N>, Present<N>)>),
    /// Whether the arm is controlled goes with it.
    Planning(Box<Planning<N>>, bool),
}

impl<const N: usize> PlanWork<N> {
    pub(super) fn new(ask: PlanRun<N>, present: Present<N>) -> Self {
        Self::Asked(Box::new((ask, present)))
    }
}

impl<const N: usize> Work<Result<PlannedRun, NotPlanned>> for PlanWork<N> {
    fn most_bytes(&self) -> usize {
        Planning::<N>::MOST_BYTES
    }

    fn advance(&mut self) -> Option<Result<PlannedRun, NotPlanned>> {
        match self {
            Self::Asked(asked) => match begin_plan(&asked.0, &asked.1) {
                Ok((planning, controlled)) => {
                    *self = Self::Planning(Box::new(planning), controlled);
                    None
                }
                Err(why) => Some(Err(why)),
            },
            Self::Planning(planning, controlled) => {
                let controlled = *controlled;
                let planned = planning.advance()?;
                Some(planned.map_err(NotPlanned::from).and_then(|planned| {
                    let best = *planned.best().ok_or(NotPlanned::Nothing)?;
                    Ok(PlannedRun {
                        best,
                        planned,
                        controlled,
                    })
                }))
            }
        }
    }
}

fn begin_plan<const N: usize>(
    ask: &PlanRun<N>,
    present: &Present<N>,
) -> Result<(Planning<N>, bool), NotPlanned> {
    let task = task(ask, present)?;
    Ok((Planning::new(task)?, !task.control.is_free()))
}

/// The run that is to be planned, with the present settings and state where the question leaves something out.
fn task<const N: usize>(ask: &PlanRun<N>, present: &Present<N>) -> Result<Task<N>, ArmError> {
    let Present { control, state } = present;
    let arm = match &ask.params {
        None => control.arm,
        Some(params) => params.applied_to(&control.arm)?,
    };
    // A servo has the gains that are set; else an arm is left to itself, as in a rollout.
    let missing = if ask.servo {
        control.gains
    } else {
        no_control()
    };
    let gains = ask.gains.as_ref();
    let control = ControlLoop {
        arm,
        gains: gains.map_or(missing, |gains| gains.applied_to(&missing)),
        setpoint: ask.setpoint.map_or(control.setpoint, Setpoint::at),
        ..*control
    };
    let usual = if control.is_free() {
        DEFAULT_DURATION
    } else {
        DEFAULT_MOVE
    };
    Ok(Task {
        control,
        start: State {
            position: ask.q0.unwrap_or(state.position),
            velocity: ask.qdot0.unwrap_or(state.velocity),
        },
        duration: ask.duration.unwrap_or(usual),
        error: ask.error,
    })
}

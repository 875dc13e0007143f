//! `/study/rollout`: an offline run of the arm, sample by sample, with its cost and its error.
//!
//! The run is made once by itself, against a worker's clock. If a reference is asked for, it is made again beside the
//! reference, which costs far more than the run: so `took` is that of the run alone, whatever else was asked.
//!
//! **Invariant:** the samples are the live arm's own steps, and a run in slices gives the same bits as one at once.

use std::time::Duration;

use super::{NotRun, Ran, RunOffline};
use crate::actors::arm::sim::Present;
use crate::actors::compute::answering::{NUMBER_BYTES, Work};
use crate::actors::resources::work_clock;
use crate::math::arm::State;
use crate::math::pid::Setpoint;
use crate::study::control_loop::ControlLoop;
use crate::study::linear::no_control;
use crate::study::rollout::{Plan, Rollout};

/// How long a run is unless it is said \[s\].
const DEFAULT_DURATION: f64 = 10.0;
/// Samples of a run unless it is said, if there are as many steps: enough for a smooth curve.
const DEFAULT_SAMPLES: u64 = 1001;
/// Evaluations of the dynamics between two looks at the clock: some hundred microseconds.
const EVALUATIONS_PER_LOOK: u64 = 2000;
/// Numbers in a sample of the answer that are not one per joint, and as many again for brackets and commas.
const COLUMNS: usize = 5;

/// A run on its way.
pub(super) enum RolloutWork<const N: usize> {
    Asked(Box<(RunOffline<N>, Present<N>)>),
    Running(Box<Timed<N>>),
    Comparing(Box<Ran<N>>),
    Done,
}

/// A run by itself, with the time that it took so far.
pub(super) struct Timed<const N: usize> {
    ran: Ran<N>,
    /// The plan to run again beside a reference, if that is wanted.
    again: Option<Plan<N>>,
}

impl<const N: usize> RolloutWork<N> {
    pub(super) fn new(ask: RunOffline<N>, present: Present<N>) -> Self {
        Self::Asked(Box::new((ask, present)))
    }
}

impl<const N: usize> Work<Result<Box<Ran<N>>, NotRun>> for RolloutWork<N> {
    fn most_bytes(&self) -> usize {
        let Self::Asked(asked) = self else {
            return 0;
        };
        let samples = asked.0.samples.unwrap_or(DEFAULT_SAMPLES);
        usize::try_from(samples)
            .unwrap_or(usize::MAX)
            .saturating_mul((3 * N + COLUMNS) * NUMBER_BYTES)
            .saturating_add(size_of::<Rollout<N>>())
    }

    fn advance(&mut self) -> Option<Result<Box<Ran<N>>, NotRun>> {
        *self = match std::mem::replace(self, Self::Done) {
            Self::Asked(asked) => match begin(&asked.0, &asked.1) {
                Ok(timed) => Self::Running(Box::new(timed)),
                Err(why) => return Some(Err(why)),
            },
            Self::Running(mut timed) => {
                let began = work_clock::now();
                let steps = timed.ran.run.advance(EVALUATIONS_PER_LOOK);
                timed.ran.took += work_clock::now().saturating_duration_since(began);
                let Timed { ran, again } = *timed;
                if steps > 0 {
                    Self::Running(Box::new(Timed { ran, again }))
                } else if let Some(Ok(run)) = again.map(Rollout::new) {
                    Self::Comparing(Box::new(Ran { run, ..ran }))
                } else {
                    return Some(Ok(Box::new(ran)));
                }
            }
            Self::Comparing(mut ran) => {
                if ran.run.advance(EVALUATIONS_PER_LOOK) == 0 {
                    return Some(Ok(ran));
                }
                Self::Comparing(ran)
            }
            Self::Done => {
                debug_assert!(false, "the run has been given away");
                return None;
            }
        };
        None
    }
}

/// Makes the run, which checks what concerns several fields.
fn begin<const N: usize>(ask: &RunOffline<N>, present: &Present<N>) -> Result<Timed<N>, NotRun> {
    let plan = plan(ask, present)?;
    let alone = Plan {
        reference: false,
        ..plan
    };
    Ok(Timed {
        ran: Ran {
            run: Rollout::new(alone)?,
            took: Duration::ZERO,
        },
        again: plan.reference.then_some(plan),
    })
}

/// The plan of the run, with the present settings where the question leaves something out.
fn plan<const N: usize>(ask: &RunOffline<N>, present: &Present<N>) -> Result<Plan<N>, NotRun> {
    let control = &present.control;
    let arm = match &ask.params {
        None => control.arm,
        Some(params) => params.applied_to(&control.arm)?,
    };
    let gains = ask.gains.as_ref();
    let setpoint = ask.setpoint.map(Setpoint::at);
    Ok(Plan {
        control: ControlLoop {
            arm,
            // A part of the law that is left out is switched off, as the whole law is where all are.
            gains: gains.map_or(no_control(), |gains| gains.applied_to(&no_control())),
            setpoint: setpoint.unwrap_or(control.setpoint),
            method: ask.method.unwrap_or(control.method),
            timestep: ask.timestep.unwrap_or(control.timestep),
        },
        start: State {
            position: ask.q0.unwrap_or([0.0; N]),
            velocity: ask.qdot0.unwrap_or([0.0; N]),
        },
        duration: ask.duration.unwrap_or(DEFAULT_DURATION),
        samples: ask.samples.unwrap_or(DEFAULT_SAMPLES),
        reference: ask.reference.unwrap_or(false),
    })
}

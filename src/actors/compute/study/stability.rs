//! `/study/stability`: the largest stable timesteps of a control loop.
//!
//! The gains are those that are set, whether the controller is on or off: the question is what timestep it would bear.
//! Gains that are all zero ask about the arm left to itself. The motion is the one that is ahead of the arm as it is
//! now.
//!
//! **Invariant:** a limit is there only where something limits, and 0 where no timestep is stable; never made up.

use super::{PredictStability, Predicted};
use crate::actors::arm::sim::Present;
use crate::actors::compute::answering::Work;
use crate::math::arm::ArmError;
use crate::math::pid::Setpoint;
use crate::study::control_loop::ControlLoop;
use crate::study::motion::Motion;
use crate::study::stability::LimitSearch;

/// A prediction on its way.
pub(super) enum StabilityWork<const N: usize> {
    Asked(Box<(PredictStability<N>, Present<N>)>),
    Searching(Box<LimitSearch<N>>, Motion),
}

impl<const N: usize> StabilityWork<N> {
    pub(super) fn new(ask: PredictStability<N>, present: Present<N>) -> Self {
        Self::Asked(Box::new((ask, present)))
    }
}

impl<const N: usize> Work<Result<Box<Predicted<N>>, ArmError>> for StabilityWork<N> {
    fn most_bytes(&self) -> usize {
        LimitSearch::<N>::MOST_BYTES
    }

    fn advance(&mut self) -> Option<Result<Box<Predicted<N>>, ArmError>> {
        match self {
            Self::Asked(asked) => {
                let (ask, present) = &**asked;
                match control_loop(ask, &present.control) {
                    Ok(control) => {
                        let search = LimitSearch::new(&control);
                        let motion = Motion::ahead(&control, &present.state);
                        *self = Self::Searching(Box::new(search), motion);
                        None
                    }
                    Err(why) => Some(Err(why)),
                }
            }
            Self::Searching(search, motion) => {
                let limits = search.advance()?;
                let motion = *motion;
                Some(Ok(Box::new(Predicted { limits, motion })))
            }
        }
    }
}

/// The loop that is asked about.
fn control_loop<const N: usize>(
    ask: &PredictStability<N>,
    present: &ControlLoop<N>,
) -> Result<ControlLoop<N>, ArmError> {
    let arm = match &ask.params {
        None => present.arm,
        Some(params) => params.applied_to(&present.arm)?,
    };
    let gains = ask.gains.as_ref();
    let setpoint = ask.setpoint.map(Setpoint::at);
    Ok(ControlLoop {
        arm,
        gains: gains.map_or(present.gains, |gains| gains.applied_to(&present.gains)),
        setpoint: setpoint.unwrap_or(present.setpoint),
        method: ask.method.unwrap_or(present.method),
        timestep: present.timestep,
    })
}

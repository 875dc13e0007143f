//! `/study/stability`: the largest stable timesteps of a control loop.
//!
//! The gains are those that are set, whether the controller is on or off: the question is what timestep it would bear.
//! Gains that are all zero ask about the arm left to itself.
//!
//! **Invariant:** a limit is `null` where nothing limits, and 0 where no timestep is stable; never made up.

use serde::Serialize;

use super::{Work, read_arm, read_gains, read_joints};
use crate::actors::arm_sim::{ControlLoop, Present};
use crate::actors::node::Reply;
use crate::math::integrator::Method;
use crate::math::pid::Setpoint;
use crate::protocol::catalog::Service;
use crate::protocol::fields::Fields;
use crate::protocol::op::Arguments;
use crate::study::stability::{LimitSearch, Limits};

/// A call of the service.
pub(super) enum StabilityWork<const N: usize> {
    Unread(Arguments, Box<Present<N>>),
    Searching(Box<LimitSearch<N>>),
}

#[derive(Serialize)]
struct Values {
    timestep_limit_held: Option<f64>,
    timestep_limit_continuous: Option<f64>,
    minimum_over_poses_held: Option<f64>,
    minimum_over_poses_continuous: Option<f64>,
    advised_timestep: Option<f64>,
}

impl From<Limits> for Values {
    fn from(limits: Limits) -> Self {
        Self {
            timestep_limit_held: limits.held,
            timestep_limit_continuous: limits.continuous,
            minimum_over_poses_held: limits.minimum_held,
            minimum_over_poses_continuous: limits.minimum_continuous,
            advised_timestep: limits.advised,
        }
    }
}

impl<const N: usize> StabilityWork<N> {
    pub(super) fn new(arguments: Arguments, present: Present<N>) -> Self {
        Self::Unread(arguments, Box::new(present))
    }
}

impl<const N: usize> Work for StabilityWork<N> {
    fn advance(&mut self, reply: &mut Reply) -> bool {
        match self {
            Self::Unread(arguments, present) => match read(arguments, present) {
                Ok(control) => {
                    let ControlLoop {
                        arm,
                        gains,
                        setpoint,
                        method,
                    } = control;
                    let search = LimitSearch::new(&arm, &gains, &setpoint, method);
                    *self = Self::Searching(Box::new(search));
                    false
                }
                Err(why) => {
                    reply.refuse(&why);
                    true
                }
            },
            Self::Searching(search) => search.advance().is_some_and(|limits| {
                reply.succeed(&Values::from(limits));
                true
            }),
        }
    }
}

/// Reads the request; all or nothing, and every field that is wrong is named.
fn read<const N: usize>(
    arguments: &Arguments,
    present: &Present<N>,
) -> Result<ControlLoop<N>, String> {
    let present = &present.control;
    let mut fields = Fields::read(arguments, Service::Stability).map_err(|why| why.to_string())?;
    let method = fields.choice("integrator", &Method::ALL, Method::name);
    let gains = read_gains(&mut fields, &present.gains);
    let arm = read_arm(&mut fields, &present.arm);
    let setpoint = read_joints(&mut fields, "setpoint").map(|position| Setpoint {
        position,
        velocity: [0.0; N],
    });
    match arm {
        Some(arm) if fields.accepted() => Ok(ControlLoop {
            arm,
            gains: gains.unwrap_or(present.gains),
            setpoint: setpoint.unwrap_or(present.setpoint),
            method: method.unwrap_or(present.method),
        }),
        _ => Err(fields.status()),
    }
}

//! `/pid_controller/set_period`: how often the control law runs.
//!
//! **Invariant:** setting what is in force already leaves the arm exactly as it was, down to the step of its period.

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;

use super::field_by_field::{Echo, FieldByField};
use crate::actors::arm::sim::node::ArmSim;
use crate::actors::node::{Ask, Call};
use crate::actors::wire::{Address, Answered, Nodes};
use crate::math::simulation::{ArmInput, ControlPeriod};
use crate::protocol::catalog::Service;
use crate::protocol::op::fields::{Bound, Fields, Rejections};

/// Enters the route of this file into the registry's table.
pub(super) fn attach<const N: usize>(arm: &Addr<ArmSim<N>>, nodes: &mut Nodes) {
    nodes.serve::<SetPeriod>(Service::SetPeriod, arm.clone());
}

/// Sets the time between two runs of the control law.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SetPeriod {
    /// That time \[s\], not negative; 0 for every step.
    pub period: Option<f64>,
    /// Whether an effort is applied one period after the state that it is about.
    pub delay: Option<bool>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

/// The control period in force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PeriodInForce {
    /// Time as asked for, and the delay.
    pub period: ControlPeriod,
    /// A whole number of timesteps \[s\].
    pub effective: f64,
}

impl Ask for SetPeriod {
    type Answer = Echo<PeriodInForce>;
}

impl<const N: usize> Handler<Call<SetPeriod>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, Call { ask, reply }: Call<SetPeriod>, ctx: &mut Context<Self>) {
        self.attend_call(ctx);
        let present = self.simulation.control_period();
        let period = ControlPeriod {
            period: ask.period.unwrap_or(present.period),
            delay: ask.delay.unwrap_or(present.delay),
        };
        if period != present {
            self.change(ArmInput::Period(period));
        }
        reply.conclude(Echo {
            values: PeriodInForce {
                period,
                effective: period.effective(self.simulation.timestep()),
            },
            rejected: ask.rejected,
        });
    }
}

impl FieldByField for SetPeriod {
    fn of(fields: &mut Fields<'_>) -> Self {
        Self {
            period: fields.number("period", Bound::NonNegative),
            delay: fields.boolean("delay"),
            rejected: Rejections::default(),
        }
    }

    fn rejected(&mut self) -> &mut Rejections {
        &mut self.rejected
    }
}

impl Answered for SetPeriod {
    fn write(Echo { values, rejected }: Echo<PeriodInForce>, to: &Address) -> Bytes {
        #[derive(Serialize)]
        struct Values {
            period: f64,
            effective_period: f64,
            delay: bool,
        }
        let ControlPeriod { period, delay } = values.period;
        let values = Values {
            period,
            effective_period: values.effective,
            delay,
        };
        to.response(&values, &rejected.status())
    }
}

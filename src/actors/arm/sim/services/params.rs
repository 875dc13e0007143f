//! `/arm_sim/set_params`: gravity, masses and lengths.
//!
//! **Invariant:** the arm is replaced as a whole, or not at all.

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;

use super::field_by_field::{Echo, FieldByField};
use crate::actors::arm::sim::node::ArmSim;
use crate::actors::node::{Ask, Call};
use crate::actors::wire::{Address, Answered, Nodes};
use crate::math::arm::{Arm, ArmError};
use crate::math::simulation::ArmInput;
use crate::protocol::catalog::Service;
use crate::protocol::op::fields::{Bound, Fields, Rejections};

/// Enters the route of this file into the registry's table.
pub(super) fn attach<const N: usize>(arm: &Addr<ArmSim<N>>, nodes: &mut Nodes) {
    nodes.serve::<SetParams<N>>(Service::SetParams, arm.clone());
}

/// Sets the arm's parameters.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SetParams<const N: usize> {
    /// \[m/s²\], at least 0.
    pub gravity: Option<f64>,
    /// \[kg\], greater than 0.
    pub masses: Option<[f64; N]>,
    /// \[m\], greater than 0.
    pub lengths: Option<[f64; N]>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

impl<const N: usize> SetParams<N> {
    /// The arm that `arm` becomes.
    ///
    /// # Errors
    /// If there can't be such an arm.
    pub fn applied_to(&self, arm: &Arm<N>) -> Result<Arm<N>, ArmError> {
        Arm::new(
            self.lengths.unwrap_or(*arm.lengths()),
            self.masses.unwrap_or(*arm.masses()),
            self.gravity.unwrap_or(arm.gravity()),
        )
    }
}

impl<const N: usize> Ask for SetParams<N> {
    type Answer = Echo<Arm<N>>;
}

impl<const N: usize> Handler<Call<SetParams<N>>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, call: Call<SetParams<N>>, ctx: &mut Context<Self>) {
        self.attend_call(ctx);
        call.reply.conclude(self.set_params(call.ask));
    }
}

impl<const N: usize> ArmSim<N> {
    fn set_params(&mut self, ask: SetParams<N>) -> Echo<Arm<N>> {
        let arm = self.simulation.arm();
        let changed = ask.applied_to(arm);
        let mut rejected = ask.rejected;
        match changed {
            Ok(changed) if changed != *arm => {
                self.change(ArmInput::Arm(changed));
                self.restart_energy_drift();
                self.publish_description();
            }
            Ok(_) => {}
            // The fields were checked with the same bounds; should the two ever differ, the arm's word counts.
            Err(why) => rejected.refuse("params", &why),
        }
        let values = *self.simulation.arm();
        Echo { values, rejected }
    }
}

impl<const N: usize> FieldByField for SetParams<N> {
    fn of(fields: &mut Fields<'_>) -> Self {
        Self {
            gravity: fields.number("gravity", Bound::NonNegative),
            masses: fields.array("masses", Bound::Positive),
            lengths: fields.array("lengths", Bound::Positive),
            rejected: Rejections::default(),
        }
    }

    fn rejected(&mut self) -> &mut Rejections {
        &mut self.rejected
    }
}

impl<const N: usize> Answered for SetParams<N> {
    fn write(Echo { values, rejected }: Echo<Arm<N>>, to: &Address) -> Bytes {
        #[derive(Serialize)]
        struct Values<'a> {
            gravity: f64,
            masses: &'a [f64],
            lengths: &'a [f64],
        }
        let values = Values {
            gravity: values.gravity(),
            masses: values.masses(),
            lengths: values.lengths(),
        };
        to.response(&values, &rejected.status())
    }
}

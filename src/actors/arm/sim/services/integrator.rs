//! `/arm_sim/set_integrator`: method and timestep of the live arm.
//!
//! **Invariant:** setting what is in force already leaves the arm exactly as it was, down to the fraction of a step.

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;

use super::field_by_field::{Echo, FieldByField};
use crate::actors::arm::sim::node::ArmSim;
use crate::actors::node::{Ask, Call};
use crate::actors::wire::{Address, Answered, Nodes};
use crate::math::integrator::Method;
use crate::math::simulation::ArmInput;
use crate::protocol::catalog::Service;
use crate::protocol::op::fields::{Bound, Fields, Rejections};

/// Enters the route of this file into the registry's table.
pub(super) fn attach<const N: usize>(arm: &Addr<ArmSim<N>>, nodes: &mut Nodes) {
    nodes.serve::<SetIntegrator>(Service::SetIntegrator, arm.clone());
}

/// Sets method and timestep.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SetIntegrator {
    /// The method that takes the steps.
    pub method: Option<Method>,
    /// Length of a step \[s\], greater than 0.
    pub timestep: Option<f64>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

/// Method and timestep in force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Integrator {
    /// The method that takes the steps.
    pub method: Method,
    /// Length of a step \[s\].
    pub timestep: f64,
}

impl Ask for SetIntegrator {
    type Answer = Echo<Integrator>;
}

impl<const N: usize> Handler<Call<SetIntegrator>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, call: Call<SetIntegrator>, ctx: &mut Context<Self>) {
        self.attend_call(ctx);
        call.reply.conclude(self.set_integrator(call.ask));
    }
}

impl<const N: usize> ArmSim<N> {
    fn set_integrator(&mut self, ask: SetIntegrator) -> Echo<Integrator> {
        if let Some(method) = ask.method {
            self.change(ArmInput::Method(method));
        }
        // Setting the timestep that is in force already must not cost the unfinished fraction of a step.
        if let Some(timestep) = ask.timestep
            && timestep.to_bits() != self.simulation.timestep().to_bits()
        {
            self.change(ArmInput::Timestep(timestep));
            self.restart_pacer();
        }
        Echo {
            values: Integrator {
                method: self.simulation.method(),
                timestep: self.simulation.timestep(),
            },
            rejected: ask.rejected,
        }
    }
}

impl FieldByField for SetIntegrator {
    fn of(fields: &mut Fields<'_>) -> Self {
        Self {
            method: fields.choice("method", &Method::ALL, Method::name),
            timestep: fields.number("timestep", Bound::Positive),
            rejected: Rejections::default(),
        }
    }

    fn rejected(&mut self) -> &mut Rejections {
        &mut self.rejected
    }
}

impl Answered for SetIntegrator {
    fn write(Echo { values, rejected }: Echo<Integrator>, to: &Address) -> Bytes {
        #[derive(Serialize)]
        struct Values {
            method: &'static str,
            timestep: f64,
        }
        let Integrator { method, timestep } = values;
        let method = method.name();
        to.response(&Values { method, timestep }, &rejected.status())
    }
}

//! `/arm_sim/set_state`: puts the arm into another state.
//!
//! **Invariant:** clock, setpoint, integral, gains and an active goal stay as they are.

use actix::prelude::*;
use bytes::Bytes;

use super::field_by_field::{Echo, FieldByField};
use super::reset::write_state;
use crate::actors::arm::sim::node::ArmSim;
use crate::actors::node::{Ask, Call};
use crate::actors::wire::{Address, Answered, Nodes};
use crate::math::arm::State;
use crate::math::simulation::ArmInput;
use crate::protocol::catalog::Service;
use crate::protocol::op::fields::{Bound, Fields, Rejections};

/// Enters the route of this file into the registry's table.
pub(super) fn attach<const N: usize>(arm: &Addr<ArmSim<N>>, nodes: &mut Nodes) {
    nodes.serve::<SetState<N>>(Service::SetState, arm.clone());
}

/// Sets positions and velocities, running or paused, and ends a divergence.
#[derive(Debug, Clone, PartialEq)]
pub struct SetState<const N: usize> {
    /// Joint positions \[rad\].
    pub position: Option<[f64; N]>,
    /// Joint velocities \[rad/s\].
    pub velocity: Option<[f64; N]>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

impl<const N: usize> Ask for SetState<N> {
    type Answer = Echo<State<N>>;
}

impl<const N: usize> Handler<Call<SetState<N>>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, Call { ask, reply }: Call<SetState<N>>, ctx: &mut Context<Self>) {
        self.attend_call(ctx);
        if ask.position.is_some() || ask.velocity.is_some() {
            let present = *self.simulation.state();
            self.put(State {
                position: ask.position.unwrap_or(present.position),
                velocity: ask.velocity.unwrap_or(present.velocity),
            });
        }
        let (values, rejected) = (*self.simulation.state(), ask.rejected);
        reply.conclude(Echo { values, rejected });
    }
}

impl<const N: usize> ArmSim<N> {
    fn put(&mut self, state: State<N>) {
        let had_diverged = self.simulation.divergence().is_some();
        self.change(ArmInput::State(state));
        self.restart_energy_drift();
        if had_diverged {
            // Time has stood still meanwhile.
            self.restart_pacer();
            self.publish_diagnostics();
        }
    }
}

impl<const N: usize> FieldByField for SetState<N> {
    fn of(fields: &mut Fields<'_>) -> Self {
        Self {
            position: fields.array("position", Bound::Finite),
            velocity: fields.array("velocity", Bound::Finite),
            rejected: Rejections::default(),
        }
    }

    fn rejected(&mut self) -> &mut Rejections {
        &mut self.rejected
    }
}

impl<const N: usize> Answered for SetState<N> {
    fn write(echo: Echo<State<N>>, to: &Address) -> Bytes {
        write_state(&echo, to)
    }
}

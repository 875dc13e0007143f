//! `/arm_sim/reset`: back to the starting pose at time 0.
//!
//! **Invariant:** a goal that ends by it is announced before the answer.

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;

use super::field_by_field::{Echo, FieldByField};
use crate::actors::arm::sim::node::ArmSim;
use crate::actors::node::{Ask, Call};
use crate::actors::wire::{Address, Answered, Nodes};
use crate::math::arm::State;
use crate::math::simulation::ArmInput;
use crate::protocol::catalog::Service;
use crate::protocol::op::fields::{Fields, Rejections};

/// Enters the route of this file into the registry's table.
pub(super) fn attach<const N: usize>(arm: &Addr<ArmSim<N>>, nodes: &mut Nodes) {
    nodes.serve::<Reset<N>>(Service::Reset, arm.clone());
}

/// Puts the arm back to its starting pose at time 0, unless something was rejected.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Reset<const N: usize> {
    /// A reset has no fields: what is rejected is the request as a whole.
    pub rejected: Rejections,
}

impl<const N: usize> Ask for Reset<N> {
    type Answer = Echo<State<N>>;
}

impl<const N: usize> Handler<Call<Reset<N>>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, call: Call<Reset<N>>, ctx: &mut Context<Self>) {
        self.attend_call(ctx);
        let (reply, rejected) = (call.reply, call.ask.rejected);
        if rejected.is_empty() {
            self.reset();
        }
        let values = *self.simulation.state();
        self.after_barriers(ctx, move || reply.conclude(Echo { values, rejected }));
    }
}

impl<const N: usize> ArmSim<N> {
    fn reset(&mut self) {
        let diverged = self.simulation.divergence().is_some();
        self.end_goal_for_reset();
        self.change(ArmInput::Reset);
        self.goals.setpoint_waits = false;
        self.paused_at = self.simulation.time();
        self.restart_pacer();
        self.restart_energy_drift();
        if diverged {
            self.publish_diagnostics();
        }
    }
}

impl<const N: usize> FieldByField for Reset<N> {
    fn of(_: &mut Fields<'_>) -> Self {
        Self {
            rejected: Rejections::default(),
        }
    }

    fn rejected(&mut self) -> &mut Rejections {
        &mut self.rejected
    }
}

impl<const N: usize> Answered for Reset<N> {
    fn write(echo: Echo<State<N>>, to: &Address) -> Bytes {
        write_state(&echo, to)
    }
}

/// Writes the state in which the arm is now.
pub(super) fn write_state<const N: usize>(echo: &Echo<State<N>>, to: &Address) -> Bytes {
    #[derive(Serialize)]
    struct Values<'a> {
        position: &'a [f64],
        velocity: &'a [f64],
    }
    let State { position, velocity } = &echo.values;
    to.response(&Values { position, velocity }, &echo.rejected.status())
}

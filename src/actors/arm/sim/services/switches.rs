//! Services with one field, `data`: `/arm_sim/pause` and `/pid_controller/enable`.
//!
//! **Invariant:** a switch that is in that position already changes nothing, but that a commanded effort ends.

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;

use super::field_by_field::{Echo, FieldByField};
use crate::actors::arm::sim::node::ArmSim;
use crate::actors::node::{Ask, Call};
use crate::actors::wire::{Address, Answered, Nodes};
use crate::math::simulation::ArmInput;
use crate::protocol::catalog::Service;
use crate::protocol::op::fields::{Fields, Rejections};

/// Enters the routes of this file into the registry's table.
pub(super) fn attach<const N: usize>(arm: &Addr<ArmSim<N>>, nodes: &mut Nodes) {
    nodes.serve::<Pause>(Service::Pause, arm.clone());
    nodes.serve::<Enable>(Service::Enable, arm.clone());
}

#[derive(Serialize)]
struct Switch {
    data: bool,
}

fn write_switch(echo: &Echo<bool>, to: &Address) -> Bytes {
    let data = echo.values;
    to.response(&Switch { data }, &echo.rejected.status())
}

/// Freezes or resumes simulation time. The answer is whether it is frozen.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Pause {
    /// True to freeze it.
    pub paused: Option<bool>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

impl Ask for Pause {
    type Answer = Echo<bool>;
}

impl<const N: usize> Handler<Call<Pause>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, call: Call<Pause>, ctx: &mut Context<Self>) {
        self.attend_call(ctx);
        let (reply, echo) = (call.reply, self.pause(call.ask));
        let answer = move || reply.conclude(echo);
        if self.paused {
            self.after_barriers(ctx, answer);
        } else {
            answer();
        }
    }
}

impl<const N: usize> ArmSim<N> {
    fn pause(&mut self, ask: Pause) -> Echo<bool> {
        if ask.paused == Some(true) {
            // One that was stepped meanwhile stands still again.
            self.paused_at = self.simulation.time();
        }
        if let Some(paused) = ask.paused
            && paused != self.paused
        {
            self.paused = paused;
            self.restart_pacer();
            self.publish_diagnostics();
        }
        Echo {
            values: self.paused,
            rejected: ask.rejected,
        }
    }
}

impl FieldByField for Pause {
    fn of(fields: &mut Fields<'_>) -> Self {
        Self {
            paused: fields.boolean("data"),
            rejected: Rejections::default(),
        }
    }

    fn rejected(&mut self) -> &mut Rejections {
        &mut self.rejected
    }
}

impl Answered for Pause {
    fn write(echo: Echo<bool>, to: &Address) -> Bytes {
        write_switch(&echo, to)
    }
}

/// Switches the controller on or off. The answer is whether it is on.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Enable {
    /// True to switch it on.
    pub enabled: Option<bool>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

impl Ask for Enable {
    type Answer = Echo<bool>;
}

impl<const N: usize> Handler<Call<Enable>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, call: Call<Enable>, ctx: &mut Context<Self>) {
        self.attend_call(ctx);
        let (reply, echo) = (call.reply, self.enable(call.ask));
        let answer = move || reply.conclude(echo);
        // A path ends with the controller, and before the answer.
        if self.simulation.pid().is_enabled() {
            answer();
        } else {
            self.after_barriers(ctx, answer);
        }
    }
}

impl<const N: usize> ArmSim<N> {
    fn enable(&mut self, ask: Enable) -> Echo<bool> {
        let commanded = self
            .simulation
            .command()
            .iter()
            .any(|effort| *effort != 0.0);
        if let Some(on) = ask.enabled
            && (on != self.simulation.pid().is_enabled() || commanded)
        {
            self.change(ArmInput::Enabled(on));
            self.goals.setpoint_waits = false;
            self.restart_energy_drift();
        }
        Echo {
            values: self.simulation.pid().is_enabled(),
            rejected: ask.rejected,
        }
    }
}

impl FieldByField for Enable {
    fn of(fields: &mut Fields<'_>) -> Self {
        Self {
            enabled: fields.boolean("data"),
            rejected: Rejections::default(),
        }
    }

    fn rejected(&mut self) -> &mut Rejections {
        &mut self.rejected
    }
}

impl Answered for Enable {
    fn write(echo: Echo<bool>, to: &Address) -> Bytes {
        write_switch(&echo, to)
    }
}

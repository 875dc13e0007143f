//! Answers in the recorded arm's place: its settings as they were where the record is.
//!
//! **Invariant:** what is asked is answered, what is to be changed is refused.

use actix::prelude::*;

use super::{DriveRecord, Player};
use crate::actors::arm::sim::{Echo, Enable, Pause, SetGains, SetIntegrator, SetParams};
use crate::actors::node::{Call, Unserved};
use crate::protocol::catalog::Node;
use crate::protocol::op::fields::Rejections;

/// The record has no arm at all.
const NO_ARM: Unserved = Unserved::NoAnswer(Node::ArmSim.name());

impl<const N: usize> Handler<Call<SetParams<N>>> for Player<N> {
    type Result = ();

    fn handle(&mut self, call: Call<SetParams<N>>, _: &mut Context<Self>) {
        let Call { ask, mut reply } = call;
        let mut rejected = ask.rejected;
        let given = [
            ("gravity", ask.gravity.is_some()),
            ("masses", ask.masses.is_some()),
            ("lengths", ask.lengths.is_some()),
        ];
        refuse(&mut rejected, &given);
        match self.settings().map(|settings| settings.arm) {
            Some(values) => reply.conclude(Echo { values, rejected }),
            None => reply.refuse(NO_ARM),
        }
    }
}

impl<const N: usize> Handler<Call<SetGains<N>>> for Player<N> {
    type Result = ();

    fn handle(&mut self, call: Call<SetGains<N>>, _: &mut Context<Self>) {
        let Call { ask, mut reply } = call;
        let mut rejected = ask.rejected;
        let given = [
            ("kp", ask.kp.is_some()),
            ("ki", ask.ki.is_some()),
            ("kd", ask.kd.is_some()),
        ];
        refuse(&mut rejected, &given);
        match self.settings().map(|settings| settings.gains) {
            Some(values) => reply.conclude(Echo { values, rejected }),
            None => reply.refuse(NO_ARM),
        }
    }
}

impl<const N: usize> Handler<Call<SetIntegrator>> for Player<N> {
    type Result = ();

    fn handle(&mut self, call: Call<SetIntegrator>, _: &mut Context<Self>) {
        let Call { ask, mut reply } = call;
        let mut rejected = ask.rejected;
        let given = [
            ("method", ask.method.is_some()),
            ("timestep", ask.timestep.is_some()),
        ];
        refuse(&mut rejected, &given);
        match self.settings().map(|settings| settings.integrator) {
            Some(values) => reply.conclude(Echo { values, rejected }),
            None => reply.refuse(NO_ARM),
        }
    }
}

impl<const N: usize> Handler<Call<Enable>> for Player<N> {
    type Result = ();

    fn handle(&mut self, call: Call<Enable>, _: &mut Context<Self>) {
        let Call { ask, mut reply } = call;
        let mut rejected = ask.rejected;
        refuse(&mut rejected, &[("data", ask.enabled.is_some())]);
        match self.settings().map(|settings| settings.is_enabled) {
            Some(values) => reply.conclude(Echo { values, rejected }),
            None => reply.refuse(NO_ARM),
        }
    }
}

/// The pause that clients of the live arm know is that of the record.
impl<const N: usize> Handler<Call<Pause>> for Player<N> {
    type Result = ();

    fn handle(&mut self, call: Call<Pause>, ctx: &mut Context<Self>) {
        let Call { ask, reply } = call;
        if let Some(paused) = ask.paused {
            // Only a place that is sought can be refused.
            let _ = self.drive(DriveRecord::Pause(paused), ctx);
        }
        reply.conclude(Echo {
            values: self.state().is_paused,
            rejected: ask.rejected,
        });
    }
}

/// Refuses a change of the recorded arm by its fields.
fn refuse(rejected: &mut Rejections, fields: &[(&str, bool)]) {
    for (field, is_given) in fields {
        if *is_given {
            rejected.refuse(field, &"cannot be changed: this is a record");
        }
    }
}

//! The arm's request for its limits, which `study` predicts on its workers.
//!
//! **Invariant:** at most one request is pending.

use actix::prelude::*;

use super::messages::{ArmSettings, Consult, HeldLimit};
use super::node::ArmSim;
use crate::services::study::Present;

impl<const N: usize> Handler<ArmSettings<N>> for ArmSim<N> {
    type Result = Present<N>;

    fn handle(&mut self, _: ArmSettings<N>, ctx: &mut Context<Self>) -> Present<N> {
        self.count_message(ctx);
        self.arm.present()
    }
}

impl<const N: usize> Handler<Consult<N>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, Consult(study): Consult<N>, _: &mut Context<Self>) {
        self.study = Some(study);
    }
}

impl<const N: usize> ArmSim<N> {
    /// Requests the limit of the active loop, if it is needed.
    pub(super) fn ask_limit(&mut self, ctx: &mut Context<Self>) {
        let Some(study) = &self.study else {
            return;
        };
        let Some(control) = self.arm.limit_to_predict() else {
            return;
        };
        let answer = study.send(HeldLimit(control)).into_actor(self);
        ctx.spawn(answer.map(move |answer, node, _| {
            node.arm.keep_limit(control, answer.ok().flatten());
        }));
    }
}

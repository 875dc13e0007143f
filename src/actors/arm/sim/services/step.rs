//! `/arm_sim/step`: single steps of a paused arm.
//!
//! Steps are taken [`STEPS_IN_A_ROW`] at a time, and those who ask for more take turns: it is as if each had asked for
//! single steps, one after the other, so what others ask takes effect in between.
//!
//! **Invariant:** a request that is refused at first changes nothing; one that is taken up is done as a whole, unless a
//! divergence, a resume or the end of the runtime comes in between.

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;

use super::disturb::DIVERGED;
use super::field_by_field::FieldByField;
use crate::actors::arm::sim::node::ArmSim;
use crate::actors::arm::sim::state::steps::{Stepped, Steps, StepsEnd};
use crate::actors::node::{Ask, Call, ShutDown, Unserved};
use crate::actors::wire::{Address, Answered, Nodes};
use crate::math::simulation::ArmInput;
use crate::protocol::catalog::Service;
use crate::protocol::messages::Empty;
use crate::protocol::op::fields::{Bound, Fields, Rejections};

/// Enters the route of this file into the registry's table.
pub(super) fn attach<const N: usize>(arm: &Addr<ArmSim<N>>, nodes: &mut Nodes) {
    nodes.serve::<Step<N>>(Service::Step, arm.clone());
}

/// Steps in one request: what one wake-up's budget is worth, and ten seconds of the default timestep.
pub const MAX_STEPS: u64 = 10_000;

/// Steps in a row: some 0.2 ms of work, so that neither the tick nor anybody's call waits for the steps of others.
pub const STEPS_IN_A_ROW: u64 = 1000;

/// Takes steps while paused. Refused if something was rejected, or the arm can't be stepped.
#[derive(Debug, Clone, PartialEq)]
pub struct Step<const N: usize> {
    /// How many, 1 to [`MAX_STEPS`].
    pub steps: Option<u64>,
    /// The effort that is applied in them \[N m\], while the controller stands still; none for the controller's.
    pub effort: Option<[f64; N]>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

impl<const N: usize> Ask for Step<N> {
    type Answer = Result<Stepped<N>, Rejections>;
}

impl<const N: usize> Handler<ShutDown> for ArmSim<N> {
    type Result = ();

    /// The goal that the arm pursues is its owner's to end.
    fn handle(&mut self, ShutDown(why): ShutDown, ctx: &mut Context<Self>) {
        self.count_message(ctx);
        for mut steps in self.steps.drain(..) {
            steps.reply.refuse(Unserved::Refused(why));
        }
    }
}

impl<const N: usize> Handler<Call<Step<N>>> for ArmSim<N> {
    type Result = ();

    /// Wall time plays no part in the steps, and the arm goes on from there when it is resumed.
    fn handle(&mut self, Call { ask, reply }: Call<Step<N>>, ctx: &mut Context<Self>) {
        self.attend_call(ctx);
        let mut rejected = ask.rejected;
        if !self.paused {
            rejected.refuse("steps", &"can be taken only while the arm is paused");
        } else if self.simulation.divergence().is_some() {
            rejected.refuse("steps", &DIVERGED);
        }
        let Some(asked) = ask.steps.filter(|_| rejected.is_empty()) else {
            return reply.conclude(Err(rejected));
        };
        let steps = Steps {
            asked,
            taken: 0,
            effort: ask.effort,
            reply,
        };
        if self.is_stepping && self.goals.is_judged() {
            return self.steps.push_back(steps);
        }
        self.take_row(steps);
        if !self.is_stepping {
            self.go_on_stepping(ctx);
        }
    }
}

impl<const N: usize> ArmSim<N> {
    /// Lets everybody else have a turn, and the owner of the goal hear how it goes; then those whose steps are not all
    /// taken, one after the other.
    fn go_on_stepping(&mut self, ctx: &mut Context<Self>) {
        let underway = self.goals.underway.take();
        self.is_stepping = underway.is_some() || !self.steps.is_empty();
        if !self.is_stepping {
            return;
        }
        let others = async move {
            match underway {
                Some(progress) => drop(progress.await),
                None => tokio::task::yield_now().await,
            }
        };
        ctx.spawn(others.into_actor(self).map(|(), arm, ctx| {
            if let Some(next) = arm.steps.pop_front() {
                arm.take_row(next);
            }
            arm.go_on_stepping(ctx);
        }));
    }

    /// Takes the next steps in a row; answers if they are the last, or puts the request behind those of the others.
    fn take_row(&mut self, mut steps: Steps<N>) {
        if steps.reply.caller_is_gone() {
            return steps.reply.refuse(Unserved::CallerGone);
        }
        if !self.paused {
            return self.end_steps(steps, StepsEnd::Resumed);
        }
        let has_diverged = self.simulation.divergence().is_some();
        if steps.effort.is_some() {
            self.change(ArmInput::Drive(steps.effort));
        }
        let row_end = steps.asked.min(steps.taken + STEPS_IN_A_ROW);
        // A goal that is reached on the way ends an advance, not the steps; what is to be told of it ends the row.
        while steps.taken < row_end
            && self.goals.underway.is_none()
            && self.simulation.divergence().is_none()
        {
            steps.taken += self.advance(row_end - steps.taken, true);
        }
        if steps.effort.is_some() {
            self.change(ArmInput::Drive(None));
        }
        if self.simulation.divergence().is_some() {
            if !has_diverged {
                self.note_divergence();
            }
            self.end_steps(steps, StepsEnd::Diverged);
        } else if steps.taken == steps.asked {
            self.end_steps(steps, StepsEnd::AllTaken);
        } else {
            self.steps.push_back(steps);
        }
    }

    fn end_steps(&self, steps: Steps<N>, end: StepsEnd) {
        steps.reply.conclude(Ok(Stepped {
            steps: steps.taken,
            time: self.simulation.time(),
            state: *self.simulation.state(),
            effort: *self.simulation.effort(),
            end,
        }));
    }
}

impl<const N: usize> FieldByField for Step<N> {
    fn of(fields: &mut Fields<'_>) -> Self {
        Self {
            steps: fields.count("steps", MAX_STEPS),
            effort: fields.array("effort", Bound::Finite),
            rejected: Rejections::default(),
        }
    }

    fn rejected(&mut self) -> &mut Rejections {
        &mut self.rejected
    }
}

impl<const N: usize> Answered for Step<N> {
    fn write(answer: Result<Stepped<N>, Rejections>, to: &Address) -> Bytes {
        #[derive(Serialize)]
        struct Values<'a> {
            steps: u64,
            time: f64,
            position: &'a [f64],
            velocity: &'a [f64],
            effort: &'a [f64],
        }
        match answer {
            Ok(stepped) => {
                let status = match stepped.end {
                    StepsEnd::AllTaken => "",
                    StepsEnd::Diverged => "steps ended early: the simulation has diverged",
                    StepsEnd::Resumed => "steps ended early: the arm has been resumed",
                };
                let values = Values {
                    steps: stepped.steps,
                    time: stepped.time,
                    position: &stepped.state.position,
                    velocity: &stepped.state.velocity,
                    effort: &stepped.effort,
                };
                to.response(&values, status)
            }
            Err(rejected) => to.response(&Empty {}, &rejected.status()),
        }
    }
}

//! What a person does to the arm by hand: single steps while it is paused, and pushes.
//!
//! **Invariant:** a request is done as a whole or refused as a whole; a refused one changes nothing.

use serde::Serialize;

use super::{ArmSim, BATCH};
use crate::actors::node::Reply;
use crate::protocol::fields::{Bound, Fields};
use crate::protocol::messages::Empty;

/// Steps in one request: what one wake-up's budget is worth, and ten seconds of the default timestep.
pub const MAX_STEPS: u64 = 10_000;

/// Why nothing moves any more.
const DIVERGED: &str = "is refused: the simulation has diverged; /arm_sim/reset clears this";

#[derive(Serialize)]
struct Stepped {
    steps: u64,
    time: f64,
}

#[derive(Serialize)]
struct Push<'a> {
    effort: &'a [f64],
    duration: f64,
}

impl<const N: usize> ArmSim<N> {
    /// Takes steps at once, while paused: wall time plays no part, and the arm goes on from there when it is resumed.
    pub(super) fn step_by_hand(&mut self, fields: &mut Fields, reply: Reply) {
        let steps = fields.count("steps", MAX_STEPS);
        if !self.paused {
            fields.refuse("steps", &"can be taken only while the arm is paused");
        } else if self.simulation.divergence().is_some() {
            fields.refuse("steps", &DIVERGED);
        }
        let Some(steps) = steps.filter(|_| fields.accepted()) else {
            return reply.conclude(&Empty {}, &fields.status());
        };
        let mut taken = 0;
        while taken < steps && self.simulation.divergence().is_none() {
            taken += self.advance((steps - taken).min(BATCH));
        }
        if self.simulation.divergence().is_some() {
            fields.refuse("steps", &"ended early: the simulation has diverged");
            self.note_divergence();
        }
        let time = self.simulation.time();
        reply.conclude(&Stepped { steps: taken, time }, &fields.status());
    }

    /// Adds an effort to that of every step for a while, from the next one on.
    pub(super) fn disturb(&mut self, fields: &mut Fields, reply: Reply) {
        let effort = fields.numbers("effort", N, Bound::Finite);
        let duration = fields.number("duration", Bound::Positive);
        if self.simulation.divergence().is_some() {
            fields.refuse("effort", &DIVERGED);
        }
        let effort: Option<[f64; N]> = effort.and_then(|effort| effort.try_into().ok());
        match (effort, duration) {
            (Some(effort), Some(duration)) if fields.accepted() => {
                self.simulation.disturb(effort, duration);
                let effort = &effort;
                reply.conclude(&Push { effort, duration }, "");
            }
            _ => reply.conclude(&Empty {}, &fields.status()),
        }
    }
}

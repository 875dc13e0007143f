//! The arm tells its news.
//!
//! **Invariant:** the simulation is changed from outside by [`ArmSim::change`] alone.

use actix::prelude::*;

use super::node::ArmSim;
use super::state::journal::{Journal, Tell};
use crate::math::simulation::ArmInput;

impl<const N: usize> Handler<Tell<N>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, Tell(listener): Tell<N>, ctx: &mut Context<Self>) {
        self.attend(ctx);
        self.tell_state();
        self.journal = listener.map(Journal::new);
        self.tell_state();
    }
}

impl<const N: usize> ArmSim<N> {
    /// Has `input` take effect, from the next step on.
    pub(super) fn change(&mut self, input: ArmInput<N>) {
        let steps = self.simulation.steps();
        self.simulation.apply(input);
        if let Some(journal) = &mut self.journal {
            journal.change(steps, input);
        }
    }

    /// Tells the state, if anybody listens and it has not been told.
    pub(super) fn tell_state(&mut self) {
        if let Some(journal) = &mut self.journal {
            journal.stand(&self.simulation);
        }
    }

    /// Tells that the step that was due has not been taken.
    pub(super) fn tell_divergence(&mut self) {
        if let Some(journal) = &mut self.journal {
            journal.diverge(&self.simulation);
        }
    }
}

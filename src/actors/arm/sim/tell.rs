//! The journal of the arm.
//!
//! **Invariant:** a listener gets the whole simulation first.

use actix::prelude::*;

use super::node::ArmSim;
use crate::live::{ArmListener, Journal};

/// Sets the listener of the journal, or none. From the recorder.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Tell<const N: usize>(pub Option<ArmListener<N>>);

impl<const N: usize> Handler<Tell<N>> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, Tell(listener): Tell<N>, ctx: &mut Context<Self>) {
        self.attend(ctx);
        self.arm.tell_state();
        self.arm.journal = listener.map(Journal::new);
        self.arm.tell_state();
    }
}

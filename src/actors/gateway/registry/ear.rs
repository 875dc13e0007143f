//! An ear for what passes the registry: the recorder has it, while it records.
//!
//! **Invariant:** without an eavesdropper nothing is made for it.

use crate::actors::gateway::messages::{Eavesdropper, Overheard};

/// An eavesdropper, or none.
#[derive(Default)]
pub(super) struct Ear(Option<Eavesdropper>);

impl Ear {
    /// Changes who listens.
    pub(super) fn lend(&mut self, to: Option<Eavesdropper>) {
        self.0 = to;
    }

    pub(super) fn is_open(&self) -> bool {
        self.0.is_some()
    }

    /// Lets whoever listens have it.
    pub(super) fn hear(&mut self, what: Overheard<'_>) {
        if let Some(eavesdropper) = &mut self.0 {
            eavesdropper(what);
        }
    }
}

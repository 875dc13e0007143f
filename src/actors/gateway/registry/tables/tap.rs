//! The tap: the recorder gets a copy of all that passes the registry, while it records.
//!
//! **Invariant:** without a tap nothing is made for it.

use crate::actors::gateway::messages::{Tap, Tapped};

/// The place for a tap, which may be empty.
#[derive(Default)]
pub(crate) struct TapPoint(Option<Tap>);

impl TapPoint {
    /// Sets the tap, or takes it away.
    pub(crate) fn set(&mut self, tap: Option<Tap>) {
        self.0 = tap;
    }

    pub(crate) fn is_set(&self) -> bool {
        self.0.is_some()
    }

    /// Passes a message to the tap, if there is one.
    pub(crate) fn pass(&mut self, message: Tapped<'_>) {
        if let Some(tap) = &mut self.0 {
            tap(message);
        }
    }
}

//! The inputs of the arm's steps, for a record, with the number of steps before each.
//!
//! **Invariant:** if a listener misses an input, its next event is the whole simulation.

use crate::math::arm::State;
use crate::math::simulation::{ArmInput, Simulation, StepNote};

/// An event of the arm, for a record.
#[derive(Debug, Clone, PartialEq)]
pub struct StepEvent<const N: usize> {
    /// Steps taken so far. A reset does not restart the count.
    pub step: u64,
    /// The content.
    pub event: ArmEvent<N>,
}

/// The kinds of events.
#[derive(Debug, Clone, PartialEq)]
pub enum ArmEvent<const N: usize> {
    /// The start of the journal, an input that has taken effect, or a divergence.
    Noted(StepNote<N>),
    /// The arm's state.
    State {
        /// Positions and velocities.
        state: State<N>,
        /// Effort of the latest step \[N m\].
        effort: [f64; N],
    },
}

/// Receives the arm's events, on the arm's thread, without blocking. Returns whether it has accepted the event.
pub type ArmListener<const N: usize> = Box<dyn FnMut(StepEvent<N>) -> bool + Send>;

/// The listener, and the last event for it.
pub struct Journal<const N: usize> {
    listener: ArmListener<N>,
    /// Steps taken up to the latest reset.
    before_reset: u64,
    /// The step of the latest recorded state.
    state_step: Option<u64>,
    /// The listener has all events since the whole simulation.
    is_whole: bool,
}

impl<const N: usize> Journal<N> {
    /// A journal for this listener, which has no event yet.
    #[must_use]
    pub fn new(listener: ArmListener<N>) -> Self {
        Self {
            listener,
            before_reset: 0,
            state_step: None,
            is_whole: false,
        }
    }

    /// Records that an input has taken effect, after this number of steps.
    pub(crate) fn change(&mut self, steps: u64, input: ArmInput<N>) {
        self.tell(steps, StepNote::Input(input));
        if matches!(input, ArmInput::Reset) {
            self.before_reset += steps;
        }
    }

    /// Records that the due step has not been taken.
    pub(crate) fn diverge(&mut self, simulation: &Simulation<N>) {
        self.tell(simulation.steps(), StepNote::Diverged);
    }

    /// Sends a note, which must not be missed.
    fn tell(&mut self, steps: u64, note: StepNote<N>) {
        if self.is_whole {
            self.is_whole = self.say(steps, ArmEvent::Noted(note));
        }
    }

    /// Sends the state, unless it has been sent.
    pub(crate) fn stand(&mut self, simulation: &Simulation<N>) {
        let steps = simulation.steps();
        if !self.is_whole {
            let whole = StepNote::Begin(Box::new(simulation.checkpoint()));
            self.is_whole = self.say(steps, ArmEvent::Noted(whole));
        }
        let step = self.before_reset + steps;
        if self.is_whole && self.state_step != Some(step) {
            self.state_step = Some(step);
            // A missed state is skipped. Later ones are still compared.
            self.say(
                steps,
                ArmEvent::State {
                    state: *simulation.state(),
                    effort: *simulation.effort(),
                },
            );
        }
    }

    fn say(&mut self, steps: u64, event: ArmEvent<N>) -> bool {
        let step = self.before_reset + steps;
        (self.listener)(StepEvent { step, event })
    }
}

//! Everything that the arm's steps depend on, for a record, with the number of steps before it.
//!
//! **Invariant:** a listener that has not taken an input hears nothing more but the whole simulation, until it has
//! taken that.

use crate::math::arm::State;
use crate::math::simulation::{ArmInput, Checkpoint, Simulation};

/// An event of the arm, for a record.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmNews<const N: usize> {
    /// Steps taken so far; goes on through resets.
    pub step: u64,
    /// The news.
    pub event: ArmEvent<N>,
}

/// The kinds of news.
#[derive(Debug, Clone, PartialEq)]
pub enum ArmEvent<const N: usize> {
    /// The whole simulation: the news begin here.
    Began(Box<Checkpoint<N>>),
    /// An input has taken effect.
    Changed(ArmInput<N>),
    /// The step from here on was not finite and was not taken.
    Diverged,
    /// The arm's state.
    Stands {
        /// Positions and velocities.
        state: State<N>,
        /// Effort of the latest step \[N m\].
        effort: [f64; N],
    },
}

/// Hears the arm's news, on its thread, and may not wait; answers whether it has taken them.
pub type ArmListener<const N: usize> = Box<dyn FnMut(ArmNews<N>) -> bool + Send>;

/// The listener, and how far the news have come.
pub struct Journal<const N: usize> {
    listener: ArmListener<N>,
    /// Steps taken up to the latest reset.
    before_reset: u64,
    /// The step of the latest state told.
    stood: Option<u64>,
    /// The listener has heard all since the simulation was told as a whole.
    is_whole: bool,
}

impl<const N: usize> Journal<N> {
    /// News for this listener, which has heard none.
    #[must_use]
    pub fn new(listener: ArmListener<N>) -> Self {
        Self {
            listener,
            before_reset: 0,
            stood: None,
            is_whole: false,
        }
    }

    /// An input has taken effect, after that many steps.
    pub(crate) fn change(&mut self, steps: u64, input: ArmInput<N>) {
        self.tell(steps, ArmEvent::Changed(input));
        if matches!(input, ArmInput::Reset) {
            self.before_reset += steps;
        }
    }

    /// The step that was due has not been taken.
    pub(crate) fn diverge(&mut self, simulation: &Simulation<N>) {
        self.tell(simulation.steps(), ArmEvent::Diverged);
    }

    /// Tells something that must not be missed.
    fn tell(&mut self, steps: u64, event: ArmEvent<N>) {
        if self.is_whole {
            self.is_whole = self.say(steps, event);
        }
    }

    /// Tells the state, unless that has been told.
    pub(crate) fn stand(&mut self, simulation: &Simulation<N>) {
        let steps = simulation.steps();
        if !self.is_whole {
            let whole = ArmEvent::Began(Box::new(simulation.checkpoint()));
            self.is_whole = self.say(steps, whole);
        }
        let step = self.before_reset + steps;
        if self.is_whole && self.stood != Some(step) {
            self.stood = Some(step);
            // A missed state is skipped: later ones are compared all the same.
            self.say(
                steps,
                ArmEvent::Stands {
                    state: *simulation.state(),
                    effort: *simulation.effort(),
                },
            );
        }
    }

    fn say(&mut self, steps: u64, event: ArmEvent<N>) -> bool {
        let step = self.before_reset + steps;
        (self.listener)(ArmNews { step, event })
    }
}

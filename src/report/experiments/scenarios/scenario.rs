//! A named scene and its outcome.
//!
//! **Invariant:** an outcome says what was seen, not what was hoped for.

/// A named scene.
#[derive(Debug, Clone, Copy)]
pub struct Scenario {
    /// `S01` to `S39`.
    pub id: &'static str,
    /// Its name.
    pub name: &'static str,
    /// The arm, its motion and its control.
    pub parameters: &'static str,
    /// The behaviour of a correct arm.
    pub expected: &'static str,
    /// Whether it takes seconds.
    pub slow: bool,
    pub(super) check: fn() -> Observation,
}

impl Scenario {
    /// Runs the scene.
    #[must_use]
    pub fn run(&self) -> Observation {
        (self.check)()
    }
}

/// The outcome of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Observation {
    /// The observation, with its figures.
    pub observed: String,
    /// Whether that is what was expected.
    pub holds: bool,
}

//! Named scenes, stiff and extreme, each with an expectation, an observation, and whether they agree.
//!
//! Expectations come from theory or from the arm's own prediction, never from an earlier run. Some are verdicts of the
//! study alone: efforts that are capped or late, and arms that the contract allows but a careful user would not. A
//! scene that falls short says so. `page/scenes.js` has the names, and a live arm for each.
//!
//! **Invariant:** 39 scenes, in order, each deterministic and bounded; `slow` ones take seconds. A seed in the source
//! gives what is random.

mod control;
mod extreme;
mod inertia;
mod methods;
mod motion;
mod support;

pub use support::{Observation, Scenario};

/// All scenes, in order.
#[must_use]
pub fn all() -> Vec<Scenario> {
    [
        motion::SCENES.as_slice(),
        control::SCENES.as_slice(),
        inertia::SCENES.as_slice(),
        extreme::SCENES.as_slice(),
        methods::SCENES.as_slice(),
    ]
    .concat()
}

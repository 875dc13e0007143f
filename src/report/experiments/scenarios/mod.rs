//! Named scenes, stiff and extreme, each with what is expected of it, what is observed, and whether that holds.
//!
//! Expectations come from theory or from the arm's own prediction, never from an earlier run. Some are verdicts of the
//! study alone: efforts that are capped or late, and arms that the live one takes as the contract wants but a careful
//! user would not. A scene that falls short says so.
//!
//! **Invariant:** 39 scenes, in order, each deterministic and bounded; `slow` ones take seconds.

mod extreme;
mod gains;
mod inertia;
mod live;
mod methods;
mod motion;
mod sampling;
mod scenario;
mod support;

pub use live::{LiveRun, LiveScene, live};
pub use scenario::{Observation, Scenario};

/// All scenes, in order.
#[must_use]
pub fn all() -> Vec<Scenario> {
    [
        motion::SCENES.as_slice(),
        gains::SCENES.as_slice(),
        sampling::SCENES.as_slice(),
        inertia::SCENES.as_slice(),
        extreme::SCENES.as_slice(),
        methods::SCENES.as_slice(),
    ]
    .concat()
}

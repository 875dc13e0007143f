//! pendularm: a real-time planar robot arm that any rosbridge client can drive.
//!
//! Three layers, arrows one way: [`math`] (pure: the arm, the integrators, the control law), [`protocol`] (pure: bytes
//! and JSON) and [`actors`] (joins the two, one actor per node). `math` and `protocol` do not know each other.
//!
//! Beside them [`study`] (pure: `math` measured against theory) and [`report`] (clock, files and drawings around the study),
//! and `web`, the door for browsers, in builds that have the feature of that name.

pub mod actors;
pub mod logging;
pub mod math;
pub mod options;
pub mod protocol;
pub mod report;
pub mod study;
#[cfg(feature = "web")]
pub mod web;

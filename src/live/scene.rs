//! Messages for 3D tools: all frames relative to the world, and `/tf_static` and `/robot_description`, which are sent once
//! and at every change of the arm.
//!
//! **Invariant:** the caller asks only for topics with subscribers.

use bytes::Bytes;

use crate::math::simulation::Simulation;
use crate::protocol::catalog::Topic;
use crate::protocol::messages::scene::{
    StringMessage, TfMessage, WORLD, fixed_frames, frames, seen_from,
};
use crate::protocol::messages::{self, Stamp};
use crate::protocol::ros::{srdf, urdf};
use crate::services::arm::joint_names;

/// All frames of an arm with these lengths \[m\] at these positions \[rad\], relative to the world.
pub(super) fn seen_from_world(stamp: Stamp, lengths: &[f64], positions: &[f64]) -> TfMessage {
    let all = frames(lengths.len());
    let all = all.iter().map(String::as_str);
    seen_from(stamp, WORLD, all, lengths, positions)
}

/// The writer of a message that stays valid until the next one, if the topic has such messages.
pub(super) fn lasting<const N: usize>(
    topic: Topic,
    simulation: &Simulation<N>,
) -> Option<Box<dyn FnOnce() -> Bytes + Send>> {
    let (arm, names) = (*simulation.arm(), joint_names::<N>());
    let stamp = Stamp::from_seconds(simulation.time());
    let text = move |data| messages::publish(topic.name(), &StringMessage { data });
    Some(match topic {
        Topic::TfStatic => {
            Box::new(move || messages::publish(topic.name(), &fixed_frames(stamp, arm.lengths())))
        }
        Topic::RobotDescription => {
            Box::new(move || text(urdf::describe(&names, arm.lengths(), arm.masses())))
        }
        Topic::RobotSemantics => Box::new(move || text(srdf::describe_semantics(&names))),
        _ => return None,
    })
}

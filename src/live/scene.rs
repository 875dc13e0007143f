//! Topics for 3D tools: `/tf` at every tick, all frames relative to the world at every second one, `/tf_static` and
//! `/robot_description` once and at every change of the arm.
//!
//! **Invariant:** nothing is computed for a topic without subscribers.

use super::{LiveArm, World};
use crate::math::arm::Arm;
use crate::protocol::catalog::Topic;
use crate::protocol::messages::Stamp;
use crate::protocol::messages::scene::{
    StringMessage, WORLD, fixed_frames, frames, moving_frames, seen_from,
};
use crate::protocol::ros::{srdf, urdf};
use crate::services::arm::joint_names;

impl<const N: usize, W: World<N>> LiveArm<N, W> {
    /// Publishes `/tf`, and at every second tick all frames relative to the world, if they have subscribers.
    pub(super) fn publish_transforms(&self, stamp: Stamp) {
        let lengths = *self.simulation.arm().lengths();
        let positions = self.simulation.state().position;
        if self.counts.wants(Topic::Tf) {
            self.publish(Topic::Tf, move || {
                moving_frames(stamp, &lengths, &positions)
            });
        }
        if self.counts.wants(Topic::TfWeb) && self.counts.ticks.is_multiple_of(2) {
            self.publish(Topic::TfWeb, move || {
                let (all, positions) = (frames(N), positions.as_slice());
                let all = all.iter().map(String::as_str);
                seen_from(stamp, WORLD, all, &lengths, positions)
            });
        }
    }

    /// Publishes the topics that show lengths or masses, if these differ from those of the arm `before`.
    pub(super) fn publish_description(&self, before: &Arm<N>) {
        let arm = self.simulation.arm();
        let is_as_long = arm.lengths().iter().eq(before.lengths());
        if !is_as_long {
            self.publish_lasting(Topic::TfStatic);
        }
        if !is_as_long || arm.masses().iter().ne(before.masses()) {
            self.publish_lasting(Topic::RobotDescription);
        }
    }

    /// Publishes a message that stays valid until the next one, if the topic has subscribers.
    pub(super) fn publish_lasting(&self, topic: Topic) {
        if !self.counts.wants(topic) {
            return;
        }
        let arm = *self.simulation.arm();
        match topic {
            Topic::TfStatic => {
                let stamp = Stamp::from_seconds(self.simulation.time());
                self.publish(topic, move || fixed_frames(stamp, arm.lengths()));
            }
            Topic::RobotDescription => {
                let names = joint_names::<N>();
                self.publish(topic, move || StringMessage {
                    data: urdf::describe(&names, arm.lengths(), arm.masses()),
                });
            }
            Topic::RobotSemantics => {
                let names = joint_names::<N>();
                self.publish(topic, move || StringMessage {
                    data: srdf::describe_semantics(&names),
                });
            }
            _ => {}
        }
    }
}

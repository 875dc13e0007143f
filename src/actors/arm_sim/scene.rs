//! What 3D tools need: `/tf` at every tick, `/tf_static` and `/robot_description` once and at every change of the arm.
//!
//! **Invariant:** nothing is made for a topic that nobody subscribes to.

use super::ArmSim;
use crate::protocol::catalog::Topic;
use crate::protocol::messages::Stamp;
use crate::protocol::scene_messages::{StringMessage, fixed_frames, moving_frames};
use crate::protocol::urdf;

impl<const N: usize> ArmSim<N> {
    /// `/tf`, if anybody wants it.
    pub(super) fn publish_frames(&self, stamp: Stamp) {
        if self.telemetry.wants(Topic::Tf) {
            let lengths = self.simulation.arm().lengths();
            let positions = &self.simulation.state().position;
            self.publish(Topic::Tf, &moving_frames(stamp, lengths, positions));
        }
    }

    /// What changes with lengths and masses alone, to whoever wants it.
    pub(super) fn publish_description(&self) {
        self.publish_lasting(Topic::TfStatic);
        self.publish_lasting(Topic::RobotDescription);
    }

    /// A message that holds until the next, if anybody wants it.
    pub(super) fn publish_lasting(&self, topic: Topic) {
        if !self.telemetry.wants(topic) {
            return;
        }
        let arm = self.simulation.arm();
        match topic {
            Topic::TfStatic => {
                let stamp = Stamp::from_seconds(self.simulation.time());
                self.publish(topic, &fixed_frames(stamp, arm.lengths()));
            }
            Topic::RobotDescription => {
                let data = urdf::describe(&self.joint_names, arm.lengths(), arm.masses());
                self.publish(topic, &StringMessage { data });
            }
            _ => {}
        }
    }
}

//! The arm for planners, in addition to its URDF: SRDF with one group of all joints.
//!
//! **Invariant:** every named link and joint exists in the [description](super::urdf).

use std::fmt::Write as _;

use crate::protocol::messages::scene::{END_EFFECTOR, WORLD, link_name};

/// The name of the group.
const GROUP: &str = "arm";

/// The semantic description of an arm with these joints. Links can pass through each other, so no collision is checked.
#[must_use]
pub fn describe_semantics(joint_names: &[&str]) -> String {
    let mut xml = format!(
        "<?xml version=\"1.0\"?>\n<robot name=\"pendularm\">\n  <group name=\"{GROUP}\">\n    \
         <chain base_link=\"{WORLD}\" tip_link=\"{END_EFFECTOR}\"/>\n  </group>\n  \
         <group_state name=\"home\" group=\"{GROUP}\">\n"
    );
    // Writing to a `String` cannot fail.
    for joint in joint_names {
        let _ = writeln!(xml, "    <joint name=\"{joint}\" value=\"0\"/>");
    }
    xml.push_str("  </group_state>\n");
    let count = joint_names.len();
    for (first, second) in (0..count).flat_map(|one| (one + 1..count).map(move |two| (one, two))) {
        let reason = if second == first + 1 {
            "Adjacent"
        } else {
            "Never"
        };
        let (first, second) = (link_name(first), link_name(second));
        let _ = writeln!(
            xml,
            "  <disable_collisions link1=\"{first}\" link2=\"{second}\" reason=\"{reason}\"/>"
        );
    }
    xml.push_str("</robot>\n");
    xml
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_group_reaches_from_the_world_to_the_end_effector_and_home_names_every_joint() {
        let xml = describe_semantics(&["joint1", "joint2", "joint3"]);
        assert!(xml.contains("<chain base_link=\"world\" tip_link=\"hand\"/>"));
        assert_eq!(xml.matches("<joint name=").count(), 3);
        assert_eq!(xml.matches("reason=\"Adjacent\"").count(), 2);
        assert_eq!(xml.matches("<disable_collisions").count(), 3);
        assert!(xml.ends_with("</robot>\n"));
    }
}

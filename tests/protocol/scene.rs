//! Messages for 3D tools: the arm's description, its frames, and the setpoint that a goal sends.
//!
//! **Invariant:** the description is compared whole, and frames are those of the description.

use std::f64::consts::PI;

use pendularm::protocol::messages::Stamp;
use pendularm::protocol::messages::goal::{TargetMessage, setpoint_trajectory};
use pendularm::protocol::messages::scene::link_name;
use pendularm::protocol::messages::scene::{TransformStamped, fixed_frames, moving_frames};
use pendularm::protocol::ros::urdf::describe;
use serde_json::{Value, json};

const STAMP: Stamp = Stamp { sec: 4, nanosec: 5 };

/// Two rods, 0.5 m and 1 kg, 2 m and 3 kg: m l² / 12 is 1/48 and 1 kg m².
#[test]
fn the_description_of_two_links_is_this_text() {
    let link = |name: &str, length: &str, middle: &str, mass: &str, inertia: &str, axial: &str| {
        format!(
            "  <link name=\"{name}\">\n    <inertial>\n      <origin xyz=\"{middle} 0 0\"/>\n      \
             <mass value=\"{mass}\"/>\n      <inertia ixx=\"{axial}\" ixy=\"0\" ixz=\"0\" iyy=\"{inertia}\" iyz=\"0\" \
             izz=\"{inertia}\"/>\n    </inertial>\n    <visual>\n      <origin xyz=\"{middle} 0 0\"/>\n      \
             <geometry><box size=\"{length} 0.05 0.05\"/></geometry>\n    </visual>\n  </link>\n"
        )
    };
    let joint = |name: &str, parent: &str, child: &str, at: &str| {
        format!(
            "  <joint name=\"{name}\" type=\"continuous\">\n    <parent link=\"{parent}\"/>\n    \
             <child link=\"{child}\"/>\n    <origin xyz=\"{at} 0 0\"/>\n    <axis xyz=\"0 0 1\"/>\n  </joint>\n"
        )
    };
    let expected = [
        "<?xml version=\"1.0\"?>\n<robot name=\"pendularm\">\n  <link name=\"world\"/>\n",
        &joint("joint1", "world", "link1", "0.0"),
        &link(
            "link1",
            "0.5",
            "0.25",
            "1.0",
            "0.020833333333333332",
            "2.083333333333333e-8",
        ),
        &joint("joint2", "link1", "link2", "0.5"),
        &link("link2", "2.0", "1.0", "3.0", "1.0", "1e-6"),
        "  <joint name=\"hand_mount\" type=\"fixed\">\n    <parent link=\"link2\"/>\n    <child link=\"hand\"/>\n    \
         <origin xyz=\"2.0 0 0\"/>\n  </joint>\n  <link name=\"hand\"/>\n</robot>\n",
    ];
    assert_eq!(
        describe(&["joint1", "joint2"], &[0.5, 2.0], &[1.0, 3.0]),
        expected.concat()
    );
}

#[test]
fn links_are_counted_from_1() {
    assert_eq!([0, 1, 2].map(link_name), ["link1", "link2", "link3"]);
}

fn shown(frame: &TransformStamped) -> (&str, &str, [f64; 3]) {
    let translation = frame.transform.translation;
    assert_eq!(frame.header.stamp, STAMP);
    (
        &frame.header.frame_id,
        &frame.child_frame_id,
        [translation.x, translation.y, translation.z],
    )
}

/// A turn about z by an angle a is the quaternion (0, 0, sin a/2, cos a/2).
#[test]
fn every_link_stands_at_the_end_of_the_one_before_and_is_turned_by_its_joint() {
    let angles = [PI / 3.0, -PI, 0.0];
    let frames = moving_frames(STAMP, &[0.5, 2.0, 7.0], &angles).transforms;
    let places: Vec<_> = frames.iter().map(shown).collect();
    assert_eq!(
        places,
        [
            ("world", "link1", [0.0, 0.0, 0.0]),
            ("link1", "link2", [0.5, 0.0, 0.0]),
            ("link2", "link3", [2.0, 0.0, 0.0]),
        ]
    );
    for (frame, (sin, cos)) in frames
        .iter()
        .zip([(0.5, 0.75_f64.sqrt()), (-1.0, 0.0), (0.0, 1.0)])
    {
        let turn = frame.transform.rotation;
        assert_eq!((turn.x, turn.y), (0.0, 0.0));
        // Sine and cosine differ between systems by an ulp or two.
        assert!((turn.z - sin).abs() < 1e-15 && (turn.w - cos).abs() < 1e-15);
    }
}

#[test]
fn the_hand_is_fixed_to_the_end_of_the_last_link() {
    let frames = fixed_frames(STAMP, &[0.5, 2.0]).transforms;
    assert_eq!(frames.len(), 1);
    assert_eq!(shown(&frames[0]), ("link2", "hand", [2.0, 0.0, 0.0]));
    assert_eq!(
        (
            frames[0].transform.rotation.z,
            frames[0].transform.rotation.w
        ),
        (0.0, 1.0)
    );
}

#[test]
fn a_goals_setpoint_is_a_trajectory_of_one_point_at_rest() {
    let trajectory = setpoint_trajectory(&["joint1", "joint2"], &[0.5, -1.0]);
    let zero = json!({"sec": 0, "nanosec": 0});
    let read: Value = serde_json::from_str(trajectory.get()).unwrap();
    assert_eq!(
        read,
        json!({
            "header": {"stamp": zero, "frame_id": ""},
            "joint_names": ["joint1", "joint2"],
            "points": [{"positions": [0.5, -1.0], "velocities": [0.0, 0.0], "accelerations": [], "time_from_start": zero}],
        })
    );
}

#[test]
fn a_targets_orientation_is_left_out_where_none_was_asked_for() {
    let target = TargetMessage {
        x: 1.0,
        y: 2.0,
        phi: None,
    };
    assert_eq!(
        serde_json::to_value(target).unwrap(),
        json!({"x": 1.0, "y": 2.0})
    );
}

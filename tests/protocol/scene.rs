//! The arm's description, compared whole. `tests/actors/exchanges/` has its frames and the setpoint that a goal sends.

use pendularm::protocol::ros::urdf::describe;

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

//! The arm for 3D tools: URDF from lengths and masses.
//!
//! There is one link per rod, `link1` to `linkN`, with `world` before the first and [`END_EFFECTOR`] after the last.
//! Joint `i` turns about z. At `q = 0` all links are along +x. `/tf` has frames of the same names.
//!
//! **Invariant:** the inertia is that of the dynamics: a thin uniform rod.

use std::fmt::Write as _;

use crate::protocol::messages::scene::{END_EFFECTOR, WORLD, link_name};

/// Thickness of a link in drawings \[m\]. In the dynamics it has none.
const THICKNESS: f64 = 0.05;
/// A thin rod has no inertia about its own axis. Parsers want one greater than 0, and at most the sum of the other two.
const AXIAL_PART: f64 = 1e-6;

/// The description of an arm with these lengths \[m\] and masses \[kg\].
#[must_use]
pub fn describe(joint_names: &[&str], lengths: &[f64], masses: &[f64]) -> String {
    let mut xml = String::from("<?xml version=\"1.0\"?>\n<robot name=\"pendularm\">\n");
    let _ = writeln!(xml, "  <link name=\"{WORLD}\"/>");
    let (mut parent, mut at) = (WORLD.to_owned(), 0.0);
    for (index, ((joint, length), mass)) in joint_names.iter().zip(lengths).zip(masses).enumerate()
    {
        let link = link_name(index);
        let middle = length / 2.0;
        // For the lightest and shortest rod the inertia would underflow to 0.
        let across =
            (mass * length * length / 12.0).clamp(f64::MIN_POSITIVE / AXIAL_PART, f64::MAX);
        let along = across * AXIAL_PART;
        // Writing to a `String` cannot fail.
        let _ = write!(
            xml,
            "  <joint name=\"{joint}\" type=\"continuous\">\n    <parent link=\"{parent}\"/>\n    \
             <child link=\"{link}\"/>\n    <origin xyz=\"{at:?} 0 0\"/>\n    <axis xyz=\"0 0 1\"/>\n  </joint>\n  \
             <link name=\"{link}\">\n    <inertial>\n      <origin xyz=\"{middle:?} 0 0\"/>\n      \
             <mass value=\"{mass:?}\"/>\n      <inertia ixx=\"{along:?}\" ixy=\"0\" ixz=\"0\" \
             iyy=\"{across:?}\" iyz=\"0\" izz=\"{across:?}\"/>\n    </inertial>\n    <visual>\n      \
             <origin xyz=\"{middle:?} 0 0\"/>\n      <geometry>\
             <box size=\"{length:?} {THICKNESS} {THICKNESS}\"/></geometry>\n    \
             </visual>\n  </link>\n"
        );
        parent = link;
        at = *length;
    }
    let _ = write!(
        xml,
        "  <joint name=\"{END_EFFECTOR}_mount\" type=\"fixed\">\n    <parent link=\"{parent}\"/>\n    \
         <child link=\"{END_EFFECTOR}\"/>\n    <origin xyz=\"{at:?} 0 0\"/>\n  </joint>\n  \
         <link name=\"{END_EFFECTOR}\"/>\n</robot>\n"
    );
    xml
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each inertia is greater than 0 and at most the sum of the other two, for every rod.
    #[test]
    fn inertias_are_those_of_a_body() {
        let numbers = [5e-324, 1e-200, 1e-9, 0.002, 0.05, 1.0, 1e9, 1e200, f64::MAX];
        for (mass, length) in numbers.iter().flat_map(|m| numbers.map(|l| (*m, l))) {
            let xml = describe(&["joint1"], &[length], &[mass]);
            let inertia = |name: &str| -> f64 {
                let rest = xml.split_once(&format!("{name}=\"")).unwrap().1;
                rest.split_once('"').unwrap().0.parse().unwrap()
            };
            let [x, y, z] = ["ixx", "iyy", "izz"].map(inertia);
            for (one, others) in [(x, y + z), (y, x + z), (z, x + y)] {
                assert!(one > 0.0 && one.is_finite(), "{mass} kg, {length} m: {xml}");
                assert!(one <= others, "{mass} kg, {length} m: {xml}");
            }
        }
    }
}

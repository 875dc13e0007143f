//! The forward formulas against stored 60-digit values. `reach.rs` and `edges.rs` compare the inverse with them.

use super::*;
use serde_json::Value;

use crate::stored::{array, entries, for_links, number};

/// The stored `sens` is the sum of `lᵢ (1 + |q₁| + … + |qᵢ|)`, the cost of rounding each *summed* angle. Composed
/// rotations lose less. The data set has the bar 8·2⁻⁵³.
fn check_forward<const N: usize>(case: &Value) {
    let (lengths, q) = (array::<N>(&case["lengths"]), array(&case["q"]));
    let bound = 4.0 * f64::EPSILON * number(&case["sens"]);
    let ends = joints(&lengths, &q);
    for (i, end) in ends.iter().enumerate() {
        let off = *end - DVec2::from(array(&case["joints"][i + 1]));
        assert!(off.length() <= bound, "{case}: joint {i} at {end}");
    }
    let tip = forward(&lengths, &q);
    assert_eq!(tip.position, ends[N - 1]);
    let phi = number(&case["phi"]);
    let size: f64 = q.iter().map(|q| q.abs()).sum();
    let off = (tip.orientation - phi).abs();
    assert!(off <= 4.0 * f64::EPSILON * size, "{case}");
    let along = heading(&q);
    let off = (along.y.atan2(along.x) - wrap(phi)).abs();
    assert!(off <= 1e-15 * (4.0 + size), "{case}");
}

#[test]
fn forward_kinematics_agrees_with_the_stored_values() {
    for case in entries(include_str!("../../data/kinematics.json"), "cases") {
        for_links!(case, check_forward(&case));
    }
}

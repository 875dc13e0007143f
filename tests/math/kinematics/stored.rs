//! Against stored 60-digit values.

use super::*;
use crate::stored::{array, for_links, number};

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
    for case in oracle("fk") {
        for_links!(case, check_forward(&case));
    }
}

/// Solves a stored case from several present poses; each stored elbow, taken as the present pose, must come back.
fn check_inverse<const N: usize>(case: &Value) {
    let lengths = array::<N>(&case["lengths"]);
    let target = Target {
        orientation: case["phi"].as_f64(),
        ..at(number(&case["x"]), number(&case["y"]))
    };
    let poses = [[0.0; N], [1.0; N], [-2.5; N], [PI; N], [1e8; N], [-40.0; N]];
    if case["reachable"] == false {
        for present in &poses {
            let error = solve(&lengths, present, &target).unwrap_err();
            let outer = case["limit"] == "outer";
            let fits = match error {
                Unreachable::Beyond { .. } => outer,
                Unreachable::TooClose { .. } => !outer,
                // The oracle's limits are the wrist's where an orientation is asked for.
                Unreachable::WristBeyond { .. } => outer && target.orientation.is_some(),
                Unreachable::WristTooClose { .. } => !outer && target.orientation.is_some(),
                _ => false,
            };
            assert!(fits, "{case}: {error}");
        }
        return;
    }
    for present in &poses {
        let q = solve(&lengths, present, &target).unwrap_or_else(|e| panic!("{case}: {e}"));
        assert_wrapped(&q);
        let is_interior = case["class"] == "interior";
        let bar = if is_interior { INTERIOR } else { 1e-13 };
        assert!(miss(&lengths, &q, &target) <= bar, "{case}: {q:?}");
        if let Some(phi) = target.orientation {
            let off = turn(forward(&lengths, &q).orientation, phi).abs();
            assert!(off <= 1e-15 * (8.0 + phi.abs()), "{case}");
        }
    }
    for solution in case["solutions"].as_array().into_iter().flatten() {
        let Some(condition) = solution["q_cond"].as_f64() else {
            continue;
        };
        let expected = array::<N>(&solution["q"]);
        let q = solve(&lengths, &expected, &target).unwrap();
        // Rounding of the target itself, magnified by the condition, plus that of the angles.
        let bar = 8.0 * f64::EPSILON * condition.max(4.0);
        for (q, expected) in q.iter().zip(&expected) {
            let off = turn(*expected, *q).abs();
            assert!(off <= bar, "{case}: {q} for {expected}");
        }
    }
}

#[test]
fn every_stored_inverse_case_is_solved_or_refused_as_it_should_be() {
    for case in oracle("ik") {
        for_links!(case, check_inverse(&case));
    }
}

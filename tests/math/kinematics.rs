//! Forward and inverse kinematics against stored 60-digit values, and against each other over the whole reachable set.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec2, dvec2};
use pendularm::math::kinematics::{
    BOUNDARY, Reach, Target, Unreachable, forward, heading, joints, nearest_turn, solve, turn, wrap,
};
use proptest::prelude::*;
use serde_json::Value;

/// Error that contract and oracle allow in a round trip, as a share of the sum of the lengths.
const ROUND_TRIP: f64 = 1e-9;

/// Error of the closed form on targets that are not moved onto a boundary: a dozen roundings of the wrist, the
/// angles and their sines, each 2⁻⁵³ of a quantity no larger than the sum of the lengths or than π, and 1e-15 that is
/// lost before when an orientation is asked for a whole turn away.
const INTERIOR: f64 = 4e-15;

fn oracle(kind: &str) -> Vec<Value> {
    let text = include_str!("../data/kinematics.json");
    let document: Value = serde_json::from_str(text).unwrap();
    let cases = document["cases"].as_array().unwrap();
    let cases: Vec<_> = cases
        .iter()
        .filter(|case| case["type"] == kind)
        .cloned()
        .collect();
    assert!(!cases.is_empty());
    cases
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    let list: Vec<f64> = value
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect();
    list.try_into().unwrap()
}

fn at(x: f64, y: f64) -> Target {
    Target {
        position: dvec2(x, y),
        orientation: None,
    }
}

fn aimed(x: f64, y: f64, phi: f64) -> Target {
    Target {
        position: dvec2(x, y),
        orientation: Some(phi),
    }
}

/// Distance between the target and where the solution puts the hand, as a share of the sum of the lengths.
fn miss<const N: usize>(lengths: &[f64; N], q: &[f64; N], target: &Target) -> f64 {
    let off = forward(lengths, q).position - target.position;
    off.x.hypot(off.y) / lengths.iter().sum::<f64>()
}

fn assert_wrapped<const N: usize>(q: &[f64; N]) {
    assert!(q.iter().all(|q| -PI < *q && *q <= PI), "{q:?}");
}

/// Sum of squared wrapped differences: what the choice of the elbow is made by.
fn cost<const N: usize>(q: &[f64; N], present: &[f64; N]) -> f64 {
    q.iter()
        .zip(present)
        .map(|(q, p)| wrap(q - p).powi(2))
        .sum()
}

// ---------------------------------------------------------------------------------------------------- stored values

/// The stored `sens` is the sum of `lᵢ (1 + |q₁| + … + |qᵢ|)`: what rounding each *summed* angle would cost. Composed
/// rotations do better; 8·2⁻⁵³ is the bar that the data set names.
fn check_forward<const N: usize>(case: &Value) {
    let lengths = numbers::<N>(&case["lengths"]);
    let q = numbers::<N>(&case["q"]);
    let bound = 4.0 * f64::EPSILON * case["sens"].as_f64().unwrap();
    let ends = joints(&lengths, &q);
    for (i, end) in ends.iter().enumerate() {
        let [x, y] = numbers::<2>(&case["joints"][i + 1]);
        assert!(
            (*end - dvec2(x, y)).length() <= bound,
            "{case}: joint {i} at {end}"
        );
    }
    let tip = forward(&lengths, &q);
    assert_eq!(tip.position, ends[N - 1]);
    let phi = case["phi"].as_f64().unwrap();
    let size: f64 = q.iter().map(|q| q.abs()).sum();
    assert!(
        (tip.orientation - phi).abs() <= 4.0 * f64::EPSILON * size,
        "{case}"
    );
    let along = heading(&q);
    assert!(
        (along.y.atan2(along.x) - wrap(phi)).abs() <= 1e-15 * (4.0 + size),
        "{case}"
    );
}

#[test]
fn forward_kinematics_agrees_with_the_stored_values_for_one_to_six_links() {
    for case in oracle("fk") {
        match case["n"].as_u64().unwrap() {
            1 => check_forward::<1>(&case),
            2 => check_forward::<2>(&case),
            3 => check_forward::<3>(&case),
            4 => check_forward::<4>(&case),
            5 => check_forward::<5>(&case),
            6 => check_forward::<6>(&case),
            n => panic!("{n} links"),
        }
    }
}

fn target_of(case: &Value) -> Target {
    Target {
        position: dvec2(case["x"].as_f64().unwrap(), case["y"].as_f64().unwrap()),
        orientation: case["phi"].as_f64(),
    }
}

/// Solves a stored case from several present poses; each stored elbow, taken as the present pose, must come back.
fn check_inverse<const N: usize>(case: &Value) {
    let lengths = numbers::<N>(&case["lengths"]);
    let target = target_of(case);
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
        let bar = if case["class"] == "interior" {
            INTERIOR
        } else {
            1e-13
        };
        assert!(miss(&lengths, &q, &target) <= bar, "{case}: {q:?}");
        if let Some(phi) = target.orientation {
            assert!(
                turn(forward(&lengths, &q).orientation, phi).abs() <= 1e-15 * (8.0 + phi.abs())
            );
        }
    }
    for solution in case["solutions"].as_array().into_iter().flatten() {
        let Some(condition) = solution["q_cond"].as_f64() else {
            continue;
        };
        let expected = numbers::<N>(&solution["q"]);
        let q = solve(&lengths, &expected, &target).unwrap();
        // Rounding of the target itself, magnified by the condition, plus that of the angles.
        let bar = 8.0 * f64::EPSILON * condition.max(4.0);
        for (q, expected) in q.iter().zip(&expected) {
            assert!(
                turn(*expected, *q).abs() <= bar,
                "{case}: {q} for {expected}"
            );
        }
    }
}

#[test]
fn every_stored_inverse_case_is_solved_or_refused_as_it_should_be() {
    for case in oracle("ik") {
        match case["n"].as_u64().unwrap() {
            2 => check_inverse::<2>(&case),
            3 => check_inverse::<3>(&case),
            n => panic!("{n} links"),
        }
    }
}

// ------------------------------------------------------------------------------------------- the whole reachable set

/// Lengths from 1e-6 to 1e6 m, each alone: ratios up to 1e12.
fn length() -> impl Strategy<Value = f64> {
    (-6.0..=6.0f64).prop_map(|exponent| 10f64.powf(exponent))
}

/// Shares of a range, as often within 1e-16 of either end as in its middle.
fn share() -> impl Strategy<Value = f64> {
    let tiny = (-16.0..0.0f64).prop_map(|exponent| 10f64.powf(exponent));
    prop_oneof![
        0.0..=1.0f64,
        tiny.clone(),
        tiny.prop_map(|t| 1.0 - t),
        Just(0.0),
        Just(1.0)
    ]
}

/// Joint angles: any, right angles, stretched and folded ones, and wound up ones.
fn angle() -> impl Strategy<Value = f64> {
    prop_oneof![
        -PI..=PI,
        Just(0.0),
        Just(PI),
        Just(FRAC_PI_2),
        (-16.0..0.0f64).prop_map(|exponent| PI - 10f64.powf(exponent)),
        (-16.0..0.0f64).prop_map(|exponent| 10f64.powf(exponent)),
        -1e8..=1e8f64,
    ]
}

/// The contract's bar is [`ROUND_TRIP`]; a target inside the reach is held to [`INTERIOR`].
fn check_round_trip<const N: usize>(lengths: &[f64; N], present: &[f64; N], target: &Target) {
    const { assert!(INTERIOR < ROUND_TRIP) };
    let q = solve(lengths, present, target)
        .unwrap_or_else(|e| panic!("{lengths:?} {present:?} {target:?}: {e}"));
    assert_wrapped(&q);
    let off = miss(lengths, &q, target);
    assert!(
        off <= INTERIOR,
        "{lengths:?} {present:?} {target:?}: {q:?} is {off:e} off"
    );
    if let (3, Some(phi)) = (N, target.orientation) {
        assert!(turn(forward(lengths, &q).orientation, phi).abs() <= 1e-14);
    }
    // The joints that a goal commands are the same pose; what a wound angle cannot hold is not asked of it.
    let commanded = nearest_turn(&q, present);
    let bar = INTERIOR + present.iter().map(|p| f64::EPSILON * p.abs()).sum::<f64>();
    assert!(miss(lengths, &commanded, target) <= bar);
    for (commanded, present) in commanded.iter().zip(present) {
        assert!((commanded - present).abs() <= PI + f64::EPSILON * (4.0 + present.abs()));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn two_links_round_trip_at_every_distance_and_ratio(
        lengths in [length(), length()],
        share in share(),
        bearing in -PI..=PI,
        present in [angle(), angle()],
    ) {
        let Reach { inner, outer } = Reach::of(&lengths);
        let DVec2 { x, y } = (inner + share * (outer - inner)) * DVec2::from_angle(bearing);
        check_round_trip(&lengths, &present, &at(x, y));
    }

    #[test]
    fn wherever_two_equal_links_can_be_they_can_be_sent(
        length in length(),
        distance in share(),
        bearing in -PI..=PI,
        present in [angle(), angle()],
    ) {
        let DVec2 { x, y } = 2.0 * length * distance * DVec2::from_angle(bearing);
        check_round_trip(&[length, length], &present, &at(x, y));
    }

    #[test]
    fn three_links_round_trip_at_every_distance_and_ratio_without_an_orientation(
        lengths in [length(), length(), length()],
        share in share(),
        bearing in -PI..=PI,
        present in [angle(), angle(), angle()],
    ) {
        let Reach { inner, outer } = Reach::of(&lengths);
        let DVec2 { x, y } = (inner + share * (outer - inner)) * DVec2::from_angle(bearing);
        check_round_trip(&lengths, &present, &at(x, y));
    }

    #[test]
    fn three_links_return_to_every_pose_that_they_can_have(
        lengths in [length(), length(), length()],
        pose in [angle(), angle(), angle()],
        present in [angle(), angle(), angle()],
    ) {
        let DVec2 { x, y } = forward(&lengths, &pose).position;
        let along = heading(&pose);
        let phi = along.y.atan2(along.x);
        check_round_trip(&lengths, &present, &at(x, y));
        check_round_trip(&lengths, &present, &aimed(x, y, phi));
        // Whole turns of the orientation asked for are its own business.
        check_round_trip(&lengths, &present, &aimed(x, y, phi - TAU));
    }

    #[test]
    fn two_links_return_to_the_very_pose_that_they_are_in(
        lengths in [0.5..2.0f64, 0.5..2.0f64],
        shoulder in -3.0..3.0f64,
        elbow in prop_oneof![-2.5..-0.1f64, 0.1..2.5f64],
        turns in [-1000i32..1000, -1000i32..1000],
    ) {
        let pose = [shoulder, elbow];
        let DVec2 { x, y } = forward(&lengths, &pose).position;
        let present = [pose[0] + TAU * f64::from(turns[0]), pose[1] + TAU * f64::from(turns[1])];
        let q = nearest_turn(&solve(&lengths, &present, &at(x, y)).unwrap(), &present);
        // 1000 turns are 6e3 rad, whose last place is 1e-12; the pose is well away from every edge.
        prop_assert!((q[0] - present[0]).abs() < 1e-11 && (q[1] - present[1]).abs() < 1e-11);
    }
}

// ---------------------------------------------------------------------------------------------------------- the edges

/// Every place where a reach ends: lengths, a target exactly there, and the outward direction along it.
fn edges() -> Vec<(Vec<f64>, Target, DVec2)> {
    let mut edges = Vec::new();
    for scale in [1e-6, 1.0, 1e6] {
        for bearing in [0.0, 0.7, 2.0, -1.3, PI] {
            let along = DVec2::from_angle(bearing);
            let mut edge = |lengths: &[f64], distance: f64, outward: DVec2| {
                let lengths = lengths.iter().map(|l| l * scale).collect();
                let target = Target {
                    position: scale * distance * along,
                    orientation: None,
                };
                edges.push((lengths, target, outward));
            };
            edge(&[1.0, 1.0], 2.0, along);
            edge(&[2.0, 0.5], 2.5, along);
            edge(&[2.0, 0.5], 1.5, -along);
            edge(&[0.5, 2.0], 1.5, -along);
            edge(&[1.0, 0.5, 0.3], 1.8, along);
            edge(&[2.0, 0.5, 0.3], 1.2, -along);
            edge(&[0.3, 0.5, 2.0], 1.2, -along);
            // The wrist's edges, with the last link across.
            let across = bearing + FRAC_PI_2;
            for (lengths, wrist, outward) in [
                ([1.0, 0.5, 0.3], 1.5, along),
                ([1.0, 0.5, 0.3], 0.5, -along),
            ] {
                let position = scale * (wrist * along + 0.3 * DVec2::from_angle(across));
                let target = Target {
                    position,
                    orientation: Some(across),
                };
                edges.push((lengths.map(|l| l * scale).to_vec(), target, outward));
            }
        }
    }
    edges
}

fn solve_any(lengths: &[f64], target: &Target) -> Result<f64, Unreachable> {
    match *lengths {
        [l1, l2] => solve(&[l1, l2], &[0.3, -0.4], target).map(|q| miss(&[l1, l2], &q, target)),
        [l1, l2, l3] => {
            solve(&[l1, l2, l3], &[0.3, -0.4, 1.0], target).map(|q| miss(&[l1, l2, l3], &q, target))
        }
        _ => panic!("{} links", lengths.len()),
    }
}

#[test]
fn a_target_within_a_billionth_of_the_arm_outside_its_reach_is_solved_as_the_boundary() {
    for (lengths, edge, outward) in edges() {
        let sum: f64 = lengths.iter().sum();
        for share in [-1.0, -0.5, -1e-3, -1e-6, 0.0, 1e-6, 1e-3, 0.5, 0.999] {
            let moved = edge.position + share * BOUNDARY * sum * outward;
            let target = Target {
                position: moved,
                ..edge
            };
            let off = solve_any(&lengths, &target).unwrap_or_else(|e| panic!("{lengths:?}: {e}"));
            // The boundary itself: as far off as the target lies outside, and no farther.
            let outside = BOUNDARY * f64::max(share, 0.0);
            assert!(
                (off - outside).abs() <= 1e-15,
                "{lengths:?} {target:?} is {off:e} off"
            );
        }
    }
}

#[test]
fn a_target_farther_outside_is_refused() {
    for (lengths, edge, outward) in edges() {
        let sum: f64 = lengths.iter().sum();
        for share in [1.001, 2.0, 1e3, 1e6] {
            let moved = edge.position + share * BOUNDARY * sum * outward;
            let target = Target {
                position: moved,
                ..edge
            };
            assert!(
                solve_any(&lengths, &target).is_err(),
                "{lengths:?} {target:?}"
            );
        }
    }
}

#[test]
fn equal_links_folded_onto_the_base_keep_the_first_joint() {
    // Any first joint is right there; the one that does not move is the nearest.
    for first in [0.0, 0.4, -2.0, 3.0] {
        let q = solve(&[1.0, 1.0], &[first, 0.3], &at(0.0, 0.0)).unwrap();
        assert_eq!(q, [first, PI]);
    }
    let wound = solve(&[2.0, 2.0], &[0.5 + 10.0 * TAU, 0.3], &at(0.0, 0.0)).unwrap();
    assert!((wound[0] - 0.5).abs() < 1e-13);
    assert!(miss(&[2.0, 2.0], &wound, &at(0.0, 0.0)) < 1e-15);
    // So with a wrist on the base: the last link alone points at the target.
    let q = solve(&[1.0, 1.0, 0.5], &[0.4, 0.0, 0.0], &aimed(0.5, 0.0, 0.0)).unwrap();
    assert_eq!(q[..2], [0.4, PI]);
    assert!(miss(&[1.0, 1.0, 0.5], &q, &at(0.5, 0.0)) < 1e-15);
}

#[test]
fn targets_a_hair_from_the_base_keep_their_direction() {
    // Far below one rounding of the lengths nothing of the distance is left in the joints, but all of the bearing.
    for distance in [1e-17, 1e-100, 1e-300, 5e-324] {
        let q = solve(&[1.0, 1.0], &[0.0, 0.0], &at(0.0, distance)).unwrap();
        assert!(q[1].abs() > 3.0);
        assert!(
            ((q[0] + q[1] / 2.0) - FRAC_PI_2).abs() < 1e-15 || q[1] < 0.0,
            "{q:?}"
        );
        assert!(miss(&[1.0, 1.0], &q, &at(0.0, 0.0)) < 1e-15);
    }
}

#[test]
fn lengths_and_targets_at_the_ends_of_the_number_range_are_solved_or_refused() {
    for scale in [1e-300, 1e-200, 1e200, 1e300] {
        let two = [scale, scale];
        let target = at(scale, 0.5 * scale);
        assert!(miss(&two, &solve(&two, &[0.0; 2], &target).unwrap(), &target) < 1e-15);
        let three = [scale, 0.5 * scale, 0.25 * scale];
        assert!(miss(&three, &solve(&three, &[0.0; 3], &target).unwrap(), &target) < 1e-15);
        let aimed = aimed(scale, 0.5 * scale, 0.2);
        assert!(miss(&three, &solve(&three, &[0.0; 3], &aimed).unwrap(), &aimed) < 1e-15);
    }
    // A link that vanishes beside the other one still leaves the circle that the other one draws.
    for lengths in [
        [1e300, 1e-300],
        [1e-300, 1e300],
        [f64::MAX, 5e-324],
        [5e-324, f64::MAX],
    ] {
        let far = lengths[0].max(lengths[1]);
        let q = solve(&lengths, &[0.0; 2], &at(0.0, far)).unwrap();
        assert!((forward(&lengths, &q).position.y / far - 1.0).abs() < 1e-15);
    }
    assert!(solve(&[5e-324, 5e-324], &[0.0; 2], &at(0.0, 5e-324)).is_ok());
    assert!(solve(&[f64::MAX; 3], &[0.0; 3], &at(f64::MAX, f64::MAX)).is_ok());
    for huge in [1e300, f64::MAX] {
        for target in [at(huge, huge), at(-huge, 0.0), at(0.0, huge)] {
            assert!(matches!(
                solve(&[1.0, 1.0], &[0.0; 2], &target),
                Err(Unreachable::Beyond { .. })
            ));
            let aimed = Target {
                orientation: Some(1e300),
                ..target
            };
            for lengths in [[1.0; 3], [1e-300; 3]] {
                assert!(matches!(
                    solve(&lengths, &[0.0; 3], &aimed),
                    Err(Unreachable::Beyond { .. })
                ));
            }
        }
    }
}

// ------------------------------------------------------------------------------------------------- what is left open

#[test]
fn the_elbow_that_moves_the_joints_less_is_chosen() {
    let lengths = [1.0, 0.8];
    for bend in [0.2, 1.0, 2.9] {
        let DVec2 { x, y } = forward(&lengths, &[0.6, bend]).position;
        for present in [
            [0.6, bend],
            [0.9, 0.1],
            [-3.0, 2.0],
            [2.0, -0.4],
            [100.0, -7.0],
        ] {
            let chosen = solve(&lengths, &present, &at(x, y)).unwrap();
            // The other elbow mirrors the triangle about the target's bearing.
            let plus = [0.6, bend];
            let minus = [wrap(2.0 * y.atan2(x) - plus[0]), -bend];
            assert!(miss(&lengths, &minus, &at(x, y)) < 1e-15);
            let nearer = if cost(&plus, &present) < cost(&minus, &present) {
                plus
            } else {
                minus
            };
            assert!(
                (chosen[1] - nearer[1]).abs() < 1e-13,
                "{bend} {present:?}: {chosen:?}"
            );
            assert!(
                (chosen[0] - nearer[0]).abs() < 1e-13,
                "{bend} {present:?}: {chosen:?}"
            );
        }
    }
}

#[test]
fn two_elbows_equally_near_give_the_one_with_a_positive_second_joint() {
    // Straight along the target's bearing the two are mirror images; rounding must not decide between them.
    for bearing in [0.0, 0.1, 0.7, 1.9, -2.4, 3.0] {
        for distance in [0.01, 0.5, 1.3, 1.999] {
            let DVec2 { x, y } = distance * DVec2::from_angle(bearing);
            for turns in [0.0, 3.0] {
                let present = [bearing + TAU * turns, 0.0];
                let q = solve(&[1.0, 1.0], &present, &at(x, y)).unwrap();
                assert!(q[1] > 0.0, "{bearing} {distance}: {q:?}");
            }
        }
    }
}

#[test]
fn an_elbow_that_is_nearer_by_a_millionth_of_a_radian_is_not_taken_for_a_tie() {
    // Near full stretch the elbows differ by 2e-7 rad; squares of that are far below the rounding of a squared radian.
    let lengths = [1.0, 1.0];
    let pose = [0.3, -1e-7];
    let DVec2 { x, y } = forward(&lengths, &pose).position;
    let q = solve(&lengths, &pose, &at(x, y)).unwrap();
    assert!(q[1] < 0.0, "{q:?}");
}

/// Admissible headings by looking at each of many: how far the nearest one is from `present`.
fn scanned(lengths: &[f64; 3], target: DVec2, present: f64, samples: u32) -> Option<f64> {
    let [l1, l2, l3] = *lengths;
    let range = (l1 - l2).abs()..=l1 + l2;
    (0..samples)
        .map(|i| PI * f64::from(i) / f64::from(samples - 1))
        .find(|away| {
            [present + away, present - away]
                .iter()
                .any(|phi| range.contains(&(target - l3 * DVec2::from_angle(*phi)).length()))
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn the_orientation_is_the_admissible_one_nearest_to_the_present_one(
        lengths in [0.1..2.0f64, 0.1..2.0f64, 0.1..2.0f64],
        distance in 0.0..6.0f64,
        bearing in -PI..=PI,
        present in [-10.0..10.0f64, -10.0..10.0f64, -10.0..10.0f64],
    ) {
        const SAMPLES: u32 = 20_001;
        let position = distance * DVec2::from_angle(bearing);
        let along = heading(&present);
        let now = along.y.atan2(along.x);
        let found = solve(&lengths, &present, &at(position.x, position.y));
        let scanned = scanned(&lengths, position, now, SAMPLES);
        let Ok(q) = found else {
            prop_assert!(scanned.is_none(), "refused although {scanned:?} away is admissible");
            return Ok(());
        };
        let away = turn(now, forward(&lengths, &q).orientation).abs();
        // The scan may step over arcs narrower than its grain, so that what it finds is an upper bound; that the answer
        // is admissible at all is what the hand's place shows.
        if let Some(scanned) = scanned {
            prop_assert!(away <= scanned + 1e-12, "{away} although {scanned} would do");
            if scanned == 0.0 {
                prop_assert!(away <= 1e-14, "an admissible orientation is kept");
            }
        }
        prop_assert!(miss(&lengths, &q, &at(position.x, position.y)) <= INTERIOR);
    }
}

#[test]
fn a_present_orientation_at_the_very_edge_of_what_is_admissible_is_kept() {
    // Links 1 and 2 stretched or folded: the wrist is at an edge, and the hand is where it already is.
    for q2 in [0.0, PI] {
        for q3 in [0.4, -2.0, 1.5] {
            for wound in [0.0, 50.0] {
                let lengths = [1.0, 0.7, 0.5];
                let present = [0.9 + wound, q2, q3];
                let DVec2 { x, y } = forward(&lengths, &present).position;
                let q = nearest_turn(&solve(&lengths, &present, &at(x, y)).unwrap(), &present);
                let before = forward(&lengths, &present).orientation;
                assert!(
                    (forward(&lengths, &q).orientation - before).abs() < 1e-13,
                    "{q:?}"
                );
            }
        }
    }
}

#[test]
fn a_present_orientation_is_kept_to_the_last_digit_where_its_range_is_narrowest() {
    // Near full stretch the range of orientations is as narrow as the root of what is left of the reach: its ends,
    // though right to every digit of the distance, are good to 1e-8 rad only.
    for lengths in [[1.0, 0.7, 0.5], [1.0, 0.7, 2.5]] {
        for hair in [1e-7, 1e-8, 1e-9, 1e-12] {
            for present in [[0.3, 0.0, hair], [0.3, hair, 0.0], [-2.0, hair, -hair]] {
                let DVec2 { x, y } = forward(&lengths, &present).position;
                let q = solve(&lengths, &present, &at(x, y)).unwrap();
                let before = forward(&lengths, &present).orientation;
                let after = forward(&lengths, &q).orientation;
                assert!(turn(before, after).abs() < 1e-15, "{present:?}: {q:?}");
            }
        }
    }
    // And so it is near the hole in the middle, with everything folded.
    let lengths = [2.0, 0.5, 0.6];
    for hair in [1e-8, 1e-9, 1e-12] {
        for present in [
            [0.3, PI, PI - hair],
            [0.3, PI - hair, PI],
            [-2.0, PI - hair, hair - PI],
        ] {
            let DVec2 { x, y } = forward(&lengths, &present).position;
            let q = solve(&lengths, &present, &at(x, y)).unwrap();
            let before = forward(&lengths, &present).orientation;
            let after = forward(&lengths, &q).orientation;
            assert!(turn(before, after).abs() < 4e-15, "{present:?}: {q:?}");
        }
    }
}

#[test]
fn two_orientations_equally_near_give_the_counter_clockwise_one() {
    let lengths = [1.0, 0.5, 0.3];
    // Along the target's bearing the wrist would be too close, against it too far; either way two are as near.
    for (present, distance) in [([0.0, 0.0, 0.0], 0.5), ([0.0, 0.0, PI], 1.4)] {
        let q = solve(&lengths, &present, &at(distance, 0.0)).unwrap();
        let orientation = wrap(forward(&lengths, &q).orientation);
        assert!(orientation > 0.1 && orientation < PI - 0.1, "{orientation}");
    }
}

#[test]
fn with_the_target_on_the_base_all_orientations_are_admissible_or_none() {
    let present = [0.3, 1.0, -0.4];
    let q = solve(&[1.0, 0.8, 0.5], &present, &at(0.0, 0.0)).unwrap();
    assert!(turn(forward(&[1.0, 0.8, 0.5], &q).orientation, 0.9).abs() < 1e-15);
    assert!(miss(&[1.0, 0.8, 0.5], &q, &at(0.0, 0.0)) < 1e-15);
    assert!(matches!(
        solve(&[1.0, 0.8, 2.5], &present, &at(0.0, 0.0)),
        Err(Unreachable::TooClose { .. })
    ));
    // A hole so small that it counts as none.
    let hole = [1.0, 0.5, 1.5 + 1e-9];
    let q = solve(&hole, &present, &at(0.0, 0.0)).unwrap();
    assert!(turn(forward(&hole, &q).orientation, 0.9).abs() < 1e-15);
    assert!(miss(&hole, &q, &at(0.0, 0.0)) <= BOUNDARY);
}

#[test]
fn two_links_ignore_an_orientation_whatever_it_is() {
    let plain = solve(&[1.0, 1.0], &[0.0; 2], &at(1.0, 0.3)).unwrap();
    for phi in [0.0, 3.0, 1e300, f64::NAN, f64::INFINITY] {
        assert_eq!(
            solve(&[1.0, 1.0], &[0.0; 2], &aimed(1.0, 0.3, phi)),
            Ok(plain)
        );
    }
}

#[test]
fn a_wound_up_arm_is_not_unwound() {
    let lengths = [1.0, 1.0, 1.0];
    let present = [1e8, -1e8, 3e7];
    let q = solve(&lengths, &present, &at(1.2, 0.9)).unwrap();
    let commanded = nearest_turn(&q, &present);
    for (commanded, present) in commanded.iter().zip(&present) {
        assert!((commanded - present).abs() <= PI + 1.5e-8);
    }
    // An angle of 1e8 has a last place of 1.5e-8, and half of that may be lost at each of two joints.
    assert!(miss(&lengths, &commanded, &at(1.2, 0.9)) < 3e-8);
    // Within half a turn nothing is shifted, bit for bit; exactly half a turn away neither.
    assert_eq!(nearest_turn(&[0.1, PI], &[-2.0, 0.0]), [0.1, PI]);
    assert_eq!(nearest_turn(&[0.1], &[f64::NAN]), [0.1]);
}

#[test]
fn wrapping_takes_away_whole_turns_to_the_last_digit() {
    // (angle, angle - 2π k) for k = 2²⁴ and ±15,915,494, computed in 60 digits. k times a rounded 2π would be 4e-9 off.
    for (wound, expected) in [
        (105_414_357.066_578_27, -4.109_232_774_600_752e-9),
        (99_999_998.557_304_86, 0.499_999_993_665_391_44),
        (-100_000_000.557_304_86, -2.499_999_993_665_391_6),
    ] {
        assert!((wrap(wound) - expected).abs() <= f64::EPSILON * expected.abs());
    }
    for angle in [0.0, 1.0, -3.0, PI, (-PI).next_up(), 1e-300] {
        assert_eq!(wrap(angle), angle);
    }
    // Taken through its sine and cosine, every other one would come back with another last digit.
    for thousandth in -3141..=3141 {
        let angle = f64::from(thousandth) / 1000.0;
        assert_eq!(wrap(angle), angle);
    }
    assert_eq!(wrap(-PI), PI);
    // A rounded 3π is 9e-16 off a true one, on the side where half a turn stays positive.
    assert!((wrap(3.0 * PI).abs() - PI).abs() < 1e-15);
    assert!((wrap(-3.0 * PI).abs() - PI).abs() < 1e-15);
    for angle in [1e16, -1e300, f64::MAX] {
        assert!(wrap(angle).abs() <= PI);
    }
    assert_eq!(turn(1e8, 1e8 + 0.5), 0.5);
    assert!((turn(3.0, -3.0) - (TAU - 6.0)).abs() < 1e-15);
    assert!((turn(-3.0, 3.0) + (TAU - 6.0)).abs() < 1e-15);
}

// --------------------------------------------------------------------------------------------------------- refusals

fn refusal<const N: usize>(lengths: [f64; N], target: Target) -> String {
    solve(&lengths, &[0.0; N], &target).unwrap_err().to_string()
}

#[test]
fn a_refusal_says_which_limit_is_exceeded_and_by_which_numbers() {
    assert_eq!(
        refusal([1.0, 1.0], at(0.0, -3.2)),
        "target (0, -3.2) is 3.2 m from the base, beyond the arm's reach of 2 m"
    );
    assert_eq!(
        refusal([2.0, 0.5], at(0.25, 0.0)),
        "target (0.25, 0) is 0.25 m from the base, closer than the 1.5 m to which the arm can fold"
    );
    assert_eq!(
        refusal([1.0, 0.5, 4.0], at(0.0, 0.25)),
        "target (0, 0.25) is 0.25 m from the base, closer than the 2.5 m to which the arm can fold"
    );
    assert_eq!(
        refusal([1.0, 1.0, 1.0], aimed(1.5, 0.0, PI)),
        "phi = 3.141592653589793 puts the wrist 2.5 m from the base, beyond the reach of links 1 and 2, 2 m"
    );
    // Another size, in metres all the same.
    assert_eq!(
        refusal([4.0, 4.0, 4.0], aimed(6.0, 0.0, PI)),
        "phi = 3.141592653589793 puts the wrist 10 m from the base, beyond the reach of links 1 and 2, 8 m"
    );
    assert_eq!(
        refusal([2.0, 0.5, 1.0], aimed(2.0, 0.0, 0.0)),
        "phi = 0 puts the wrist 1 m from the base, closer than the 1.5 m to which links 1 and 2 can fold"
    );
    // Where no orientation would do, that is said, not which wrist this one would need.
    assert_eq!(
        refusal([1.0, 1.0, 1.0], aimed(1e300, 0.0, 0.5)),
        "target (1e300, 0) is 1e300 m from the base, beyond the arm's reach of 3 m"
    );
    assert_eq!(
        refusal([1e-6, 1e-6], at(0.0, 3e-6)),
        "target (0, 3e-6) is 3e-6 m from the base, beyond the arm's reach of 2e-6 m"
    );
}

#[test]
fn what_is_no_number_is_refused_by_name() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(refusal([1.0, 1.0], at(bad, 0.0)), "x must be finite");
        assert_eq!(refusal([1.0, 1.0], at(0.0, bad)), "y must be finite");
        assert_eq!(refusal([1.0; 3], at(0.0, bad)), "y must be finite");
        assert_eq!(
            refusal([1.0; 3], aimed(1.0, 0.0, bad)),
            "phi must be finite"
        );
    }
    // A present pose that is none is no obstacle.
    let q = solve(&[1.0; 3], &[f64::NAN, f64::INFINITY, 0.0], &at(1.0, 1.0)).unwrap();
    assert!(miss(&[1.0; 3], &q, &at(1.0, 1.0)) < 1e-15);
}

#[test]
fn other_numbers_of_links_have_no_closed_form() {
    assert_eq!(
        solve(&[1.0; 4], &[0.0; 4], &at(1.0, 0.0)),
        Err(Unreachable::Links(4))
    );
    assert_eq!(
        refusal([1.0], at(1.0, 0.0)),
        "inverse kinematics is solved for 2 or 3 links, not 1"
    );
}

#[test]
fn the_reach_of_an_arm_is_a_ring_or_a_disc() {
    assert_eq!(
        Reach::of(&[1.0, 1.0]),
        Reach {
            inner: 0.0,
            outer: 2.0
        }
    );
    assert_eq!(
        Reach::of(&[0.5, 2.0]),
        Reach {
            inner: 1.5,
            outer: 2.5
        }
    );
    assert_eq!(
        Reach::of(&[1.0, 4.0, 0.5]),
        Reach {
            inner: 2.5,
            outer: 5.5
        }
    );
    assert_eq!(
        Reach::of(&[1.0, 1.0, 1.0]),
        Reach {
            inner: 0.0,
            outer: 3.0
        }
    );
    assert_eq!(
        Reach::of(&[2.0]),
        Reach {
            inner: 2.0,
            outer: 2.0
        }
    );
}

//! The choice among several solutions.

use super::*;

#[test]
fn the_elbow_that_moves_the_joints_less_is_chosen() {
    let lengths = [1.0, 0.8];
    for bend in [0.2, 1.0, 2.9] {
        let DVec2 { x, y } = forward(&lengths, &[0.6, bend]).position;
        let others = [[0.9, 0.1], [-3.0, 2.0], [2.0, -0.4], [100.0, -7.0]];
        for present in others.into_iter().chain([[0.6, bend]]) {
            let chosen = solve(&lengths, &present, &at(x, y)).unwrap();
            // The other elbow mirrors the triangle about the target's bearing.
            let plus = [0.6, bend];
            let minus = [wrap(2.0 * y.atan2(x) - plus[0]), -bend];
            assert!(miss(&lengths, &minus, &at(x, y)) < 1e-15);
            let is_plus = cost(&plus, &present) < cost(&minus, &present);
            let nearer = if is_plus { plus } else { minus };
            for (chosen, nearer) in chosen.iter().zip(nearer) {
                assert!((chosen - nearer).abs() < 1e-13, "{bend} {present:?}");
            }
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
fn elbows_that_differ_by_a_millionth_of_a_radian_are_no_tie() {
    // Near full stretch the elbows differ by 2e-7 rad; squares of that are far below the rounding of a squared radian.
    let lengths = [1.0, 1.0];
    let pose = [0.3, -1e-7];
    let DVec2 { x, y } = forward(&lengths, &pose).position;
    let q = solve(&lengths, &pose, &at(x, y)).unwrap();
    assert!(q[1] < 0.0, "{q:?}");
}

/// Admissible headings by a scan: the distance of the nearest one from `present`.
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
        // The scan may miss arcs that are narrower than its step, so its distance is an upper bound. The place of the
        // end effector shows that the answer is admissible.
        if let Some(scanned) = scanned {
            prop_assert!(away <= scanned + 1e-12, "{away} although {scanned} would do");
            if scanned == 0.0 {
                prop_assert!(away <= 1e-14, "an admissible orientation is kept");
            }
        }
        prop_assert!(miss(&lengths, &q, &at(position.x, position.y)) <= INTERIOR);
    }
}

/// Near full stretch the width of the range of orientations is the root of the remaining reach. The distance is right to
/// the last digit, but the ends of the range only to 1e-8 rad. So it is near the hole in the middle, with everything
/// folded.
#[test]
fn a_present_orientation_is_kept_to_the_last_digit_where_its_range_is_narrowest() {
    let check = |lengths: [f64; 3], present: [f64; 3], tolerance: f64| {
        let DVec2 { x, y } = forward(&lengths, &present).position;
        let q = solve(&lengths, &present, &at(x, y)).unwrap();
        let before = forward(&lengths, &present).orientation;
        let after = forward(&lengths, &q).orientation;
        let kept = turn(before, after).abs() < tolerance;
        assert!(kept, "{lengths:?} {present:?}: {q:?}");
    };
    for hair in [1e-7, 1e-8, 1e-9, 1e-12] {
        for lengths in [[1.0, 0.7, 0.5], [1.0, 0.7, 2.5]] {
            for present in [[0.3, 0.0, hair], [0.3, hair, 0.0], [-2.0, hair, -hair]] {
                check(lengths, present, 1e-15);
            }
        }
    }
    for hair in [1e-8, 1e-9, 1e-12] {
        let (near, far) = (PI - hair, hair - PI);
        for present in [[0.3, PI, near], [0.3, near, PI], [-2.0, near, far]] {
            check([2.0, 0.5, 0.6], present, 4e-15);
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
    let (present, base) = ([0.3, 1.0, -0.4], at(0.0, 0.0));
    // The second has a hole so small that it counts as none.
    for (lengths, off) in [([1.0, 0.8, 0.5], 1e-15), ([1.0, 0.5, 1.5 + 1e-9], BOUNDARY)] {
        let q = solve(&lengths, &present, &base).unwrap();
        assert!(turn(forward(&lengths, &q).orientation, 0.9).abs() < 1e-15);
        assert!(miss(&lengths, &q, &base) <= off);
    }
    let refused = solve(&[1.0, 0.8, 2.5], &present, &base);
    assert!(matches!(refused, Err(Unreachable::TooClose { .. })));
}

/// `reach.rs` has the turns of an arm that is wound up.
#[test]
fn within_half_a_turn_no_angle_is_shifted() {
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

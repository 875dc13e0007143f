//! At the edges of the reach, and of numbers.

use super::*;

/// Around a target at an edge of the reach, towards outside.
fn check_edge<const N: usize>(
    scale: f64,
    lengths: [f64; N],
    (place, orientation): (DVec2, Option<f64>),
    outward: DVec2,
) {
    let lengths = lengths.map(|length| scale * length);
    let sum: f64 = lengths.iter().sum();
    let present = std::array::from_fn(|i| [0.3, -0.4, 1.0][i]);
    let off = |share: f64| {
        let position = scale * place + share * BOUNDARY * sum * outward;
        let target = Target {
            position,
            orientation,
        };
        solve(&lengths, &present, &target).map(|q| miss(&lengths, &q, &target))
    };
    for share in [-1.0, -0.5, -1e-3, -1e-6, 0.0, 1e-6, 1e-3, 0.5, 0.999] {
        let told = format!("{lengths:?} {place} {share}");
        let off = off(share).unwrap_or_else(|e| panic!("{told}: {e}"));
        // On the boundary: the error is the target's distance from it, and no more.
        let error = (off - BOUNDARY * f64::max(share, 0.0)).abs();
        assert!(error <= 1e-15, "{told}: {off:e} off");
    }
    for share in [1.001, 2.0, 1e3, 1e6] {
        assert!(off(share).is_err(), "{lengths:?} {place} {share}");
    }
}

#[test]
fn a_target_within_a_billionth_of_the_arm_outside_its_reach_is_the_boundary_and_beyond_refused() {
    for scale in [1e-6, 1.0, 1e6] {
        for bearing in [0.0, 0.7, 2.0, -1.3, PI] {
            let out = DVec2::from_angle(bearing);
            check_edge(scale, [1.0, 1.0], (2.0 * out, None), out);
            check_edge(scale, [2.0, 0.5], (2.5 * out, None), out);
            check_edge(scale, [2.0, 0.5], (1.5 * out, None), -out);
            check_edge(scale, [0.5, 2.0], (1.5 * out, None), -out);
            check_edge(scale, [1.0, 0.5, 0.3], (1.8 * out, None), out);
            check_edge(scale, [2.0, 0.5, 0.3], (1.2 * out, None), -out);
            check_edge(scale, [0.3, 0.5, 2.0], (1.2 * out, None), -out);
            // The wrist's edges, with the last link across.
            let across = bearing + FRAC_PI_2;
            let link = 0.3 * DVec2::from_angle(across);
            for (wrist, outward) in [(1.5 * out, out), (0.5 * out, -out)] {
                let place = (wrist + link, Some(across));
                check_edge(scale, [1.0, 0.5, 0.3], place, outward);
            }
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
        let off = (q[0] + q[1] / 2.0) - FRAC_PI_2;
        assert!(off.abs() < 1e-15 || q[1] < 0.0, "{q:?}");
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
    // With a link of negligible length, the reach is still the circle of the other link.
    for (long, short) in [(1e300, 1e-300), (f64::MAX, 5e-324)] {
        for lengths in [[long, short], [short, long]] {
            let q = solve(&lengths, &[0.0; 2], &at(0.0, long)).unwrap();
            assert!((forward(&lengths, &q).position.y / long - 1.0).abs() < 1e-15);
        }
    }
    assert!(solve(&[5e-324, 5e-324], &[0.0; 2], &at(0.0, 5e-324)).is_ok());
    assert!(solve(&[f64::MAX; 3], &[0.0; 3], &at(f64::MAX, f64::MAX)).is_ok());
    for huge in [1e300, f64::MAX] {
        for target in [at(huge, huge), at(-huge, 0.0), at(0.0, huge)] {
            let refused = solve(&[1.0, 1.0], &[0.0; 2], &target);
            assert!(matches!(refused, Err(Unreachable::Beyond { .. })));
            let aimed = aimed(target.position.x, target.position.y, 1e300);
            for lengths in [[1.0; 3], [1e-300; 3]] {
                let refused = solve(&lengths, &[0.0; 3], &aimed);
                assert!(matches!(refused, Err(Unreachable::Beyond { .. })));
            }
        }
    }
}

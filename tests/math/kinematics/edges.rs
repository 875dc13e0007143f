//! At the edges of the reach, and of numbers.

use super::*;

/// Every place where a reach ends: lengths, a target exactly there, and the outward direction along it.
fn edges() -> Vec<(Vec<f64>, Target, DVec2)> {
    let mut edges = Vec::new();
    for scale in [1e-6, 1.0, 1e6] {
        for bearing in [0.0, 0.7, 2.0, -1.3, PI] {
            let along = DVec2::from_angle(bearing);
            let mut edge = |lengths: &[f64], distance: f64, outward: DVec2| {
                let lengths = lengths.iter().map(|l| l * scale).collect();
                let DVec2 { x, y } = scale * distance * along;
                edges.push((lengths, at(x, y), outward));
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
                let DVec2 { x, y } = scale * (wrist * along + 0.3 * DVec2::from_angle(across));
                let lengths = lengths.map(|l| l * scale).to_vec();
                edges.push((lengths, aimed(x, y, across), outward));
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
fn a_target_within_a_billionth_of_the_arm_outside_its_reach_is_the_boundary_and_beyond_refused() {
    for (lengths, edge, outward) in edges() {
        let sum: f64 = lengths.iter().sum();
        let moved = |share: f64| Target {
            position: edge.position + share * BOUNDARY * sum * outward,
            ..edge
        };
        for share in [-1.0, -0.5, -1e-3, -1e-6, 0.0, 1e-6, 1e-3, 0.5, 0.999] {
            let off = solve_any(&lengths, &moved(share));
            let off = off.unwrap_or_else(|e| panic!("{lengths:?} {edge:?} {share}: {e}"));
            // On the boundary: the error is the target's distance from it, and no more.
            let error = (off - BOUNDARY * f64::max(share, 0.0)).abs();
            assert!(error <= 1e-15, "{lengths:?} {edge:?} {share}: {off:e} off");
        }
        for share in [1.001, 2.0, 1e3, 1e6] {
            let solved = solve_any(&lengths, &moved(share));
            assert!(solved.is_err(), "{lengths:?} {edge:?} {share}");
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

//! Forward and inverse, over the whole reach.

use super::*;

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

/// Joint angles: random ones, right angles, stretched, folded, and many turns.
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
    let told = format!("{lengths:?} {present:?} {target:?}");
    let q = solve(lengths, present, target).unwrap_or_else(|e| panic!("{told}: {e}"));
    assert_wrapped(&q);
    let off = miss(lengths, &q, target);
    assert!(off <= INTERIOR, "{told}: {q:?} is {off:e} off");
    if let (3, Some(phi)) = (N, target.orientation) {
        assert!(turn(forward(lengths, &q).orientation, phi).abs() <= 1e-14);
    }
    // The commanded joints are the same pose, within the resolution of an angle of many turns.
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
        // Whole turns of the requested orientation have no effect.
        check_round_trip(&lengths, &present, &aimed(x, y, phi - TAU));
    }

}

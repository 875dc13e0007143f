//! The sampling of targets.

use std::f64::consts::TAU;

use pendularm::math::kinematics::{Reach, Target, forward, solve};
use pendularm::math::trial::sample;
use proptest::prelude::*;

/// The place of a target in the reach, 0 at its inner edge and 1 at its outer.
fn share<const N: usize>(lengths: &[f64; N], target: &Target) -> f64 {
    let Reach { inner, outer } = Reach::of(lengths);
    (target.position.length() - inner) / (outer - inner)
}

fn check_samples<const N: usize>(lengths: [f64; N], seed: u64) {
    let mut rng = fastrand::Rng::with_seed(seed);
    for _ in 0..20 {
        let target = sample(&lengths, || rng.f64()).unwrap();
        assert_eq!(target.orientation.is_some(), N == 3);
        let q = solve(&lengths, &[0.5; N], &target).unwrap();
        let off = (forward(&lengths, &q).position - target.position).length();
        assert!(off <= 1e-14 * lengths.iter().sum::<f64>());
        // A reach far narrower than its distance can't be told apart from its edge by doubles.
        let Reach { inner, outer } = Reach::of(&lengths);
        if outer - inner > 1e-9 * outer {
            assert!(
                (0.049..0.951).contains(&share(&lengths, &target)),
                "{lengths:?}"
            );
        }
    }
}

proptest! {
    #[test]
    fn any_lengths_give_reachable_targets_away_from_the_edges(
        lengths in [-6.0..=6.0f64, -6.0..=6.0f64, -6.0..=6.0f64],
        seed: u64,
    ) {
        let [l1, l2, l3] = lengths.map(|exponent| 10f64.powf(exponent));
        check_samples([l1, l2], seed);
        check_samples([l1, l1], seed);
        check_samples([l1, l2, l3], seed);
    }
}

#[test]
fn targets_are_as_likely_everywhere_in_the_reachable_plane() {
    // Mean of the squared distance: half way between the squares of the edges, if area is what counts. Its standard
    // error over n draws is (b² - a²) / √(12 n). That of the mean bearing, and of the mean orientation, is 2π / √(12 n).
    // A deviation of five standard errors does not happen by chance, and the seed is fixed.
    const DRAWS: u32 = 40_000;
    // With a last link shorter than the margin every orientation is possible.
    let lengths = [1.0, 0.6, 0.01];
    let (least, greatest) = (0.39 + 0.05 * 1.22, 1.61 - 0.05 * 1.22);
    let mut rng = fastrand::Rng::with_seed(1);
    let (mut squares, mut bearings, mut orientations) = (0.0, 0.0, 0.0);
    for _ in 0..DRAWS {
        let target = sample(&lengths, || rng.f64()).unwrap();
        squares += target.position.length_squared() / f64::from(DRAWS);
        bearings += target.position.to_angle() / f64::from(DRAWS);
        orientations += target.orientation.unwrap() / f64::from(DRAWS);
    }
    let width = greatest * greatest - least * least;
    let error = (12.0 * f64::from(DRAWS)).sqrt().recip();
    let middle: f64 = 0.5 * (greatest * greatest + least * least);
    let off = (squares - middle).abs();
    assert!(off < 5.0 * width * error, "{squares} for {middle}");
    for mean in [bearings, orientations] {
        assert!(mean.abs() < 5.0 * TAU * error, "{mean}");
    }
}

#[test]
fn lengths_without_a_reachable_target_give_none() {
    let mut rng = fastrand::Rng::with_seed(7);
    // Their sum is beyond the number range, and so are the distances.
    assert_eq!(sample(&[f64::MAX, f64::MAX], || rng.f64()), None);
    assert!(sample(&[1e300, 1e300], || rng.f64()).is_some());
    assert!(sample(&[1e-300, 1e-300], || rng.f64()).is_some());
    // With a second link of negligible length the reach is a circle.
    assert!(sample(&[1.0, 1e-30], || rng.f64()).is_some());
}

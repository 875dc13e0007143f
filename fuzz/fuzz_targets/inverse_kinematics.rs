//! Inverse kinematics of any arm, from any pose, for any finite target.
//!
//! Asserted: a target is refused with a bounded sentence, or every joint is in (-π, π] and the end effector is where it was asked
//! for, to a billionth of the arm, orientation included; what lies clearly inside the reach is never refused, and what lies
//! clearly outside always.
//!
//! Input: the arm, its pose, the target, as numbers.

#![no_main]

use std::f64::consts::PI;

use arbitrary::Arbitrary;
use glam::{DVec2, dvec2};
use libfuzzer_sys::fuzz_target;
use pendularm::math::kinematics::{Target, nearest_turn, solve};
use pendularm_fuzz::limits::{DOING, hold};
use pendularm_fuzz::numbers::{Finite, Positive, finite, positive};

/// Error that the contract allows in a round trip, as a share of the sum of the lengths. A target that far outside the reach is
/// solved as the edge itself, so that this is the distance, and roundings come on top.
const ROUND_TRIP: f64 = 1e-9 + 1e-14;
/// Around the edge of the reach a billionth of the arm is either in or out; this is clear of it.
const CLEAR: f64 = 1e-8;

#[derive(Debug, Arbitrary)]
struct Input {
    has_three: bool,
    lengths: [Positive; 3],
    present: [Finite; 3],
    target: [Finite; 2],
    /// The target is given in multiples of the arm's length, where it can be reached.
    is_relative: bool,
    orientation: Option<Finite>,
}

fuzz_target!(|input: Input| hold(0, DOING, || examine(&input)));

fn examine(input: &Input) {
    let [l1, l2, l3] = positive(input.lengths);
    let [q1, q2, q3] = finite(input.present);
    if input.has_three {
        check(input, [l1, l2, l3], [q1, q2, q3]);
    } else {
        check(input, [l1, l2], [q1, q2]);
    }
}

fn check<const N: usize>(input: &Input, lengths: [f64; N], present: [f64; N]) {
    let longest = lengths.into_iter().fold(0.0, f64::max);
    let unit = if input.is_relative { longest } else { 1.0 };
    let [x, y] = finite(input.target).map(|share| share * unit);
    let target = Target {
        position: dvec2(x, y),
        orientation: input.orientation.map(|Finite(phi)| phi),
    };
    // Everything else here is in multiples of a power of two near the longest link, which rounds nothing that matters.
    let exponent = longest.log2().floor();
    let scaled = |length: f64| {
        length * (-exponent / 2.0).floor().exp2() * (-exponent - (-exponent / 2.0).floor()).exp2()
    };
    let place = dvec2(scaled(x), scaled(y));
    let small = lengths.map(scaled);
    match solve(&lengths, &present, &target) {
        Ok(q) => {
            let goal = target.orientation.filter(|_| N == 3);
            reached(&small, &q, place, goal);
            let turned = nearest_turn(&q, &present);
            for (turned, present) in turned.iter().zip(&present) {
                let off = (turned - present).abs();
                assert!(
                    off <= PI + f64::EPSILON * (4.0 + present.abs()),
                    "{turned} from {present}"
                );
            }
        }
        Err(error) => {
            assert!(
                !x.is_finite() || !y.is_finite() || !inside(&small, place, target.orientation),
                "{error}"
            );
            assert!(error.to_string().len() < 512, "{error}");
        }
    }
}

fn reached<const N: usize>(
    lengths: &[f64; N],
    q: &[f64; N],
    place: DVec2,
    orientation: Option<f64>,
) {
    assert!(q.iter().all(|q| -PI < *q && *q <= PI), "{q:?}");
    let arm: f64 = lengths.iter().sum();
    let mut hand = DVec2::ZERO;
    let mut heading = 0.0;
    for (length, angle) in lengths.iter().zip(q) {
        heading += angle;
        hand += *length * DVec2::from_angle(heading);
    }
    let off = (hand - place).length();
    assert!(off <= ROUND_TRIP * arm, "{q:?} is {off:e} off, of {arm}");
    if let Some(phi) = orientation {
        let wanted = DVec2::from_angle(phi);
        let off = (DVec2::from_angle(heading) - wanted).length();
        assert!(off <= ROUND_TRIP, "{q:?} turns the hand {off:e} off");
    }
}

/// Whether the target can clearly be reached.
fn inside<const N: usize>(lengths: &[f64; N], place: DVec2, orientation: Option<f64>) -> bool {
    let arm: f64 = lengths.iter().sum();
    let (place, links) = match (lengths.as_slice(), orientation) {
        ([l1, l2, l3], Some(phi)) => (place - *l3 * DVec2::from_angle(phi), vec![*l1, *l2]),
        (links, _) => (place, links.to_vec()),
    };
    let outer: f64 = links.iter().sum();
    let longest = links.into_iter().fold(0.0, f64::max);
    let inner = (2.0 * longest - outer).max(0.0);
    let distance = place.length();
    (inner + CLEAR * arm..=outer - CLEAR * arm).contains(&distance)
}

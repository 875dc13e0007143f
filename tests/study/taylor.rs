//! Arms followed to rounding and within a tolerance, against references of 50 digits and more.

use pendularm::math::arm::{Arm, State};
use pendularm::report::experiments::reference::{Law, ReferenceMotion};
use pendularm::study::taylor::{ROUNDING, TaylorReference};
use serde_json::Value;

use crate::reference::{motions, state};
use crate::stored::{arm, array, for_links, list, number, start};

fn size<const N: usize>(x: &[f64; N]) -> f64 {
    x.iter().map(|x| x.abs()).fold(0.0, f64::max)
}

fn difference<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    size(&std::array::from_fn::<f64, N, _>(|i| a[i] - b[i]))
}

fn check_stored<const N: usize>(case: &Value) -> f64 {
    let (arm, effort) = (arm::<N>(case), array(&case["tau"]));
    let mut follower = TaylorReference::new(start(case));
    let (mut before, mut worst) = (0.0, 0.0_f64);
    for (index, time) in list(&case["times"]).into_iter().enumerate() {
        assert!(follower.follow(&arm, &effort, time - before));
        before = time;
        let growth = number(&case["growth_max"][index]);
        let [q, v] = ["q", "qdot"].map(|name| array::<N>(&case[name][index]));
        let state = follower.state();
        let off = difference(&state.position, &q).max(difference(&state.velocity, &v));
        worst = worst.max(off / (f64::EPSILON * growth * size(&q).max(size(&v)).max(1.0)));
    }
    worst
}

/// To rounding: off by a unit or two in the last place of the state, times how far an error made on the way has grown.
/// 0.63 was seen.
#[test]
fn the_stored_motions_are_followed_to_rounding() {
    for case in motions() {
        let worst = for_links!(case, check_stored(&case));
        assert!(worst < 2.0, "{} {}: {worst}", case["name"], case["n"]);
    }
}

/// A random arm, its state, an effort, and a time in which it moves far.
fn any<const N: usize>(rng: &mut fastrand::Rng) -> (Arm<N>, State<N>, [f64; N], f64) {
    let mut size = || 10_f64.powf(rng.f64() - 0.5);
    let lengths: [f64; N] = std::array::from_fn(|_| size());
    let masses: [f64; N] = std::array::from_fn(|_| size());
    let slow = lengths.iter().copied().fold(f64::INFINITY, f64::min).sqrt();
    let mut around = |size: f64| size * (2.0 * rng.f64() - 1.0);
    let state = State {
        position: std::array::from_fn(|_| around(3.0)),
        velocity: std::array::from_fn(|_| around(2.0) / slow),
    };
    let effort = std::array::from_fn(|i| around(5.0) * masses[i] * lengths[i]);
    let arm = Arm::new(lengths, masses, 9.81).unwrap();
    (arm, state, effort, slow)
}

/// The largest growth of a change of each coordinate of the start.
fn growth<const N: usize>(
    arm: &Arm<N>,
    start: &State<N>,
    effort: &[f64; N],
    time: f64,
) -> [f64; 2] {
    const CHANGE: f64 = 1e-6;
    let end = |start: State<N>| {
        let mut follower = TaylorReference::new(start);
        assert!(follower.follow(arm, effort, time));
        follower.state().position
    };
    let unchanged = end(*start);
    let mut most = [1.0_f64; 2];
    for i in 0..N {
        let (mut moved, mut pushed) = (*start, *start);
        moved.position[i] += CHANGE;
        pushed.velocity[i] += CHANGE;
        most[0] = most[0].max(difference(&end(moved), &unchanged) / CHANGE);
        most[1] = most[1].max(difference(&end(pushed), &unchanged) / CHANGE);
    }
    most
}

fn check_tolerances<const N: usize>() -> f64 {
    let mut rng = fastrand::Rng::with_seed(13);
    let mut worst = 0.0_f64;
    for _ in 0..60 {
        let (arm, start, effort, time) = any::<N>(&mut rng);
        let mut exact = TaylorReference::new(start);
        let mut way = [0.0; 2];
        for _ in 0..64 {
            let before = *exact.state();
            assert!(exact.follow(&arm, &effort, time / 64.0));
            let State { position, velocity } = exact.state();
            way[0] += difference(position, &before.position);
            way[1] += difference(velocity, &before.velocity);
        }
        let growth = growth(&arm, &start, &effort, time);
        let mut work = u64::MAX;
        for tolerance in [1e-12, 1e-9, 1e-6, 1e-3] {
            let mut follower = TaylorReference::within(start, tolerance);
            assert!(follower.follow(&arm, &effort, time));
            let off = difference(&follower.state().position, &exact.state().position);
            worst = worst.max(off / (tolerance * (way[0] * growth[0] + way[1] * growth[1])));
            assert!(follower.coefficients() < work, "{tolerance:e}");
            work = follower.coefficients();
        }
    }
    worst
}

/// A step leaves out at most the tolerance times the way of positions and of velocities in it, which then grows. The
/// step is chosen by the last kept term, which is several times the omitted ones, and errors partly cancel: the largest
/// measured error is 0.07 of the bound. The test also fails if the result is three digits better than requested.
#[test]
fn an_asked_tolerance_is_kept() {
    for worst in [check_tolerances::<2>(), check_tolerances::<3>()] {
        assert!((1e-3..1.0).contains(&worst), "{worst}");
    }
}

/// Against twice the digits: the error, and the effect of a start at the next double.
fn beside_twice_the_digits<const N: usize>(arm: &Arm<N>, start: &State<N>, time: f64) -> [f64; 2] {
    let truth = ReferenceMotion::new(arm, start, &Law::FREE, time);
    let truth = state(&truth, time).position;
    let end = |start: State<N>| {
        let mut follower = TaylorReference::new(start);
        (0..16).for_each(|_| assert!(follower.follow(arm, &[0.0; N], time / 16.0)));
        follower.state().position
    };
    let mut beside = *start;
    beside.position = beside.position.map(f64::next_up);
    let found = end(*start);
    [difference(&found, &truth), difference(&found, &end(beside))]
}

/// Tips of a million and of a billion times the rest's mass, or of as small a part; lengths of a thousandth and of a
/// thousand. No motion can be known better than one that begins a unit in the last place beside it. The tolerance is a
/// hundred times that, for the units that every step adds, and for the loss of eliminating an uneven matrix.
#[test]
fn hostile_arms_are_followed_as_exactly_as_they_can_be_known() {
    let mut rng = fastrand::Rng::with_seed(5);
    for (tip, lengths) in [
        (1e6, [1.0, 1.0, 1.0]),
        (1e9, [1.0, 0.7, 1.3]),
        (1e-9, [1.0, 1.0, 1.0]),
        (1.0, [1e3, 1.0, 1.0]),
        (1.0, [1.0, 1e-3, 1.0]),
        (1e4, [1.0, 1.0, 1e-3]),
    ] {
        for _ in 0..4 {
            let arm = Arm::new(lengths, [1.0, 1.0, tip], 9.81).unwrap();
            let shortest = lengths.iter().copied().fold(f64::INFINITY, f64::min);
            let start = State {
                position: std::array::from_fn(|_| 6.0 * rng.f64() - 3.0),
                velocity: std::array::from_fn(|_| 2.0 * rng.f64() - 1.0),
            };
            let [off, inherent] = beside_twice_the_digits(&arm, &start, 0.3 * shortest.sqrt());
            let told = format!("{tip:e} {lengths:?}: {off:e}, inherent {inherent:e}");
            assert!(off <= 100.0 * inherent.max(f64::EPSILON), "{told}");
        }
    }
}

/// The arm is released at rest, stretched along the horizontal. Three coefficients in a row are zero between two that
/// are not. The series must not end there, and the step must not be chosen by them.
#[test]
fn an_arm_released_from_the_horizontal_is_followed_although_its_series_has_gaps() {
    for time in [1e-3, 0.01, 0.1, 0.5] {
        let arm = Arm::<3>::default();
        let [off, inherent] = beside_twice_the_digits(&arm, &State::rest(), time);
        assert!(off <= 10.0 * inherent.max(f64::EPSILON), "{time}: {off:e}");
        let mut rough = TaylorReference::within(State::rest(), 1e-6);
        assert!(rough.follow(&arm, &[0.0; 3], time));
        let mut exact = TaylorReference::new(State::rest());
        assert!(exact.follow(&arm, &[0.0; 3], time));
        let off = difference(&rough.state().position, &exact.state().position);
        // The tip of a falling arm turns by some radians in half a second.
        assert!(off < 1e-5, "{time}: {off:e}");
    }
}

/// A joint after a million turns is followed to the resolution of its angle: a double of 7e6 rad has digits to 1e-9.
#[test]
fn a_wound_up_joint_moves_as_any_other() {
    let arm = Arm::<2>::default();
    let wound = State {
        position: [4e6, -7e6],
        velocity: [1.0, 2.0],
    };
    let truth = ReferenceMotion::new(&arm, &wound, &Law::FREE, 0.5);
    let mut follower = TaylorReference::new(wound);
    assert!(follower.follow(&arm, &[0.0; 2], 0.5));
    let off = difference(&follower.state().velocity, &state(&truth, 0.5).velocity);
    assert!(off < 1e-8, "{off:e}");
}

/// Refused after bounded work: a spin of a billion turns in the span, and numbers that are not finite.
#[test]
fn a_motion_that_is_too_wild_is_refused_within_bounds() {
    let arm = Arm::<3>::default();
    for spin in [1e9, 1e200, f64::INFINITY, f64::NAN] {
        let mut follower = TaylorReference::new(State {
            position: [0.3, 0.2, 0.1],
            velocity: [spin, 1.0, -spin],
        });
        assert!(!follower.follow(&arm, &[0.0; 3], 1.0), "{spin}");
        assert!(follower.coefficients() < 21_000, "{spin}");
    }
    let mut rest = TaylorReference::within(State::<3>::at_rest([0.1; 3]), 0.0);
    let mut rounding = TaylorReference::within(State::<3>::at_rest([0.1; 3]), ROUNDING);
    assert!(rest.follow(&arm, &[1.0; 3], 0.1) && rounding.follow(&arm, &[1.0; 3], 0.1));
    assert_eq!(rest.state(), rounding.state());
}

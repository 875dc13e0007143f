//! The study's own reference motions against stored 70-digit ones.

use pendularm::math::arm::State;
use pendularm::report::experiments::reference::{DoubleDouble, Law, ReferenceMotion};
use serde_json::Value;

use crate::stored::{arm, array, entries, for_links, list, number, start};

pub(crate) fn motions() -> Vec<Value> {
    entries(include_str!("../data/trajectories.json"), "cases")
}

/// The state at `time` \[s\], rounded to doubles. The rate is a difference over a time so short that its square is below
/// rounding, of angles with 31 digits.
pub(crate) fn state<const N: usize>(reference: &ReferenceMotion<N>, time: f64) -> State<N> {
    const SHORT: f64 = 1e-9;
    let angles = |after: f64| reference.angles(DoubleDouble::from(time) + after);
    let (before, after) = (angles(-SHORT), angles(SHORT));
    State {
        position: angles(0.0).map(DoubleDouble::to_f64),
        velocity: std::array::from_fn(|i| (after[i] - before[i]).to_f64() / (2.0 * SHORT)),
    }
}

fn compare<const N: usize>(case: &Value) {
    let times = list(&case["times"]);
    let law = Law::Constant(array(&case["tau"]));
    let end = *times.last().unwrap();
    let reference = ReferenceMotion::<N>::new(&arm(case), &start(case), &law, end);
    for (index, time) in times.into_iter().enumerate() {
        let state = state(&reference, time);
        let at = |name: &str| array::<N>(&case[name][index]);
        let (q, v, acceleration) = (at("q"), at("qdot"), at("qddot"));
        let told = format!("{} {N} {index}", case["name"]);
        // Stored values are rounded to the nearest double, and so are ours. The times are rounded too, by up to an ulp:
        // times the rate, that is an error of the same size.
        for i in 0..N {
            let bound = |value: f64, rate: f64| {
                f64::EPSILON * (4.0 * value.abs().max(1.0) + 10.0 * rate.abs())
            };
            let q_off = (state.position[i] - q[i]).abs();
            let v_off = (state.velocity[i] - v[i]).abs();
            assert!(q_off <= bound(q[i], v[i]), "{told} {i}: {q_off:e}");
            assert!(
                v_off <= bound(v[i], acceleration[i]),
                "{told} {i}: {v_off:e}"
            );
        }
        // The stored sensitivity bounds what rounding at 106 bits can have done on the way.
        let (own, growth) = (
            reference.uncertainty(time),
            number(&case["growth_max"][index]),
        );
        assert!(own <= 1e-27 * growth, "{told}: {own:e}, growth {growth:e}");
    }
    assert!(reference.angle_error(end, &[f64::NAN; N]).is_nan());
}

#[test]
fn references_reproduce_the_stored_motions_to_the_last_bits() {
    for case in motions() {
        for_links!(case, compare(&case));
    }
}

#[test]
fn thirds_add_up_to_one_and_sine_and_cosine_keep_the_addition_theorem() {
    let one = DoubleDouble::from(1.0);
    let third = one / DoubleDouble::from(3.0);
    assert!((third + third + third - one).to_f64().abs() < 1e-31);
    // 1e3 rad costs about 1e3 times the last bit, 1e-32.
    for x in [0.0, 0.3, -1.7, 2.5, 10.0, -1000.0] {
        let (sin, cos) = DoubleDouble::from(x).sin_cos();
        let circle = sin * sin + cos * cos - one;
        assert!(circle.to_f64().abs() < 1e-31);
        let (twice_sin, _) = DoubleDouble::from(2.0 * x).sin_cos();
        let error = twice_sin - DoubleDouble::from(2.0) * sin * cos;
        assert!(error.to_f64().abs() < 1e-29, "{x}: {error:?}");
        assert!((sin.to_f64() - x.sin()).abs() < 1e-15);
        assert!((cos.to_f64() - x.cos()).abs() < 1e-15);
    }
}

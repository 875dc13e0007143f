//! The study's own reference motions against stored 70-digit ones.

pub(crate) use crate::json::numbers;
use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;
use pendularm::report::experiments::reference::{
    DoubleDouble, Law, ReferenceMotion, exact_steps, largest_difference,
};
use serde_json::Value;

pub(crate) fn stored() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/trajectories.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

pub(crate) fn array<const N: usize>(value: &Value) -> [f64; N] {
    numbers(value).try_into().unwrap()
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
    let name = &case["name"];
    let arm = Arm::new(
        array::<N>(&case["lengths"]),
        array(&case["masses"]),
        case["gravity"].as_f64().unwrap(),
    )
    .unwrap();
    let start = State {
        position: array(&case["q0"]),
        velocity: array(&case["qdot0"]),
    };
    let times = numbers(&case["times"]);
    let law = Law::Constant(array(&case["tau"]));
    let reference = ReferenceMotion::new(&arm, &start, &law, *times.last().unwrap());
    for (index, time) in times.into_iter().enumerate() {
        let state = state(&reference, time);
        let growth = case["growth_max"][index].as_f64().unwrap();
        // Stored values are rounded to the nearest double, and so are ours. The times are rounded too, by up to an ulp:
        // times the rate, that is an error of the same size.
        let (exact_q, exact_v) = (
            array::<N>(&case["q"][index]),
            array::<N>(&case["qdot"][index]),
        );
        let acceleration = array::<N>(&case["qddot"][index]);
        for i in 0..N {
            let ulps = |scale: f64| 4.0 * f64::EPSILON * scale.abs().max(1.0);
            let q = (state.position[i] - exact_q[i]).abs();
            let v = (state.velocity[i] - exact_v[i]).abs();
            let time = 10.0 * f64::EPSILON;
            let q_bound = ulps(exact_q[i]) + time * exact_v[i].abs();
            let v_bound = ulps(exact_v[i]) + time * acceleration[i].abs();
            assert!(q <= q_bound, "{name} {N} {index} {i}: {q:e} > {q_bound:e}");
            assert!(v <= v_bound, "{name} {N} {index} {i}: {v:e} > {v_bound:e}");
        }
        // The stored sensitivity bounds what rounding at 106 bits can have done on the way.
        let own = reference.uncertainty(time);
        assert!(
            own <= 1e-27 * growth,
            "{name} {N} {index}: {own:e}, growth {growth:e}"
        );
    }
}

#[test]
fn references_reproduce_the_stored_motions_to_the_last_bits() {
    let stored = stored();
    for case in stored["cases"].as_array().unwrap() {
        match case["n"].as_u64().unwrap() {
            2 => compare::<2>(case),
            3 => compare::<3>(case),
            n => panic!("no arm of {n} links here"),
        }
    }
}

const GAINS: Gains<2> = Gains {
    kp: [200.0, 100.0],
    ki: [0.0; 2],
    kd: [30.0, 12.0],
};

const SETPOINT: Setpoint<2> = Setpoint {
    position: [0.8, -0.6],
    velocity: [0.0; 2],
};

fn start() -> State<2> {
    State {
        position: [0.1, 0.2],
        velocity: [0.5, -0.3],
    }
}

/// The effort is of a linear spring and damper. Half the period of the hold halves the distance to the law at every
/// instant, because a held effort is on average half a period old.
#[test]
fn a_held_effort_approaches_the_continuous_law_at_first_order() {
    let arm = Arm::<2>::default();
    let continuous = Law::Continuous(GAINS, SETPOINT);
    let exact = ReferenceMotion::new(&arm, &start(), &continuous, 0.5);
    let distance = |period: f64| {
        let law = Law::Held {
            gains: GAINS,
            setpoint: SETPOINT,
            period,
        };
        let held = ReferenceMotion::new(&arm, &start(), &law, 0.5);
        exact.angle_error(0.5, &state(&held, 0.5).position)
    };
    let ratio = distance(1.0 / 512.0) / distance(1.0 / 1024.0);
    assert!((ratio - 2.0).abs() < 0.05, "{ratio}");
}

/// The steps of the live arm and the same steps with twice the digits differ by rounding alone: a few ulps in 128 steps.
#[test]
fn exact_steps_are_the_steps_of_the_live_arm_without_rounding() {
    let h = 1.0 / 256.0;
    for method in Method::ALL {
        for control in [false, true] {
            let mut live = Simulation::<2>::new(Arm::default(), GAINS);
            live.set_method(method);
            live.set_timestep(h);
            live.set_state(start());
            live.enable(control);
            live.set_setpoint(SETPOINT);
            live.advance(128);
            let law = if control {
                Law::Held {
                    gains: GAINS,
                    setpoint: SETPOINT,
                    period: h,
                }
            } else {
                Law::FREE
            };
            let exact = exact_steps(&Arm::default(), &start(), &law, method, h, 128, 1);
            let (q, v) = exact.first().unwrap();
            assert!(largest_difference(q, &live.state().position) < 1e-14);
            assert!(largest_difference(v, &live.state().velocity) < 1e-13);
        }
    }
}

/// The error of a reference must be far below the resolution of a double.
#[test]
fn a_reference_knows_far_more_digits_than_a_double() {
    let arm = Arm::<3>::default();
    let reference = ReferenceMotion::new(&arm, &State::rest(), &Law::FREE, 2.0);
    assert!(
        [0.5, 1.0, 1.5, 2.0]
            .into_iter()
            .all(|time| reference.uncertainty(time) < 1e-26)
    );
    assert!(reference.angle_error(0.5, &[f64::NAN; 3]).is_nan());
    assert_eq!(DoubleDouble::from(1.5).to_f64(), 1.5);
}

#[test]
fn thirds_add_up_to_one() {
    let one = DoubleDouble::from(1.0);
    let third = one / DoubleDouble::from(3.0);
    assert!((third + third + third - one).to_f64().abs() < 1e-31);
}

#[test]
fn sine_and_cosine_lie_on_the_unit_circle_and_keep_the_addition_theorem() {
    // 1e3 rad costs about 1e3 times the last bit, 1e-32.
    for x in [0.0, 0.3, -1.7, 2.5, 10.0, -1000.0] {
        let (sin, cos) = DoubleDouble::from(x).sin_cos();
        let circle = sin * sin + cos * cos - DoubleDouble::from(1.0);
        assert!(circle.to_f64().abs() < 1e-31);
        let (twice_sin, _) = DoubleDouble::from(2.0 * x).sin_cos();
        let error = twice_sin - DoubleDouble::from(2.0) * sin * cos;
        assert!(error.to_f64().abs() < 1e-29, "{x}: {error:?}");
        assert!((sin.to_f64() - x.sin()).abs() < 1e-15);
        assert!((cos.to_f64() - x.cos()).abs() < 1e-15);
    }
}

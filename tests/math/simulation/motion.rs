//! Motion against stored 50-digit references, and against a stepper of method and dynamics alone.

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::simulation::Simulation;
use serde_json::Value;

use super::{Offline, no_gains};
use crate::stored::{arm, array, entries, for_links, list, number, start};

#[test]
fn motion_shows_each_methods_truncation_error_and_nothing_else() {
    for case in entries(include_str!("../../data/trajectories.json"), "cases") {
        for_links!(case, check_motion(&case));
    }
}

/// A motion under constant efforts. A method without stored truncation errors is held to what halving its timestep makes
/// of its motion.
fn check_motion<const N: usize>(case: &Value) {
    let dt = number(&case["method_error_dt"]);
    for method in Method::ALL {
        let mut live = Simulation::new(arm(case), no_gains());
        live.set_method(method);
        live.set_timestep(dt);
        live.set_state(start(case));
        let stepper = |dt: f64| Offline::<N> {
            tau: array(&case["tau"]),
            ..Offline::new(arm(case), method, dt, start(case))
        };
        let (mut offline, mut finer) = (stepper(dt), stepper(0.5 * dt));
        let mut steps = 0;
        for (sample, time) in list(&case["times"]).into_iter().enumerate() {
            let more = (time / dt).round() as u64 - steps;
            steps += more;
            (0..more).for_each(|_| offline.step());
            (0..2 * more).for_each(|_| finer.step());
            let halved = Truncation::by_halving(method, &offline.state, &finer.state);
            let stored = case["method_error"].get(method.name());
            let stored = stored.map(|errors| Truncation::stored(array(&errors[sample])));
            for expected in stored.into_iter().chain([halved]) {
                check_sample(case, method, sample, &offline.state, &expected);
            }
            // The live arm has no effort but its controller's, which is off.
            if offline.tau == [0.0; N] {
                live.advance(more);
                assert_eq!(live.state(), &offline.state, "{} {method}", case["name"]);
            }
        }
    }
}

/// A live arm without gravity uses other formulas (`weightless_dynamics`). The offline one does not.
#[test]
fn without_gravity_an_arm_moves_by_the_same_bits() {
    fn check<const N: usize>() {
        let arm = Arm::<N>::new([0.7; N], [1.3; N], 0.0).unwrap();
        let start = State {
            position: std::array::from_fn(|i| 2.5 - 1.1 * i as f64),
            velocity: std::array::from_fn(|i| 3.0 - 4.0 * i as f64),
        };
        for method in Method::ALL {
            let mut live = Simulation::new(arm, no_gains());
            live.set_method(method);
            live.set_state(start);
            let mut offline = Offline::new(arm, method, live.timestep(), start);
            (0..5000).for_each(|_| offline.step());
            live.advance(5000);
            assert_eq!(live.state(), &offline.state, "{N} links, {method}");
        }
    }
    check::<2>();
    check::<3>();
}

/// The largest truncation error of a position and of a velocity, each with what it may be off by.
struct Truncation {
    q: [f64; 2],
    qd: [f64; 2],
}

impl Truncation {
    /// Three digits.
    fn stored([q, qd, _]: [f64; 3]) -> Self {
        Self {
            q: [q, 0.01 * q],
            qd: [qd, 0.01 * qd],
        }
    }

    /// Half the timestep leaves `2⁻ᵖ` of the error, as long as that is small: one of more than a thousandth says
    /// nothing. Where one of the two errors passes through zero, the next order is left of it: a share of the other.
    fn by_halving<const N: usize>(method: Method, whole: &State<N>, halves: &State<N>) -> Self {
        let share = 1.0 - 0.5_f64.powi(method.order() as i32);
        let error = |one: &[f64; N], other: &[f64; N]| apart(one, other) / share;
        let q = error(&whole.position, &halves.position);
        let qd = error(&whole.velocity, &halves.velocity);
        let larger = q.max(qd);
        let is_small = larger < 1e-3;
        let doubt = if is_small {
            0.2 * larger
        } else {
            f64::INFINITY
        };
        Self {
            q: [q, doubt],
            qd: [qd, doubt],
        }
    }
}

fn apart<const N: usize>(one: &[f64; N], other: &[f64; N]) -> f64 {
    let pairs = one.iter().zip(other);
    pairs.fold(0.0, |most, (one, other)| most.max((one - other).abs()))
}

/// The tolerance adds the effect of rounding, which no method can avoid: a unit in the last place, amplified as in the
/// oracle.
fn check_sample<const N: usize>(
    case: &Value,
    method: Method,
    sample: usize,
    state: &State<N>,
    expected: &Truncation,
) {
    let [q, qd] = ["q", "qdot"].map(|name| array::<N>(&case[name][sample]));
    let size = q
        .iter()
        .chain(&qd)
        .fold(1.0, |size: f64, x| size.max(x.abs()));
    let rounding = 1e-15 * number(&case["growth_max"][sample]) * size;
    for (name, got, want, [error, doubt]) in [
        ("q", &state.position, q, expected.q),
        ("qd", &state.velocity, qd, expected.qd),
    ] {
        let off = apart(got, &want);
        assert!(
            (off - error).abs() <= doubt + rounding,
            "{} n={N} {method} {name} at {} s: off by {off}, expected {error}",
            case["name"],
            case["times"][sample],
        );
    }
}

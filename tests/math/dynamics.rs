//! The equation of motion against 50-digit values, on ordinary and on extreme arms. Its properties: `dynamics_properties.rs`.

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::{
    coriolis, energy, forward_dynamics, gravity_load, inverse_dynamics, kinetic_energy,
    mass_matrix, potential_energy,
};
use serde_json::Value;

/// Half the distance from 1 to the next number: the relative error of one rounding.
const ROUND_OFF: f64 = f64::EPSILON / 2.0;

/// Runs a check that is generic in the number of links for 1 to 6 of them.
macro_rules! for_one_to_six_links {
    ($check:ident) => {
        $check::<1>();
        $check::<2>();
        $check::<3>();
        $check::<4>();
        $check::<5>();
        $check::<6>();
    };
}

// Stored values

/// One stored case: an arm in motion, and what is known about it.
struct Case<const N: usize> {
    arm: Arm<N>,
    q: [f64; N],
    qd: [f64; N],
    tau: [f64; N],
    stored: Value,
}

impl<const N: usize> Case<N> {
    fn new(stored: Value) -> Self {
        let array = |name: &str| numbers::<N>(&stored[name]);
        let gravity = stored["gravity"].as_f64().unwrap();
        let arm = Arm::new(array("lengths"), array("masses"), gravity).unwrap();
        Self {
            arm,
            q: array("q"),
            qd: array("qdot"),
            tau: array("tau"),
            stored,
        }
    }

    fn array(&self, name: &str) -> [f64; N] {
        numbers(&self.stored[name])
    }

    fn forward(&self) -> [f64; N] {
        forward_dynamics(&self.arm, &self.q, &self.qd, &self.tau)
    }

    /// Element by element: `sensitivity` is by how much the exact value changes, to first order, when every input is off by
    /// one rounding; `units` of that are allowed.
    fn check(&self, units: f64, got: &[f64], want: &Value, sensitivity: &Value) {
        let (want, sensitivity) = (list(want), list(sensitivity));
        assert_eq!((got.len(), got.len()), (want.len(), sensitivity.len()));
        for ((got, want), sensitivity) in got.iter().zip(&want).zip(&sensitivity) {
            let unit = ROUND_OFF * (sensitivity + want.abs()) + 1e-300;
            let off = (got - want).abs() / unit;
            assert!(
                off <= units,
                "{}: got {got}, want {want}, {off} units",
                self.stored["id"]
            );
        }
    }
}

/// A number, a list of numbers or a matrix, as one list.
fn list(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(values) => values.iter().flat_map(list).collect(),
        value => vec![value.as_f64().unwrap()],
    }
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    list(value).try_into().unwrap()
}

fn read<const N: usize>(text: &str) -> Vec<Case<N>> {
    let mut all: Value = serde_json::from_str(text).unwrap();
    let Value::Array(cases) = all["cases"].take() else {
        panic!("`cases` is not a list")
    };
    let of_n_links = cases.into_iter().filter(|case| case["n"] == N);
    of_n_links.map(Case::new).collect()
}

fn cases<const N: usize>() -> Vec<Case<N>> {
    let cases = read(include_str!("../data/dynamics.json"));
    assert!(cases.len() >= 38, "only {} cases of {N} links", cases.len());
    cases
}

// The units are the file's own suggestion: 16, and 32 for accelerations, where formulas of good quality stay below 8.

#[test]
fn the_mass_matrix_agrees_with_the_stored_values() {
    fn check<const N: usize>() {
        for case in &cases::<N>() {
            let got = mass_matrix(&case.arm, &case.q);
            case.check(
                16.0,
                got.as_flattened(),
                &case.stored["M"],
                &case.stored["sens_M"],
            );
        }
    }
    for_one_to_six_links!(check);
}

#[test]
fn the_coriolis_effort_agrees_with_the_stored_values() {
    fn check<const N: usize>() {
        for case in &cases::<N>() {
            let got = coriolis(&case.arm, &case.q, &case.qd);
            case.check(16.0, &got, &case.stored["h"], &case.stored["sens_h"]);
        }
    }
    for_one_to_six_links!(check);
}

#[test]
fn the_gravity_load_agrees_with_the_stored_values() {
    fn check<const N: usize>() {
        for case in &cases::<N>() {
            let got = gravity_load(&case.arm, &case.q);
            case.check(16.0, &got, &case.stored["G"], &case.stored["sens_G"]);
        }
    }
    for_one_to_six_links!(check);
}

#[test]
fn inverse_dynamics_agree_with_the_stored_values() {
    fn check<const N: usize>() {
        for case in &cases::<N>() {
            let got = inverse_dynamics(&case.arm, &case.q, &case.qd, &case.array("qddot_id"));
            case.check(
                16.0,
                &got,
                &case.stored["tau_id"],
                &case.stored["sens_tau_id"],
            );
        }
    }
    for_one_to_six_links!(check);
}

#[test]
fn the_energies_agree_with_the_stored_values() {
    fn check<const N: usize>() {
        for case in &cases::<N>() {
            let kinetic = kinetic_energy(&case.arm, &case.q, &case.qd);
            case.check(
                16.0,
                &[kinetic],
                &case.stored["kinetic"],
                &case.stored["sens_kinetic"],
            );
            let potential = potential_energy(&case.arm, &case.q);
            let (want, sensitivity) = (&case.stored["potential"], &case.stored["sens_potential"]);
            case.check(16.0, &[potential], want, sensitivity);
            let state = State {
                position: case.q,
                velocity: case.qd,
            };
            assert_eq!(
                energy(&case.arm, &state).to_bits(),
                (kinetic + potential).to_bits()
            );
        }
    }
    for_one_to_six_links!(check);
}

#[test]
fn forward_dynamics_agree_with_the_stored_values_element_by_element() {
    fn check<const N: usize>() {
        for case in &cases::<N>() {
            let (want, sensitivity) = (&case.stored["qddot"], &case.stored["sens_qddot_abs"]);
            case.check(32.0, &case.forward(), want, sensitivity);
        }
    }
    for_one_to_six_links!(check);
}

/// Digits lost: the logarithm of the relative error of the acceleration vector over one rounding.
fn digits_lost<const N: usize>(case: &Case<N>) -> f64 {
    let want = case.array("qddot");
    let largest = want.iter().fold(0.0, |m: f64, a| m.max(a.abs()));
    let pairs = case.forward().into_iter().zip(want);
    let error = pairs.fold(0.0, |m: f64, (got, want)| m.max((got - want).abs()));
    (error / largest / ROUND_OFF).log10()
}

/// Measured: 0.95. The exact answer itself moves by one to two digits when an angle is off by half its last bit. Sums of wound
/// angles would lose 8 (1e8 rad).
#[test]
fn forward_dynamics_lose_at_most_a_digit_and_a_half_on_any_stored_arm() {
    fn check<const N: usize>() {
        for case in &cases::<N>() {
            let lost = digits_lost(case);
            assert!(lost <= 1.5, "{}: {lost:.2} digits lost", case.stored["id"]);
        }
    }
    for_one_to_six_links!(check);
}

/// Measured: 1.17. Bent, stretched, nearly stretched (1e-6 rad) and folded, with an outermost link of up to 1e9 kg on links of 1 kg. A mass matrix in
/// joint angles loses 10 digits here, an ordinary articulated-body recursion 8.
#[test]
fn forward_dynamics_lose_at_most_a_digit_and_a_half_with_a_heavy_tip() {
    fn check<const N: usize>() {
        let cases = read::<N>(include_str!("../data/heavy_tips.json"));
        assert_eq!(cases.len(), 24);
        for case in &cases {
            let lost = digits_lost(case);
            assert!(lost <= 1.5, "{}: {lost:.2} digits lost", case.stored["id"]);
        }
    }
    check::<2>();
    check::<3>();
    check::<4>();
    check::<6>();
}

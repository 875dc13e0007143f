//! The equation of motion: every term against 50-digit values on ordinary and extreme arms.

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::{
    coriolis, energy, forward_dynamics, gravity_load, inverse_dynamics, kinetic_energy,
    mass_matrix, potential_energy, textbook, weightless_dynamics,
};
use serde_json::Value;

use crate::stored::{arm, array, entries, list};

/// Half the distance from 1 to the next number: the relative error of one rounding.
const ROUND_OFF: f64 = f64::EPSILON / 2.0;

const STORED: &str = include_str!("../data/dynamics.json");

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
        Self {
            arm: arm(&stored),
            q: array(&stored["q"]),
            qd: array(&stored["qdot"]),
            tau: array(&stored["tau"]),
            stored,
        }
    }

    fn forward(&self) -> [f64; N] {
        forward_dynamics(&self.arm, &self.q, &self.qd, &self.tau)
    }

    /// Element by element: `sensitivity` is the change of the exact value, to first order, if every input has an error
    /// of one rounding. `units` of it are allowed.
    fn check(&self, units: f64, got: &[f64], name: &str, sensitivity: &str) {
        let want = list(&self.stored[name]);
        let sensitivity = list(&self.stored[sensitivity]);
        assert_eq!((got.len(), got.len()), (want.len(), sensitivity.len()));
        for ((got, want), sensitivity) in got.iter().zip(&want).zip(&sensitivity) {
            let unit = ROUND_OFF * (sensitivity + want.abs()) + 1e-300;
            let off = (got - want).abs() / unit;
            let told = format!("{} {name}: got {got}", self.stored["id"]);
            assert!(off <= units, "{told}, want {want}, {off} units");
        }
    }
}

fn cases<const N: usize>(text: &str, at_least: usize) -> Vec<Case<N>> {
    let mut cases = entries(text, "cases");
    cases.retain(|case| case["n"] == N);
    assert!(
        cases.len() >= at_least,
        "{} cases of {N} links",
        cases.len()
    );
    cases.into_iter().map(Case::new).collect()
}

/// The units are the file's own suggestion: 16, and 32 for accelerations, where formulas of good quality stay below 8.
#[test]
fn every_term_of_the_equation_of_motion_agrees_with_the_stored_values() {
    fn check<const N: usize>() {
        for case in &cases::<N>(STORED, 26) {
            let Case { arm, q, qd, .. } = case;
            let (m, kinetic) = (mass_matrix(arm, q), kinetic_energy(arm, q, qd));
            let potential = potential_energy(arm, q);
            let inverse = inverse_dynamics(arm, q, qd, &array(&case.stored["qddot_id"]));
            for (name, sensitivity, units, got) in [
                ("M", "sens_M", 16.0, m.as_flattened()),
                ("h", "sens_h", 16.0, &coriolis(arm, q, qd)),
                ("G", "sens_G", 16.0, &gravity_load(arm, q)),
                ("tau_id", "sens_tau_id", 16.0, &inverse),
                ("kinetic", "sens_kinetic", 16.0, &[kinetic]),
                ("potential", "sens_potential", 16.0, &[potential]),
                ("qddot", "sens_qddot_abs", 32.0, &case.forward()),
            ] {
                case.check(units, got, name, sensitivity);
            }
            for (i, row) in m.iter().enumerate() {
                assert!((0..N).all(|j| row[j].to_bits() == m[j][i].to_bits()));
            }
            let state = State {
                position: *q,
                velocity: *qd,
            };
            assert_eq!(energy(arm, &state), kinetic + potential);
        }
    }
    check::<2>();
    check::<3>();
}

/// Digits lost: the logarithm of the relative error of the acceleration vector over one rounding.
fn digits_lost<const N: usize>(case: &Case<N>) -> f64 {
    let want = array::<N>(&case.stored["qddot"]);
    let pairs = case.forward().into_iter().zip(want);
    let error = pairs.fold(0.0, |m: f64, (got, want)| m.max((got - want).abs()));
    (error / largest(&want) / ROUND_OFF).log10()
}

/// Measured: 0.95, and 1.17 with heavy tips. An error of half the last bit of an angle costs the exact answer one to two
/// digits. Sums of wound angles would lose 8 (1e8 rad). The heavy tips are bent, stretched, nearly stretched (1e-6 rad)
/// and folded, with an outermost link of up to 1e9 kg on links of 1 kg. A mass matrix in joint angles loses 10 digits
/// there, an ordinary articulated-body recursion 8.
#[test]
fn forward_dynamics_lose_at_most_a_digit_and_a_half_on_any_stored_arm() {
    fn check<const N: usize>() {
        let heavy_tips = cases::<N>(include_str!("../data/heavy_tips.json"), 12);
        for case in cases::<N>(STORED, 26).iter().chain(&heavy_tips) {
            let lost = digits_lost(case);
            assert!(lost <= 1.5, "{}: {lost:.2} digits lost", case.stored["id"]);
        }
    }
    check::<2>();
    check::<3>();
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m: f64, value| m.max(value.abs()))
}

/// Both accelerations belong to the same effort. They may differ as far as M is ill-conditioned. On extreme
/// arms the book's line loses all digits.
fn assert_line_and_recursion_agree<const N: usize>(
    arm: &Arm<N>,
    [q, qd, tau]: [&[f64; N]; 3],
    case: &str,
) {
    let (m, book) = (mass_matrix(arm, q), textbook(arm, q, qd, tau));
    let recursion = forward_dynamics(arm, q, qd, tau);
    let effort = |qdd: &[f64; N]| m.map(|row| row.iter().zip(qdd).map(|(m, a)| m * a).sum());
    let (one, other): ([f64; N], [f64; N]) = (effort(&book), effort(&recursion));
    let scale = largest(m.as_flattened()) * largest(&recursion).max(largest(&book));
    let bound = 316.0 * ROUND_OFF * (N as f64 * scale + largest(tau));
    assert!(bound.is_finite(), "{case}: {book:?}");
    for (one, other) in one.iter().zip(other) {
        assert!((one - other).abs() <= bound, "{case}: {one} and {other}");
    }
}

#[test]
fn the_line_of_the_book_and_the_recursion_agree() {
    fn check<const N: usize>() {
        let mut cases = cases::<N>(STORED, 26);
        let is_ordinary = |size: f64| (0.1..10.0).contains(&size);
        cases.retain(|case| {
            let (lengths, masses) = (case.arm.lengths(), case.arm.masses());
            lengths.iter().chain(masses).all(|size| is_ordinary(*size))
                && largest(&case.q).max(largest(&case.qd)) < 10.0
        });
        assert!(cases.len() > 8, "{} ordinary cases", cases.len());
        for Case {
            arm,
            q,
            qd,
            tau,
            stored,
        } in &cases
        {
            assert_line_and_recursion_agree(arm, [q, qd, tau], &stored["id"].to_string());
        }
    }
    check::<2>();
    check::<3>();
}

/// The runtime has arms of 2 and 3 links, and the library any number.
#[test]
fn arms_of_other_numbers_of_links_agree_too() {
    fn check<const N: usize>() {
        let mut random = fastrand::Rng::with_seed(N as u64);
        for case in 0..100 {
            let mut numbers = |middle: f64, most: f64| {
                [(); N].map(|()| middle + most * (2.0 * random.f64() - 1.0))
            };
            let (lengths, masses) = (numbers(1.0, 0.5), numbers(1.0, 0.5));
            let arm = Arm::new(lengths, masses, 9.81).unwrap();
            let [q, qd, tau] = [3.0, 2.0, 5.0].map(|most| numbers(0.0, most));
            assert_line_and_recursion_agree(&arm, [&q, &qd, &tau], &case.to_string());
        }
    }
    check::<1>();
    check::<4>();
    check::<6>();
}

/// The first angle only sets the direction of gravity relative to the arm, so it may be left out.
#[test]
fn without_gravity_the_first_angle_changes_no_bit() {
    fn check<const N: usize>() {
        for mut case in cases::<N>(STORED, 26) {
            case.arm = case.arm.weightless();
            let less = weightless_dynamics(&case.arm, &case.q, &case.qd, &case.tau);
            for first in [case.q[0], 0.0, -2.5, 1e9] {
                case.q[0] = first;
                assert_eq!(case.forward().map(f64::to_bits), less.map(f64::to_bits));
            }
        }
    }
    check::<2>();
    check::<3>();
}

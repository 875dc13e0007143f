//! The equation of motion against 50-digit values and against independent routes to the same thing.

use pendularm::math::arm::Arm;
use pendularm::math::dynamics::{
    coriolis, forward_dynamics, gravity_load, inverse_dynamics, kinetic_energy, mass_matrix,
    potential_energy,
};
use serde_json::Value;

/// One stored case, its arrays at their length.
struct Case<const N: usize> {
    id: String,
    arm: Arm<N>,
    q: [f64; N],
    qd: [f64; N],
    tau: [f64; N],
    raw: Value,
}

impl<const N: usize> Case<N> {
    fn new(raw: Value) -> Self {
        let array = |name: &str| numbers::<N>(&raw[name]);
        let arm = Arm::new(
            array("lengths"),
            array("masses"),
            raw["gravity"].as_f64().unwrap(),
        )
        .unwrap();
        let id = raw["id"].as_str().unwrap().to_owned();
        Self {
            id,
            arm,
            q: array("q"),
            qd: array("qdot"),
            tau: array("tau"),
            raw,
        }
    }

    fn array(&self, name: &str) -> [f64; N] {
        numbers(&self.raw[name])
    }

    fn check(&self, name: &str, k: f64, got: f64, want: f64, sensitivity: f64) {
        let bound = k * ROUND_OFF * (sensitivity + want.abs()) + 1e-300;
        assert!(
            (got - want).abs() <= bound,
            "{} {name}: got {got}, want {want}, off by {} units of {k}",
            self.id,
            k * (got - want).abs() / bound,
        );
    }

    fn check_array(&self, name: &str, k: f64, got: &[f64; N], want: &str, sensitivity: &str) {
        let (want, sensitivity) = (self.array(want), self.array(sensitivity));
        for i in 0..N {
            self.check(name, k, got[i], want[i], sensitivity[i]);
        }
    }
}

/// Half the spacing of floating-point numbers at 1.
const ROUND_OFF: f64 = f64::EPSILON / 2.0;

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    let list = value.as_array().unwrap();
    assert_eq!(list.len(), N);
    std::array::from_fn(|i| list[i].as_f64().unwrap())
}

fn stored<const N: usize>() -> Vec<Case<N>> {
    let text = include_str!("data/dynamics.json");
    let mut all: Value = serde_json::from_str(text).unwrap();
    let Value::Array(cases) = all["cases"].take() else {
        panic!("no cases")
    };
    cases
        .into_iter()
        .filter(|case| case["n"] == N)
        .map(Case::new)
        .collect()
}

fn check_terms<const N: usize>() {
    let cases = stored::<N>();
    assert!(cases.len() >= 30, "{} cases of {N} links", cases.len());
    for case in &cases {
        let (arm, q, qd) = (&case.arm, &case.q, &case.qd);
        let m = mass_matrix(arm, q);
        for i in 0..N {
            let (want, sensitivity) = (
                numbers::<N>(&case.raw["M"][i]),
                numbers::<N>(&case.raw["sens_M"][i]),
            );
            for j in 0..N {
                case.check("M", 16.0, m[i][j], want[j], sensitivity[j]);
            }
        }
        case.check_array("C", 16.0, &coriolis(arm, q, qd), "h", "sens_h");
        case.check_array("G", 16.0, &gravity_load(arm, q), "G", "sens_G");
        let tau = inverse_dynamics(arm, q, qd, &case.array("qddot_id"));
        case.check_array("tau", 16.0, &tau, "tau_id", "sens_tau_id");
        let scalar = |name: &str| case.raw[name].as_f64().unwrap();
        let kinetic = kinetic_energy(arm, q, qd);
        case.check(
            "kinetic",
            16.0,
            kinetic,
            scalar("kinetic"),
            scalar("sens_kinetic"),
        );
        let potential = potential_energy(arm, q);
        case.check(
            "potential",
            16.0,
            potential,
            scalar("potential"),
            scalar("sens_potential"),
        );
        let qdd = forward_dynamics(arm, q, qd, &case.tau);
        case.check_array("qdd", 32.0, &qdd, "qddot", "sens_qddot_abs");
    }
}

#[test]
fn every_term_agrees_with_the_stored_values() {
    check_terms::<1>();
    check_terms::<2>();
    check_terms::<3>();
    check_terms::<4>();
    check_terms::<5>();
    check_terms::<6>();
}

fn digits_lost<const N: usize>() {
    for case in &stored::<N>() {
        let qdd = forward_dynamics(&case.arm, &case.q, &case.qd, &case.tau);
        let want = case.array("qddot");
        let scale = want.iter().fold(0.0_f64, |s, x| s.max(x.abs()));
        let err = (0..N).fold(0.0_f64, |s, i| s.max((qdd[i] - want[i]).abs())) / scale;
        println!("{:40} {:.2}", case.id, (err / ROUND_OFF).max(0.1).log10());
    }
}

#[test]
fn digits() {
    digits_lost::<1>();
    digits_lost::<2>();
    digits_lost::<3>();
    digits_lost::<4>();
    digits_lost::<5>();
    digits_lost::<6>();
}

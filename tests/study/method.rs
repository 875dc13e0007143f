//! A method by its tableau: published orders and intervals of textbook methods, misprints, and the order on the arm.

use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::method::{
    Analysis, Given, NAMES, Typed, amplification, analyse, measure, named,
};
use pendularm::study::paused::at_once;
use pendularm::study::stability::limit_held;
use pendularm::study::tableau::{Pair, Tableau, coefficient};

fn control() -> ControlLoop<2> {
    ControlLoop::new(Arm::default(), Gains::default(), Setpoint::at([0.0; 2]))
}

fn textbook(name: &str) -> Given {
    named(name).unwrap()
}

fn analysis(given: Given) -> Analysis {
    at_once(analyse(given, control()))
}

type Published = (&'static str, u32, Option<u32>, Option<f64>, Option<f64>);

/// Order, order of the embedded method, and the ends of stability on both axes.
///
/// Hairer and Wanner, *Solving Ordinary Differential Equations II*, ch. IV.2, has those of Taylor's polynomials:
/// 2, 2, 2.5127, 2.7853 and 0, 0, √3, √8. Dormand and Prince's method ends its polynomial with `z⁶/600`, so the end `y` on the
/// imaginary axis solves `9 y² - 8 - y⁴ + y⁶/25 = 0`. Semi-implicit Euler and Verlet are stable up to `ω h = 2`.
const PUBLISHED: [Published; 17] = [
    ("euler", 1, None, Some(2.0), Some(0.0)),
    ("midpoint", 2, None, Some(2.0), Some(0.0)),
    ("heun2", 2, None, Some(2.0), Some(0.0)),
    ("ralston2", 2, None, Some(2.0), Some(0.0)),
    ("kutta3", 3, None, Some(2.5127), Some(1.7321)),
    ("heun3", 3, None, Some(2.5127), Some(1.7321)),
    ("ralston3", 3, None, Some(2.5127), Some(1.7321)),
    ("ssprk3", 3, None, Some(2.5127), Some(1.7321)),
    ("bogacki_shampine3", 3, Some(2), Some(2.5127), Some(1.7321)),
    ("rk4", 4, None, Some(2.7853), Some(2.8284)),
    ("three_eighths", 4, None, Some(2.7853), Some(2.8284)),
    ("fehlberg4", 4, Some(5), None, None),
    ("cash_karp5", 5, Some(4), None, None),
    ("dormand_prince5", 5, Some(4), Some(3.3066), Some(0.9972)),
    ("butcher6", 6, None, None, None),
    ("semi_implicit", 1, None, Some(2.0), Some(2.0)),
    ("verlet", 2, None, Some(2.0), Some(2.0)),
];

#[test]
fn textbook_methods_have_their_published_orders_and_intervals() {
    assert_eq!(PUBLISHED.map(|it| it.0), NAMES);
    let mut far = Vec::new();
    for (name, order, embedded, real, imaginary) in PUBLISHED {
        let found = analysis(textbook(name));
        assert_eq!(
            (found.order, found.embedded_order),
            (order, embedded),
            "{name}"
        );
        assert_eq!(found.faults, [""; 0], "{name}");
        let is_pair = ["semi_implicit", "verlet"].contains(&name);
        assert_eq!(found.is_symplectic, is_pair, "{name}");
        for (published, limit) in [(real, found.real_limit), (imaginary, found.imaginary_limit)] {
            if let Some(published) = published {
                assert!(
                    (limit.unwrap() - published).abs() < 1e-4,
                    "{name}: {limit:?}, not {published}"
                );
            }
        }
        let measured = found.swing.order.unwrap();
        if (measured - f64::from(order)).abs() >= 0.1 {
            far.push((name, measured));
        }
    }
    assert_eq!(far, [], "measured on the arm");
}

/// Friction is a part of the arm on which the order is measured.
#[test]
fn a_method_has_its_order_on_an_arm_with_friction() {
    let arm = Arm::<2>::default().with_friction([0.8, 0.3]).unwrap();
    for (name, order) in [("heun3", 3.0), ("rk4", 4.0), ("dormand_prince5", 5.0)] {
        let measured = at_once(measure(textbook(name).pair(), &arm)).order.unwrap();
        assert!((measured - order).abs() < 0.1, "{name}: {measured}");
    }
}

fn rk4(change: impl Fn(&mut Vec<Vec<f64>>, &mut Vec<f64>)) -> Given {
    let mut a = vec![vec![], vec![0.5], vec![0.0, 0.5], vec![0.0, 0.0, 1.0]];
    let mut b = [1.0, 2.0, 2.0, 1.0].map(|it| it / 6.0).to_vec();
    change(&mut a, &mut b);
    let c = Some(vec![0.0, 0.5, 0.5, 1.0]);
    let typed = Typed {
        a,
        b,
        c,
        ..Typed::default()
    };
    Given::try_from(&typed).unwrap()
}

#[test]
fn misprints_are_named() {
    let whole = analysis(rk4(|_, _| ()));
    assert_eq!((whole.order, whole.faults), (4, vec![]));
    let weight = analysis(rk4(|_, b| b[3] = 0.0));
    assert_eq!(weight.faults, ["b sums to 5/6"]);
    assert_eq!(
        weight.failing.unwrap(),
        "order 1: the tree [] gives 5/6, not 1"
    );
    let row = analysis(rk4(|a, _| a[3][2] = 0.5));
    assert_eq!(row.faults, ["row 3 of a does not sum to c: 1/2, not 1"]);
    // Every sum is right, and only a tree shows the fault.
    let swapped = analysis(rk4(|a, _| a[2] = vec![0.5, 0.0]));
    assert_eq!((swapped.order, swapped.faults), (2, vec![]));
    assert_eq!(
        swapped.failing.unwrap(),
        "order 3: the tree [[[]]] gives 1/12, not 1/6"
    );
    assert!((swapped.swing.order.unwrap() - 2.0).abs() < 0.1);
}

#[test]
fn the_limit_on_the_arm_and_the_region_are_those_of_the_arms_own_methods() {
    let rk4 = analysis(rk4(|_, _| ()));
    let own = limit_held(&control().with_method(Method::Rk4)).unwrap();
    assert!(
        (rk4.timestep_limit_held.unwrap() / own - 1.0).abs() < 1e-6,
        "{rk4:?}, not {own}"
    );
    let pair = Pair::of(Method::Rk4);
    assert_eq!(at_once(measure(&pair, &control().arm)), rk4.swing);
    let z = 0.3_f64;
    let series = 1.0 - z + z * z / 2.0 - z.powi(3) / 6.0 + z.powi(4) / 24.0;
    assert!((amplification(&pair, -z, 0.0) - series).abs() < 1e-7);
    assert!((amplification(&pair, 0.0, 2.83) > 1.0) && amplification(&pair, 0.0, 2.82) < 1.0);
    let (inside, rows) = (
        rk4.region.rows.concat().matches('#').count(),
        rk4.region.rows.len(),
    );
    assert!(
        (100..rows * 48 / 2 + 300).contains(&inside),
        "{:#?}",
        rk4.region
    );
}

#[test]
fn a_coefficient_is_a_number_or_a_fraction() {
    for (text, value) in [
        ("1/3", 1.0 / 3.0),
        (" -2 / 3 ", -2.0 / 3.0),
        ("0.25", 0.25),
        ("0/5", 0.0),
    ] {
        assert_eq!(coefficient(text), Some(value), "{text}");
    }
    for text in [
        "1/0", "0/0", "", "/", "1/", "1/2/3", "inf", "1/inf", "nan", "1e999", "one",
    ] {
        assert_eq!(coefficient(text), None, "{text}");
    }
}

#[test]
fn a_bad_tableau_is_refused_with_its_row() {
    let refusal = |a: &[Vec<f64>], b: &[f64]| Tableau::new(a, b).unwrap_err().to_string();
    assert_eq!(
        refusal(&[vec![], vec![0.5, 0.5]], &[0.5, 0.5]),
        "row 1 of a is implicit: a[1][1] is 0.5, and only entries left of the diagonal may differ from 0"
    );
    let rows = vec![vec![0.0; 13]; 13];
    assert_eq!(
        refusal(&rows, &[1.0; 13]),
        "b must have 1 to 12 stages, got 13"
    );
    assert!(refusal(&[vec![]], &[f64::NAN]).starts_with("a coefficient must be between"));
    let euler = |c, b_hat| {
        let typed = Typed {
            a: vec![vec![]],
            b: vec![1.0],
            c,
            b_hat,
            positions: None,
        };
        Given::try_from(&typed).unwrap_err().to_string()
    };
    assert_eq!(
        euler(Some(vec![0.0, 1.0]), None),
        "c is wrong: c must have 1 entries, one for each stage, got 2"
    );
    let infinite = euler(None, Some(vec![f64::INFINITY]));
    assert!(infinite.starts_with("b_hat is wrong"), "{infinite}");
}

//! Refused targets, and their messages.

use super::*;

fn refusal<const N: usize>(lengths: [f64; N], target: Target) -> String {
    solve(&lengths, &[0.0; N], &target).unwrap_err().to_string()
}

#[test]
fn a_refusal_names_the_exceeded_limit_and_its_numbers() {
    assert_eq!(
        refusal([1.0, 1.0], at(0.0, -3.2)),
        "target (0, -3.2) is 3.2 m from the base, beyond the arm's reach of 2 m"
    );
    assert_eq!(
        refusal([2.0, 0.5], at(0.25, 0.0)),
        "target (0.25, 0) is 0.25 m from the base, closer than the 1.5 m to which the arm can fold"
    );
    assert_eq!(
        refusal([1.0, 0.5, 4.0], at(0.0, 0.25)),
        "target (0, 0.25) is 0.25 m from the base, closer than the 2.5 m to which the arm can fold"
    );
    assert_eq!(
        refusal([1.0, 1.0, 1.0], aimed(1.5, 0.0, PI)),
        "phi = 3.1416 puts the wrist 2.5 m from the base, beyond the reach of links 1 and 2, 2 m"
    );
    // Another size, also in metres.
    assert_eq!(
        refusal([4.0, 4.0, 4.0], aimed(6.0, 0.0, PI)),
        "phi = 3.1416 puts the wrist 10 m from the base, beyond the reach of links 1 and 2, 8 m"
    );
    assert_eq!(
        refusal([2.0, 0.5, 1.0], aimed(2.0, 0.0, 0.0)),
        "phi = 0 puts the wrist 1 m from the base, closer than the 1.5 m to which links 1 and 2 can fold"
    );
    // If no orientation is possible, the message says so, and names no wrist position.
    assert_eq!(
        refusal([1.0, 1.0, 1.0], aimed(1e300, 0.0, 0.5)),
        "target (1e300, 0) is 1e300 m from the base, beyond the arm's reach of 3 m"
    );
    assert_eq!(
        refusal([1e-6, 1e-6], at(0.0, 3e-6)),
        "target (0, 3e-6) is 3e-6 m from the base, beyond the arm's reach of 2e-6 m"
    );
}

#[test]
fn a_value_that_is_no_number_is_refused_by_name() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(refusal([1.0, 1.0], at(bad, 0.0)), "x must be finite");
        assert_eq!(refusal([1.0, 1.0], at(0.0, bad)), "y must be finite");
        assert_eq!(refusal([1.0; 3], at(0.0, bad)), "y must be finite");
        let phi = refusal([1.0; 3], aimed(1.0, 0.0, bad));
        assert_eq!(phi, "phi must be finite");
    }
    // A present pose that is not finite is allowed.
    let q = solve(&[1.0; 3], &[f64::NAN, f64::INFINITY, 0.0], &at(1.0, 1.0)).unwrap();
    assert!(miss(&[1.0; 3], &q, &at(1.0, 1.0)) < 1e-15);
}

#[test]
fn other_numbers_of_links_have_no_closed_form() {
    let four = solve(&[1.0; 4], &[0.0; 4], &at(1.0, 0.0));
    assert_eq!(four, Err(Unreachable::Links(4)));
    let one = refusal([1.0], at(1.0, 0.0));
    assert_eq!(one, "inverse kinematics is solved for 2 or 3 links, not 1");
}

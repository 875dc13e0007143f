//! Steps at once and one by one, and the sum of time.

use pendularm::math::integrator::Method;

use super::{moving, no_gains};

/// The law is not evaluated while the controller is off. No bit differs from a law with gains of zero.
#[test]
fn many_steps_at_once_are_the_same_bits_as_one_by_one_and_control_that_is_off_as_gains_of_zero() {
    for method in Method::ALL {
        for on in [false, true] {
            let mut at_once = moving(method);
            at_once.enable(on);
            let (mut one_by_one, mut zero) = (at_once.clone(), at_once.clone());
            assert_eq!(at_once.advance(1000), 1000);
            assert!((0..1000).all(|_| one_by_one.step()));
            assert_eq!(at_once, one_by_one, "{method}");
            if !on {
                zero.set_gains(no_gains());
                zero.enable(true);
                assert_eq!(zero.advance(1000), 1000);
                assert_eq!(at_once.state(), zero.state(), "{method}");
            }
        }
    }
}

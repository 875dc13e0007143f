//! The live arm against a stepper of method and dynamics alone, which `integrators.rs` and `dynamics.rs` compare with 50 digits.

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::simulation::Simulation;

use super::{Offline, no_gains};

/// A live arm without gravity uses other formulas (`weightless_dynamics`). The offline one does not.
#[test]
fn an_arm_that_is_left_alone_moves_by_the_same_bits() {
    fn check<const N: usize>(gravity: f64) {
        let arm = Arm::<N>::new([0.7; N], [1.3; N], gravity).unwrap();
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
    for gravity in [0.0, 9.81] {
        check::<2>(gravity);
        check::<3>(gravity);
    }
}

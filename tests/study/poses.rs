//! The smallest limit over all poses of arms whose limits are known. Random ones are in `properties`.

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::linear::Linear;
use pendularm::study::stability::{Limits, Sampling, largest_timestep, limit_held, limits};

use crate::stored::gains;

fn at_rest<const N: usize>(arm: &Arm<N>, gains: &Gains<N>, method: Method) -> Limits<N> {
    limits(&ControlLoop::new(*arm, *gains, Setpoint::default()).with_method(method))
}

/// Uneven and underdamped: with nine poses of the second joint the limit was 1.8 times too large.
#[test]
fn the_smallest_limit_of_an_uneven_arm_is_found_between_the_poses_of_the_grid() {
    let arm = Arm::new([2.6, 0.73], [0.8, 5.6], 0.0).unwrap();
    let gains = gains([30668.0, 726.0], [0.0; 2], [68.5, 8.89]);
    let found = at_rest(&arm, &gains, Method::Euler);
    let minimum = found.minimum_held.unwrap();
    let control = ControlLoop::new(arm, gains, Setpoint::default());
    let linear = Linear::at_pose(&control, &[0.0, 1.767]);
    let there = largest_timestep(&linear, Method::Euler, Sampling::Held).unwrap();
    let is_found = minimum <= there && minimum > 0.99 * there;
    assert!(is_found, "{minimum} {there}");
    assert!((minimum - 2.236e-3).abs() < 5e-6, "{minimum}");
    assert!(found.certified, "{found:?}");
    // At the advised timestep the arm settles in the worst pose, where it wandered off by half a radian.
    let pose = found.worst_pose.unwrap();
    let advised = ControlLoop::new(arm, gains, Setpoint::at(pose)).with_method(Method::Euler);
    let advised = advised.with_timestep(found.advised.unwrap());
    let mut live = advised.simulation(State::at_rest(pose.map(|q| q + 1e-3)));
    live.advance(20_000);
    let off = (0..2).map(|i| (live.state().position[i] - pose[i]).abs());
    assert!(off.fold(0.0, f64::max) < 1e-4);
}

#[test]
fn the_default_arms_are_proven_for_every_method() {
    for method in Method::ALL {
        let two = at_rest(&Arm::<2>::default(), &Gains::default(), method);
        let three = at_rest(&Arm::<3>::default(), &Gains::default(), method);
        assert!(two.certified && three.certified);
        assert!(two.bound.unwrap() > 0.003 && three.bound.unwrap() > 0.003);
        // Damping limits them: the outermost joint flips at every step.
        for critical in [two.critical.unwrap(), three.critical.unwrap()] {
            assert!(critical.growth_per_step > 1.0, "{critical:?}");
        }
        let flip = 0.5 / (1.1 * two.minimum_held.unwrap());
        assert!((two.critical.unwrap().frequency / flip - 1.0).abs() < 1e-9);
    }
}

/// With a fastest rate of 1e12/s, rounding makes slow modes seem to grow. Only one joint limits these loops: `kd h <
/// 2 / max (Kd½ M⁻¹ Kd½)`.
#[test]
fn limits_of_a_billionth_of_a_second_are_reported() {
    for kd in [1e9, 1e11, 1e13] {
        let gains = gains([100.0; 2], [0.0; 2], [20.0, kd]);
        let control = ControlLoop::new(Arm::<2>::default(), gains, Setpoint::default());
        let found = limits(&control);
        // Stretched, (M⁻¹)₂₂ = 96 / 7.
        let expected = 2.0 * 7.0 / 96.0 / kd;
        let ratio = found.held.unwrap() / expected;
        assert!((ratio - 1.0).abs() < 0.02, "{kd:e}: {ratio}");
        assert_eq!(limit_held(&control), found.held);
        assert!(found.certified, "{kd:e}: {found:?}");
    }
}

/// The loop runs away where an integral acts and springs are too soft, so there is no minimum, whichever setpoint is asked about.
#[test]
fn a_minimum_over_all_poses_does_not_depend_on_the_setpoint() {
    let gains = gains([15.0, 23.0], [0.49, 7.5], [1.6, 3.5]);
    let at = |setpoint| ControlLoop::new(Arm::<2>::default(), gains, Setpoint::at(setpoint));
    for setpoint in [[0.0, 0.0], [0.537, 0.9821], [-1.5, 0.2]] {
        let found = limits(&at(setpoint));
        assert_eq!(found.minimum_held, Some(0.0), "{setpoint:?}: {found:?}");
        assert!(!found.certified && found.bound.is_none(), "{found:?}");
    }
    let near = at([0.537, 0.9821]);
    assert!(limits(&near).advised.unwrap() < 2.76e-3);
}

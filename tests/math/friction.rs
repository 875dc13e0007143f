//! Viscous friction: its motion, its energy, and what stays without it.

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::{energy, friction_loss};
use pendularm::math::integrator::Method;
use pendularm::math::pid::Gains;
use pendularm::math::simulation::Simulation;

use crate::limits::rk4;

fn damped<const N: usize>(viscous: [f64; N], start: [f64; N]) -> Simulation<N>
where
    Arm<N>: Default,
    Gains<N>: Default,
{
    let arm = Arm::default().with_friction(viscous).unwrap();
    let mut simulation = Simulation::new(arm, Gains::default());
    simulation.set_state(State::at_rest(start));
    simulation
}

#[test]
fn a_damped_swing_is_that_of_a_plain_simulation() {
    let viscous = [0.8, 0.3];
    let mut ours = damped(viscous, [0.3, -0.4]);
    let mut plain = ([0.3, -0.4], [0.0; 2]);
    for step in 0..8000 {
        assert!(ours.step());
        plain = rk4(plain, [0.0; 2], viscous, 0.001);
        let State { position, velocity } = ours.state();
        for i in 0..2 {
            let off = (position[i] - plain.0[i])
                .abs()
                .max((velocity[i] - plain.1[i]).abs());
            assert!(off < 1e-9, "joint {i} at step {step}: {off}");
        }
    }
}

/// The energy with what friction took is constant up to the error of the method, which falls by the fourth power.
#[test]
fn friction_takes_the_energy_that_is_missing() {
    let missing = |timestep: f64| {
        let mut arm = damped([0.5, 0.2, 0.1], [0.3, 0.5, -0.7]);
        arm.set_timestep(timestep);
        let at_first = energy(arm.arm(), arm.state());
        let (mut taken, mut before) = (0.0, *arm.state());
        while arm.time() < 5.0 {
            assert!(arm.step());
            taken += friction_loss(arm.arm(), &before, arm.state(), timestep);
            before = *arm.state();
        }
        let now = energy(arm.arm(), arm.state());
        assert!(taken > 10.0, "{taken}");
        (at_first - now - taken).abs()
    };
    let (coarse, fine) = (missing(0.004), missing(0.002));
    assert!(fine < 1e-5, "{fine} J");
    assert!(coarse > 10.0 * fine, "{coarse} J, {fine} J");
}

/// Each method evaluates friction with the dynamics in every stage: its error has its order.
#[test]
fn every_method_keeps_its_order_with_friction() {
    for method in Method::ALL {
        let end = |steps: u64| {
            let mut arm = damped([0.8, 0.3], [0.3, -0.4]);
            arm.set_method(method);
            arm.set_timestep(1.0 / steps as f64);
            arm.advance(steps);
            arm.state().position
        };
        let [one, two, four] = [100, 200, 400].map(end);
        let apart = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
        let order = (apart(one, two) / apart(two, four)).log2();
        let least = f64::from(method.order()) - 0.2;
        assert!(order > least, "{method}: {order}");
    }
}

#[test]
fn without_friction_nothing_changes_and_a_bad_coefficient_is_named() {
    let arm = Arm::<3>::default();
    assert_eq!(arm.with_friction([-0.0; 3]).unwrap(), arm);
    assert_eq!(
        format!("{:?}", arm.with_friction([-0.0; 3]).unwrap()),
        format!("{arm:?}")
    );
    for (viscous, message) in [
        (
            [0.0, -1.0, 0.0],
            "viscous[1] must be finite and at least 0, got -1",
        ),
        (
            [0.0, 0.0, f64::NAN],
            "viscous[2] must be finite and at least 0, got NaN",
        ),
    ] {
        assert_eq!(arm.with_friction(viscous).unwrap_err().to_string(), message);
    }
}

//! The two clocks of a sampled loop: predicted limits against loops that are stepped, and the two errors of a run.

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::ControlPeriod;
use pendularm::study::clocks::clock_limits;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::motion::Motion;
use pendularm::study::paused::at_once;
use pendularm::study::rollout::{RolloutRequest, rollout};
use pendularm::study::stability::{limit_held, limits};

use crate::stored::gains;

fn control(period: f64, delay: u8) -> ControlLoop<2> {
    controlled(Gains::default(), [0.4, 0.8], period, delay)
}

fn controlled(gains: Gains<2>, setpoint: [f64; 2], period: f64, delay: u8) -> ControlLoop<2> {
    let control = ControlLoop::new(Arm::default(), gains, Setpoint::at(setpoint));
    control.with_period(ControlPeriod { period, delay })
}

/// Whether a small deviation dies out in a thousand periods, stepped as the live arm steps.
fn dies_out(control: &ControlLoop<2>) -> bool {
    let mut simulation = control.simulation(State::at_rest([0.4, 0.8]));
    // The integral takes up the load first, at a period that is stable.
    simulation.set_control_period(ControlPeriod {
        period: 1e-3,
        delay: 0,
    });
    simulation.set_timestep(1e-3);
    simulation.advance(20_000);
    simulation.set_timestep(control.timestep);
    simulation.set_control_period(control.period);
    let nudged = simulation.state().position.map(|q| q + 1e-6);
    simulation.set_state(State::at_rest(nudged));
    let steps = control.period.steps(control.timestep);
    simulation.advance(1000 * steps);
    let off = |i: usize| (simulation.state().position[i] - [0.4, 0.8][i]).abs();
    off(0).max(off(1)) < 1e-6
}

/// Computed with matrix exponentials. The last loop is so soft that its light link swings between two runs of the law.
#[test]
fn the_limit_of_the_control_period_is_that_of_exact_motion() {
    let weak = gains([30.0, 0.01], [0.0; 2], [30.0, 0.01]);
    let mut soft = controlled(weak, [0.0; 2], 0.01, 0);
    soft.arm = Arm::new([4.0, 0.1], [1.0; 2], 9.81).unwrap();
    let cases = [control(0.01, 0), control(0.01, 1), soft];
    let exact = [8.208519896e-3, 4.01389607e-3, 0.1496851889];
    for (control, exact) in cases.iter().zip(exact) {
        let limit = clock_limits(control).period.unwrap();
        assert!((limit / exact - 1.0).abs() < 1e-6, "{limit}: {exact}");
    }
}

#[test]
fn the_limit_of_the_timestep_is_the_longest_whole_part_of_the_period_that_is_stable() {
    for method in Method::ALL {
        for period in [2e-3, 5e-3, 7.5e-3, 8.1e-3] {
            let sampled = control(period, 0).with_method(method);
            let limit = clock_limits(&sampled).timestep.unwrap();
            if limit > period {
                assert_eq!(Some(limit), limit_held(&sampled));
                continue;
            }
            let steps = (period / limit).round();
            let longest = sampled.with_timestep(period / steps);
            assert!(dies_out(&longest), "{method} {period}");
            if steps > 1.0 {
                let longer = sampled.with_timestep(period / (steps - 1.0));
                assert!(!dies_out(&longer), "{method} {period}: {steps} steps");
            }
        }
        // Beyond the period's own limit no timestep helps.
        let beyond = control(9e-3, 0).with_method(method);
        assert_eq!(clock_limits(&beyond).timestep, Some(0.0));
    }
}

/// The default arm, whose setpoint has a shorter limit with a late effort than without.
#[test]
fn the_limits_over_all_poses_and_the_advice_include_a_late_effort() {
    let at = |delay| controlled(Gains::default(), [0.8, -0.6], 0.0, delay);
    let (prompt, late) = (limits(&at(0)), limits(&at(1)));
    assert!(late.held < prompt.held && late.minimum_held < prompt.minimum_held);
    assert!(late.minimum_held <= late.held && late.bound.is_none());
    assert_eq!(late.held, clock_limits(&at(1)).timestep);
    assert!(late.advised <= late.minimum_held.map(|least| 0.8 * least));
}

/// A loop whose integral makes it grow has no stable period, with a late effort as without.
#[test]
fn a_loop_that_its_integral_drives_has_no_stable_timestep() {
    let gains = gains([60.0, 30.0], [2000.0, 0.0], [25.0, 8.0]);
    for delay in [0, 1] {
        let found = clock_limits(&controlled(gains, [0.0; 2], 0.0, delay));
        assert_eq!([found.period, found.timestep], [Some(0.0); 2], "{delay}");
    }
}

/// A longer control period is not that of the limits over all poses.
#[test]
fn there_is_advice_for_a_control_period_up_to_it_alone() {
    let advised = |period: f64| {
        let control = controlled(Gains::default(), [0.0; 2], period, 0);
        limits(&control).advised_for(&Motion::ahead(&control, &State::rest()))
    };
    let every_step = advised(0.0).unwrap();
    assert_eq!(advised(every_step), Some(every_step));
    assert_eq!(advised(1.001 * every_step), None);
}

#[test]
fn at_one_control_period_a_shorter_timestep_lowers_the_methods_error_by_its_order_and_the_others_not()
 {
    let gains = gains([200.0, 100.0], [0.0; 2], [30.0, 12.0]);
    let errors = |method: Method, timestep: f64| {
        let control = controlled(gains, [0.8, -0.6], 0.01, 0).with_method(method);
        let request = RolloutRequest {
            control: control.with_timestep(timestep),
            start: State::rest(),
            duration: 2.0,
            samples: 101,
            reference: true,
        };
        let made = at_once(rollout(request)).unwrap();
        let method = made.deviation.unwrap().error;
        (method, made.from_ideal.unwrap().known().unwrap())
    };
    for method in Method::ALL {
        let (long, of_long) = errors(method, 5e-4);
        let (short, of_short) = errors(method, 2.5e-4);
        let off = (long / short).log2() - f64::from(method.order());
        assert!(off.abs() < 0.3, "{method}: {long} and {short}");
        assert!(of_short > 1e-2, "{of_short}");
        let is_same = (of_long / of_short - 1.0).abs() < 0.01;
        let told = format!("{method}: {of_long} and {of_short}");
        assert!(is_same || method == Method::Euler, "{told}");
    }
}

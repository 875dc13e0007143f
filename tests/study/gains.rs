//! Gains that are found, for arms that the default gains fail, and why some are not. Random arms are in `properties`.

use std::f64::consts::TAU;

use pendularm::math::arm::{Arm, State};
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::gains::{
    GainsError, GainsRequirements, GainsSearch, SETTLED, SuggestedGains,
};
use pendularm::study::stability::limits;

fn find<const N: usize>(
    control: &ControlLoop<N>,
    requirements: GainsRequirements,
) -> Result<SuggestedGains<N>, GainsError> {
    let mut search = GainsSearch::new(control, requirements)?;
    loop {
        if let Some(answer) = search.advance() {
            return answer;
        }
    }
}

/// When the arm was last off the setpoint, on a random move from rest that is watched for twice the time \[s\].
fn settles_after<const N: usize>(
    control: &ControlLoop<N>,
    rng: &mut fastrand::Rng,
    time: f64,
) -> f64 {
    let setpoint = Setpoint::at(std::array::from_fn(|_| TAU * (2.0 * rng.f64() - 1.0)));
    let moving = ControlLoop {
        setpoint,
        ..*control
    };
    let mut live = moving.simulation(State::rest());
    let mut off_at = 0.0;
    while live.time() < 2.0 * time {
        assert!(live.step(), "diverged: {moving:?}");
        if (0..N).any(|i| (live.state().position[i] - setpoint.position[i]).abs() > SETTLED) {
            off_at = live.time();
        }
    }
    off_at
}

/// The default gains never settle a heavy arm, and are unstable on a light one.
#[test]
fn arms_that_the_default_gains_fail_get_gains_of_their_own() {
    let requirements = GainsRequirements {
        settling_time: 4.0,
        margin: 1.25,
    };
    let mut rng = fastrand::Rng::with_seed(43);
    for (length, mass) in [(3.0, 50.0), (0.1, 0.05)] {
        let arm = Arm::<2>::new([length; 2], [mass; 2], 9.81).unwrap();
        let shipped = ControlLoop::new(arm, Gains::default(), Setpoint::default());
        let stable = limits(&shipped)
            .minimum_held
            .is_some_and(|least| least > shipped.timestep);
        assert!(
            !stable || settles_after(&shipped, &mut rng, 4.0) > 4.0,
            "{length} m"
        );
        let found = find(&shipped, requirements).unwrap();
        let control = ControlLoop {
            gains: found.gains,
            ..shipped
        };
        assert!(limits(&control).minimum_held.unwrap() >= 1.24e-3);
        assert!(settles_after(&control, &mut rng, 4.0) <= 4.0, "{length} m");
    }
}

#[test]
fn what_cannot_be_had_is_refused_with_its_reason() {
    let slow = ControlLoop::free(Arm::<2>::default()).with_timestep(0.5);
    let requirements = GainsRequirements {
        settling_time: 4.0,
        margin: 2.0,
    };
    let why = find(&slow, requirements).unwrap_err().to_string();
    assert!(
        why.contains("within 4 s") && why.contains("margin of 2"),
        "{why}"
    );
    let tiny = ControlLoop::free(Arm::<2>::default()).with_timestep(1e-6);
    let why = find(&tiny, requirements).unwrap_err();
    assert_eq!(why, GainsError::TooManySteps { steps: 4.0 / 1e-6 });
}

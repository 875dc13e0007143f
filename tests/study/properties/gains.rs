//! Suggested gains, on moves that their search has not simulated.

use std::f64::consts::TAU;

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::limits::{AntiWindup, Limits};
use pendularm::math::pid::Setpoint;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::gains::{GainsError, GainsRequirements, MOVES, SETTLED, search_gains};
use pendularm::study::paused::at_once;
use pendularm::study::stability::limits;

use super::{Dice, Tally, cases, property, run, tells};

/// The last time \[s\] in a move of this duration at which a joint is off the setpoint; `None` if the arm diverges.
fn off_until<const N: usize>(control: &ControlLoop<N>, duration: f64) -> Option<f64> {
    let mut live = control.simulation(State::rest());
    let mut off_at = 0.0;
    while live.time() < duration {
        if !live.step() {
            return None;
        }
        let off = |i: usize| (live.state().position[i] - control.setpoint.position[i]).abs();
        if (0..N).any(|i| off(i) > SETTLED) {
            off_at = live.time();
        }
    }
    Some(off_at)
}

/// Arms of 10 cm to 10 m and of 10 g to 100 kg a link. Suggested gains keep the margin, and settle on moves that the
/// search has not made.
fn suggested_gains_hold<const N: usize>(case: u64, tally: &mut Tally) {
    let mut dice = Dice::of(case);
    let (length, mass) = (dice.size(1.0), dice.size(1.7));
    let lengths = std::array::from_fn(|_| length * dice.size(0.2));
    let masses = std::array::from_fn(|_| mass * dice.size(0.3));
    let arm = Arm::<N>::new(lengths, masses, 9.81).unwrap();
    let method = Method::ALL[dice.0.usize(0..Method::ALL.len())];
    let free = ControlLoop::free(arm).with_method(method);
    let requirements = GainsRequirements {
        settling_time: 4.0,
        margin: 1.0 + dice.0.f64(),
    };
    let Ok(found) = at_once(search_gains(free, requirements)) else {
        tally.open += 1;
        return;
    };
    tally.tried += 1;
    let told = format!("case {case}: {free:?} {found:?} after {MOVES} moves");
    let control = ControlLoop {
        gains: found.gains,
        setpoint: Setpoint::at(std::array::from_fn(|_| TAU * dice.any())),
        ..free
    };
    assert!(found.settled_after <= requirements.settling_time, "{told}");
    let limits = limits(&control);
    let safe = limits.bound.or(limits.minimum_held).unwrap();
    let reached = 0.999 * requirements.margin * free.timestep..=1.001 * safe;
    assert!(reached.contains(&found.limit.unwrap()), "{told}: {safe}");
    // Ten moves represent all of them. Another one may take 1.5 times as long.
    let off_at = off_until(&control, 2.0 * requirements.settling_time);
    let off_at = off_at.unwrap_or_else(|| panic!("{told}: diverged"));
    assert!(
        off_at <= 1.5 * requirements.settling_time,
        "{told}: {off_at} s, {control:?}"
    );
}

#[test]
fn gains_for_random_arms_hold_on_other_moves() {
    tells(property!(suggested_gains_hold, 12, 2_000));
}

fn refusal(control: &ControlLoop<2>, requirements: GainsRequirements) -> GainsError {
    at_once(search_gains(*control, requirements)).unwrap_err()
}

#[test]
fn an_unavailable_resource_is_refused_with_its_reason() {
    let slow = ControlLoop::free(Arm::<2>::default()).with_timestep(0.5);
    let requirements = GainsRequirements {
        settling_time: 4.0,
        margin: 2.0,
    };
    let why = refusal(&slow, requirements).to_string();
    assert!(
        why.contains("within 4 s") && why.contains("margin of 2"),
        "{why}"
    );
    let tiny = ControlLoop::free(Arm::<2>::default()).with_timestep(1e-6);
    let why = refusal(&tiny, requirements);
    assert_eq!(why, GainsError::TooManySteps(4.0 / 1e-6));
}

/// How many of 20 moves within a turn are late under the limits of `control`.
fn late_moves(control: &ControlLoop<2>, settling_time: f64) -> usize {
    let mut dice = Dice::of(1);
    let is_late = |_: &u32| {
        let setpoint = Setpoint::at(std::array::from_fn(|_| TAU * dice.any()));
        let control = ControlLoop {
            setpoint,
            ..*control
        };
        off_until(&control, 2.0 * settling_time).is_none_or(|at| at > 1.5 * settling_time)
    };
    (0..20).filter(is_late).count()
}

/// The search makes its moves with motors of the given limit. With the default anti-windup none settles in time, and
/// the gains for ideal motors do not either. With another they settle, later than with ideal motors.
#[test]
fn gains_settle_under_an_effort_limit_or_are_refused_with_it() {
    let requirements = GainsRequirements {
        settling_time: 4.0,
        margin: 2.0,
    };
    let ideal = ControlLoop::free(Arm::<2>::default());
    let limited = |anti_windup| ControlLoop {
        limits: Limits {
            effort: Some([60.0, 20.0]),
            anti_windup,
            ..Limits::default()
        },
        ..ideal
    };
    let without = at_once(search_gains(ideal, requirements)).unwrap();
    let clamp = limited(AntiWindup::Clamp);
    let why = refusal(&clamp, requirements).to_string();
    assert!(
        why.contains("under the limits") && why.contains("limits.anti_windup"),
        "{why}"
    );
    let with_gains = |control: ControlLoop<2>, gains| ControlLoop { gains, ..control };
    assert!(late_moves(&with_gains(clamp, without.gains), 4.0) > 0);
    let conditional = limited(AntiWindup::Conditional);
    let with = at_once(search_gains(conditional, requirements)).unwrap();
    assert!(
        with.settled_after > 1.2 * without.settled_after,
        "{with:?} {without:?}"
    );
    assert_eq!(late_moves(&with_gains(conditional, with.gains), 4.0), 0);
}

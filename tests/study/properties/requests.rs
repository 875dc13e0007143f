//! Every computation of the study ends within a bound on its pieces, whatever numbers a request has.

use pendularm::math::arm::{Arm, State};
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::protocol::catalog::Service;
use pendularm::protocol::op::Arguments;
use pendularm::services::Ask;
use pendularm::services::study::{
    AnalyseMethod, Beside, Computed, PlanRun, PredictStability, Present, RunOffline, SuggestGains,
    Work as _,
};
use pendularm::study::control_loop::ControlLoop;
use serde_json::value::RawValue;
use serde_json::{Value, json};

use super::{Dice, Tally, cases, property, run};

/// Most pieces of a computation. A search over all poses of three links has some 10,000. A plan makes it for each of the
/// four methods, and a search of gains up to 144 times.
const MOST_PIECES: u64 = 4 * 12_000;
/// Five motions of 200 million coefficients, at 2000 in a piece.
const MOST_PIECES_OF_ROLLOUTS: u64 = 500_000;
const MOST_PIECES_OF_GAINS: u64 = 144 * 10_000;

/// Numbers at the ends of the range, in between, and those that are refused.
const SPECIAL: [&str; 18] = [
    "5e-324",
    "1e-320",
    "2.3e-308",
    "1e-300",
    "1e-154",
    "1e-30",
    "1e-12",
    "1e-3",
    "1",
    "1e3",
    "1e12",
    "1e30",
    "1e149",
    "1e300",
    "1.7976931348623157e308",
    "0",
    "-0.0",
    "1e999",
];

fn special(dice: &mut Dice) -> &'static str {
    SPECIAL[dice.0.usize(0..SPECIAL.len())]
}

/// A request with numbers of its own for some of its fields, as text: no type of JSON holds them all.
fn arguments<const N: usize>(dice: &mut Dice, service: Service, usual: &Value) -> String {
    let array = |dice: &mut Dice| {
        let one = dice.one_in(2).then(|| special(dice));
        let entries: Vec<_> = (0..N)
            .map(|_| one.unwrap_or_else(|| special(dice)))
            .collect();
        format!("[{}]", entries.join(","))
    };
    let mut members = Vec::new();
    let names = service.fields().iter().map(|field| field.name);
    for name in names {
        let is_changed = dice.one_in(3);
        let text = match (name, is_changed) {
            ("tableau", _) if is_changed || service == Service::Method => format!(
                r#"{{"a":[[],[{}]],"b":[{},{}]}}"#,
                special(dice),
                special(dice),
                special(dice)
            ),
            ("integrator", _) => format!(
                "\"{}\"",
                ["euler", "midpoint", "verlet", "rk4"][dice.0.usize(0..4)]
            ),
            ("controller" | "reference", _) => dice.0.bool().to_string(),
            ("delay", true) => dice.0.u8(0..=16).to_string(),
            ("limits", true) => format!(
                r#"{{"effort":{},"tracking_time":{}}}"#,
                array(dice),
                special(dice)
            ),
            ("sensors", true) => format!(
                r#"{{"encoder_step":{},"velocity":"{}","delay":{}}}"#,
                array(dice),
                ["exact", "difference"][dice.0.usize(0..2)],
                dice.0.u8(0..=16)
            ),
            ("samples", true) => "2".to_owned(),
            ("params", true) => format!(
                r#"{{"gravity":{},"masses":{},"lengths":{}}}"#,
                special(dice),
                array(dice),
                array(dice)
            ),
            ("gains", true) => format!(
                r#"{{"kp":{},"ki":{},"kd":{}}}"#,
                array(dice),
                array(dice),
                array(dice)
            ),
            ("q" | "qd" | "q0" | "qdot0" | "setpoint" | "viscous", true) => array(dice),
            (_, true) => special(dice).to_owned(),
            (name, false) => match usual.get(name) {
                Some(value) => value.to_string(),
                None => continue,
            },
        };
        members.push(format!("\"{name}\":{text}"));
    }
    format!("{{{}}}", members.join(","))
}

/// A moving arm.
fn present<const N: usize>() -> Present<N> {
    let setpoint = Setpoint::at([0.3; N]);
    Present {
        control: ControlLoop::new(Arm::default(), Gains::<N>::default(), setpoint),
        state: State {
            position: [0.2; N],
            velocity: [0.1; N],
        },
    }
}

/// The number of pieces of a computation; `None` if the request is refused.
fn pieces<const N: usize, T: Ask + Computed<N>>(service: Service, text: &str) -> Option<u64> {
    let raw = RawValue::from_string(text.to_owned()).unwrap();
    let ask = T::read(service, &Arguments::from(raw)).ok()?;
    let mut work = ask.work(present());
    let mut pieces = 1;
    let most = match service {
        Service::SuggestGains => MOST_PIECES_OF_GAINS,
        Service::Rollout => MOST_PIECES_OF_ROLLOUTS,
        _ => MOST_PIECES,
    };
    while work.advance(|| std::time::Duration::ZERO).is_none() {
        pieces += 1;
        assert!(pieces < most, "{} {text}", service.name());
    }
    Some(pieces)
}

fn any_request_ends<const N: usize>(case: u64, tally: &mut Tally) {
    let mut dice = Dice::of(case);
    let usual = json!({"error": 0.01, "duration": 0.05, "timestep": 0.01, "samples": 6, "settling_time": 8.0});
    // A search of gains takes as long as a hundred other requests.
    let service = match dice.0.u32(0..100) {
        0 => Service::SuggestGains,
        1..10 => Service::Stability,
        10..20 => Service::Method,
        20..40 => Service::Rollout,
        _ => Service::Plan,
    };
    let text = arguments::<N>(&mut dice, service, &usual);
    let ended = match service {
        Service::Stability => pieces::<N, PredictStability<N>>(service, &text),
        Service::Method => pieces::<N, AnalyseMethod<N>>(service, &text),
        Service::Rollout => pieces::<N, Beside<RunOffline<N>>>(service, &text),
        Service::Plan => pieces::<N, Beside<PlanRun<N>>>(service, &text),
        _ => pieces::<N, SuggestGains<N>>(service, &text),
    };
    match ended {
        Some(_) => tally.tried += 1,
        None => tally.open += 1,
    }
}

#[test]
fn every_request_of_the_study_ends() {
    let tally = property!(any_request_ends, 40, 100_000);
    assert!(tally.tried > tally.open / 8, "{tally:?}");
}

fn answer<T: Ask + Computed<2>>(service: Service, text: &str) -> T::Answer {
    let raw = RawValue::from_string(text.to_owned()).unwrap();
    let ask = T::read(service, &Arguments::from(raw)).unwrap();
    let mut work = ask.work(present());
    loop {
        if let Some(answer) = work.advance(|| std::time::Duration::ZERO) {
            return answer;
        }
    }
}

/// A late effort halves the limit, and a fast start shortens the timestep of the motion.
#[test]
fn a_prediction_is_about_the_delay_and_the_state_of_its_request() {
    let predicted = |text: &str| {
        let found = answer::<PredictStability<2>>(Service::Stability, text).unwrap();
        (found.limits.held.unwrap(), found.motion.speed)
    };
    let (at_once, still) = predicted("{}");
    for text in [r#"{"delay":true}"#, r#"{"delay":1}"#] {
        assert!(predicted(text).0 < 0.6 * at_once, "{text}");
    }
    let late = |delay: u8| predicted(&format!(r#"{{"delay":{delay}}}"#)).0;
    assert!(late(16) < 0.5 * late(3) && late(3) < 0.8 * late(1));
    assert_eq!(predicted(r#"{"delay":0}"#).0, at_once);
    assert!(predicted(r#"{"q":[0.3,40],"qd":[0,0]}"#).1 > 2.0 * still);
    let refused = RawValue::from_string(r#"{"delay":17}"#.to_owned()).unwrap();
    let refused = PredictStability::<2>::read(Service::Stability, &Arguments::from(refused));
    assert!(refused.unwrap_err().to_string().contains("delay"));
}

/// The present state by default, at rest where only a position is given, under both names.
#[test]
fn a_run_starts_in_the_state_of_its_request() {
    let started = |text: &str| {
        let ran = answer::<RunOffline<2>>(Service::Rollout, text).unwrap();
        (ran.run.positions[0], ran.run.velocities[0])
    };
    let own = present::<2>().state;
    for (text, expected) in [
        ("{}", (own.position, own.velocity)),
        (r#"{"q":[1,2]}"#, ([1.0, 2.0], [0.0; 2])),
        (r#"{"qd":[3,4]}"#, (own.position, [3.0, 4.0])),
        (r#"{"q0":[1,2],"qdot0":[3,4]}"#, ([1.0, 2.0], [3.0, 4.0])),
        (r#"{"q":[1,2],"q0":[5,6]}"#, ([1.0, 2.0], [0.0; 2])),
    ] {
        let mut ask: Value = serde_json::from_str(text).unwrap();
        ask["duration"] = json!(0.01);
        assert_eq!(started(&ask.to_string()), expected, "{text}");
    }
}

/// A clock that counts its readings: only the pieces of the steps alone are timed, however many samples there are.
#[test]
fn the_time_of_a_run_is_that_of_its_steps() {
    use std::cell::Cell;
    use std::time::Duration;
    thread_local!(static READ: Cell<u64> = const { Cell::new(0) });
    fn clock() -> Duration {
        Duration::from_secs(READ.replace(READ.get() + 1))
    }
    let took = |samples: u64| {
        let text =
            format!(r#"{{"duration":10,"timestep":0.001,"samples":{samples},"reference":true}}"#);
        let raw = RawValue::from_string(text).unwrap();
        let ask = RunOffline::<2>::read(Service::Rollout, &Arguments::from(raw)).unwrap();
        let mut work = ask.work(present());
        loop {
            if let Some(answer) = work.advance(clock) {
                let ran = answer.unwrap();
                assert_eq!(ran.run.times.len() as u64, samples);
                return ran.took;
            }
        }
    };
    assert_eq!(took(1001), took(2));
}

/// Found by hand: a period of no length, and one beyond every duration.
#[test]
fn a_plan_with_a_period_that_cannot_be_counted_is_refused() {
    for text in [
        r#"{"error":0.1,"controller":true,"control_period":5e-324}"#,
        r#"{"error":0.1,"duration":5e-324,"controller":true,"control_period":5e-324}"#,
        r#"{"error":0.1,"gains":{"kp":[1e-300,1e-300]},"params":{"gravity":0},"control_period":1e149}"#,
    ] {
        assert!(
            pieces::<2, Beside<PlanRun<2>>>(Service::Plan, text).unwrap() < 1000,
            "{text}"
        );
    }
}

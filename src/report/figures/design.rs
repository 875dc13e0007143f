//! A controller designed for its period, beside the sampled PID.
//!
//! **Invariant:** every mark is a run of the arm itself; only the limits are of its linearisation.

use super::fit::edges;
use crate::math::count::length_in_f64;
use crate::report::experiments::design::{
    DURATION, Feedback, SHORT, designed, limit, limit_of_pid, returned,
};
use crate::report::section::Section;
use crate::report::svg::{Axis, Curve, Key, Marker, Plot, Unit, number, seconds};
use crate::study::stability::bisect;

/// Ends of the axis of control periods \[s\], and the period of the motions that are drawn.
const PERIODS: (f64, f64) = (1e-3, 0.2);
const DRAWN: f64 = 0.01;

/// The end of the axis of deviations, and of a motion that exceeds it \[rad\].
const SHOWN: f64 = 0.5;

/// Halvings of these ends for a limit, to one part in a thousand.
const HALVINGS: u32 = 12;

/// A deviation beyond this part of the least one is no longer about the same \[rad\].
const SAME: f64 = 1.1;

/// Gains for a period \[s\], where there are some; none of them for the PID.
type Design<'a> = Box<dyn Fn(f64) -> Option<Option<Feedback>> + 'a>;

fn designs(continuous: &Feedback) -> [(Key, Design<'_>); 3] {
    [
        (
            Key::line("c2", "sampled PID, default gains").marked(Marker::Square),
            Box::new(|_| Some(None)),
        ),
        (
            Key::line("c3", "LQR for continuous time, sampled").marked(Marker::Triangle),
            Box::new(|_| Some(Some(continuous.clone()))),
        ),
        (
            Key::line("c1", "LQR for its period").marked(Marker::Diamond),
            Box::new(|period| designed(period).map(Some)),
        ),
    ]
}

pub(super) fn make(section: &mut Section) {
    let Some(continuous) = designed(SHORT) else {
        return;
    };
    let periods = edges(PERIODS, section.choose(24, 8));
    let designs = designs(&continuous);
    let mut deviations = Plot::new(
        "Deviation by control period",
        Axis::log("control period", Unit::Seconds, PERIODS),
        Axis::log(
            "root mean square deviation [rad]",
            Unit::Number,
            (1e-2, 1e2),
        ),
    );
    let mut motions = Plot::new(
        format!("Joint 1 at a control period of {}", seconds(DRAWN)),
        Axis::linear("time [s]", (0.0, DURATION)),
        Axis::linear("deviation of joint 1 [rad]", (-SHOWN, SHOWN)),
    );
    let mut longest = f64::NAN;
    for (key, gains) in designs {
        let run = |period: f64| match gains(period) {
            Some(gains) => returned(period, gains.as_ref()),
            None => (Vec::new(), f64::INFINITY),
        };
        let points: Vec<(f64, f64)> = periods.iter().map(|it| (*it, run(*it).1)).collect();
        // The last design's value remains.
        let least = points.iter().map(|it| it.1).fold(f64::INFINITY, f64::min);
        longest = bisect(PERIODS, HALVINGS, |period| run(period).1 <= SAME * least);
        deviations.add(Curve::line(key.clone(), points));
        let samples = run(DRAWN).0;
        let inside = samples.into_iter().take_while(|it| it.1.abs() <= SHOWN);
        motions.add(Curve::line(key, inside));
    }
    let pid = limit_of_pid().unwrap_or(f64::NAN);
    section.findings.push(format!(
        "**A controller designed for its period keeps its deviation within {} % of the least up to a control period of {}, \
         where the default PID is stable up to {}**. The motion is a return of 2 links over 0.2 rad to (0.4, 0.8) in {DURATION} \
         s. The design is LQR for the arm linearised at the setpoint under efforts held for the period, with the squares of \
         the default gains as weights. The same design for continuous time is stable up to {}.",
        number((100.0 * (SAME - 1.0)).round()),
        seconds(longest),
        seconds(pid),
        seconds(limit(&continuous)),
    ));
    section.claim(
        "The design for its period holds the arm at least twice as long a period as the sampled PID",
        format!("{} and {}", seconds(longest), seconds(pid)),
        longest >= 2.0 * pid,
    );
    section.figure(
        "design",
        "What a design for the control period gains",
        &format!(
            "2 links of 1 m and 1 kg return from (0.6, 0.6) at rest to (0.4, 0.8) in {DURATION} s. Every controller \
             starts with the effort that carries the load there, and holds an effort for a period. The deviation is \
             the root mean square of both joints, at {} periods. The arm is simulated by RK4 at 0.5 ms at most.",
            number(length_in_f64(periods.len())),
        ),
        &[deviations, motions],
    );
}

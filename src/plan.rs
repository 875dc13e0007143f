//! `pendularm plan`: the cheapest method and timestep for an allowed error, with what every method would cost.
//!
//! **Invariant:** every line has been run.

use std::fmt::Write;

use crate::math::arm::{Arm, State};
use crate::math::pid::{Gains, Setpoint};
use crate::math::shown::Shown;
use crate::options::{Links, PlanOptions};
use crate::study::control_loop::ControlLoop;
use crate::study::planner::{PlanError, Planned, Planning, Task};

/// How long an arm swings unless it is said \[s\].
const SWING: f64 = 10.0;
/// How long a move under control is watched \[s\]: with the default gains it has settled.
const MOVE: f64 = 4.0;

/// Makes the plan, and answers it as text for a terminal.
///
/// # Errors
/// Why there is none.
pub fn run(options: &PlanOptions) -> Result<String, PlanError> {
    match options.links {
        Links::Two => plan(options, Gains::<2>::default()),
        Links::Three => plan(options, Gains::<3>::default()),
    }
}

fn plan<const N: usize>(options: &PlanOptions, gains: Gains<N>) -> Result<String, PlanError> {
    let arm = Arm::<N>::default();
    let joint = |i: usize| options.setpoint.get(i).copied().unwrap_or_default();
    let (control, usual) = if options.is_servo {
        let setpoint = Setpoint::at(std::array::from_fn(joint));
        (ControlLoop::new(arm, gains, setpoint), MOVE)
    } else {
        (ControlLoop::free(arm), SWING)
    };
    let task = Task {
        control,
        start: State::rest(),
        duration: options.duration.unwrap_or(usual),
        error: options.error,
    };
    let mut planning = Planning::new(task)?;
    loop {
        if let Some(planned) = planning.advance() {
            return planned.map(|planned| text(&task, &planned));
        }
    }
}

fn text<const N: usize>(task: &Task<N>, planned: &Planned) -> String {
    let Task {
        control,
        duration,
        error,
        ..
    } = task;
    let kind = if control.is_free() {
        "swinging freely from the starting pose".to_owned()
    } else {
        format!("under control to {:?} rad", control.setpoint.position)
    };
    let (duration, error) = (Shown(*duration), Shown(*error));
    let mut out = format!("{N} links {kind} for {duration} s, end effector within {error} m:\n");
    for one in planned.candidates.iter().rev() {
        // Writing to a string cannot fail.
        let _ = writeln!(
            out,
            "  {:<9} timestep {:.4e} s  {:>9.0} evaluations/s  off by {:.2e} m",
            one.method.name(),
            one.timestep,
            f64::from(one.method.evaluations()) / one.timestep,
            one.error
        );
    }
    if let Some(best) = planned.best() {
        let period = if control.is_free() {
            String::new()
        } else {
            format!(", control period {:.4e} s", best.timestep)
        };
        let _ = writeln!(
            out,
            "Plan: {} at a timestep of {:.4e} s{period}. The truth is known to {:.0e} m; methods that are not listed \
             cost more.",
            best.method.name(),
            best.timestep,
            planned.uncertainty
        );
    }
    out
}

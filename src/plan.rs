//! `pendularm plan`: the cheapest method and timestep for an allowed error, with the cost of every method.
//!
//! **Invariant:** every printed line was simulated.

use std::fmt::Write;

use clap::Args;

use crate::math::arm::{Arm, State};
use crate::math::pid::{Gains, Setpoint};
use crate::math::shown::Shown;
use crate::math::simulation::ControlPeriod;
use crate::study::control_loop::ControlLoop;
use crate::study::paused::at_once;
use crate::study::planner::{self, MAX_DURATION, PlanError, Planned, Task};
pub use crate::value::Links;
use crate::value::{ValueReader, needed, read_links};

/// Default duration of a free swing \[s\].
const SWING: f64 = 10.0;
/// Default duration of a move under control \[s\]. With the default gains it settles in this time.
const MOVE: f64 = 4.0;

/// Find the cheapest method and timestep for an allowed error, and measure the error against a reference
#[derive(Debug, Clone, PartialEq, Args)]
#[command(after_help = "\
Examples:
  pendularm plan --error 0.0001 --duration 2
  pendularm plan --error 0.01 --controller --setpoint=-0.4,0.6")]
pub struct PlanOptions {
    /// Largest allowed error of the end effector, in m
    #[arg(long, value_name = "METRES")]
    #[arg(value_parser = ValueReader(read_positive))]
    pub error: f64,
    /// Plan a move to the setpoint under control, instead of a free swing
    #[arg(long)]
    pub controller: bool,
    /// Duration of the motion from the starting pose, in s; 10 by default, 4 with `--controller`
    #[arg(long, value_name = "SECONDS")]
    #[arg(value_parser = ValueReader(read_duration))]
    pub duration: Option<f64>,
    /// Number of links of the arm, 2 or 3; `ARM_SIM_LINKS` has no effect here
    #[arg(long, value_name = "N", default_value = "2")]
    #[arg(value_parser = ValueReader(read_links))]
    pub links: Links,
    /// Setpoint of the joints under control, in rad, separated by commas; 0.8,-0.6,0 by default
    #[arg(long, value_name = "RADIANS", value_delimiter = ',')]
    #[arg(allow_hyphen_values = true, value_parser = ValueReader(read_angle))]
    pub setpoint: Vec<f64>,
    /// Positions of the joints at the start, in rad, separated by commas; 0 by default
    #[arg(long = "q", value_name = "RADIANS", value_delimiter = ',')]
    #[arg(allow_hyphen_values = true, value_parser = ValueReader(read_angle))]
    pub position: Vec<f64>,
    /// Velocities of the joints at the start, in rad/s, separated by commas; 0 by default
    #[arg(long = "qd", value_name = "RADIANS", value_delimiter = ',')]
    #[arg(allow_hyphen_values = true, value_parser = ValueReader(read_angle))]
    pub velocity: Vec<f64>,
    /// Time between two runs of the control law, in s; planned by default
    #[arg(long, value_name = "SECONDS", requires = "controller")]
    #[arg(value_parser = ValueReader(read_positive))]
    pub control_period: Option<f64>,
    /// Apply each effort one control period late
    #[arg(long, requires = "controller")]
    pub delay: bool,
}

impl PlanOptions {
    /// Checks the options against each other.
    pub(crate) fn checked(mut self) -> Result<Self, String> {
        for (name, given) in [("q", &self.position), ("qd", &self.velocity)] {
            if !given.is_empty() && given.len() != self.links.count() {
                let joints = given.len();
                return Err(format!(
                    "--{name} must be a number for each joint, got {joints}"
                ));
            }
        }
        let joints = self.setpoint.len();
        if joints == 0 {
            self.setpoint = vec![0.8, -0.6, 0.0];
        } else if !self.controller {
            // A free arm has no setpoint, so the option would have no effect.
            return Err("--setpoint needs --controller".to_owned());
        } else if joints != self.links.count() {
            return Err(format!(
                "--setpoint must be a number for each joint, got {joints}"
            ));
        }
        Ok(self)
    }
}

/// Makes the plan, and returns it as text for a terminal.
///
/// # Errors
/// The reason if there is no plan.
pub fn run(options: &PlanOptions) -> Result<String, PlanError> {
    match options.links {
        Links::Two => plan(options, Gains::<2>::default()),
        Links::Three => plan(options, Gains::<3>::default()),
    }
}

fn plan<const N: usize>(options: &PlanOptions, gains: Gains<N>) -> Result<String, PlanError> {
    let arm = Arm::<N>::default();
    let joints = |given: &[f64]| -> [f64; N] {
        std::array::from_fn(|i| given.get(i).copied().unwrap_or_default())
    };
    let (mut control, usual) = if options.controller {
        let setpoint = Setpoint::at(joints(&options.setpoint));
        (ControlLoop::new(arm, gains, setpoint), MOVE)
    } else {
        (ControlLoop::free(arm), SWING)
    };
    control.period = ControlPeriod {
        period: options.control_period.unwrap_or_default(),
        delay: u8::from(options.delay),
    };
    let task = Task {
        control,
        start: State {
            position: joints(&options.position),
            velocity: joints(&options.velocity),
        },
        duration: options.duration.unwrap_or(usual),
        error: options.error,
    };
    at_once(planner::plan(task)).map(|planned| text(&task, &planned))
}

fn text<const N: usize>(task: &Task<N>, planned: &Planned) -> String {
    let Task {
        control,
        duration,
        error,
        ..
    } = task;
    let kind = if control.is_free() {
        "swinging freely".to_owned()
    } else {
        format!("under control to {:?} rad", control.setpoint.position)
    };
    let (duration, error) = (Shown(*duration), Shown(*error));
    let mut out = format!("{N} links {kind} for {duration} s, end effector within {error} m:\n");
    for one in planned.candidates.iter().rev() {
        // Writing to a string cannot fail.
        let _ = writeln!(
            out,
            "  {:<9} timestep {:.4e} s  {:>9} evaluations/s  error {:.2e} m",
            one.method.name(),
            one.timestep,
            rate(f64::from(one.method.evaluations()) / one.timestep),
            one.error
        );
    }
    let best = planned.best;
    let period = if control.is_free() {
        String::new()
    } else {
        let given = Some(control.given_period()).filter(|given| *given > 0.0);
        format!(", control period {:.4e} s", given.unwrap_or(best.timestep))
    };
    let _ = writeln!(
        out,
        "Plan: {} at a timestep of {:.4e} s{period}. The reference is known to {:.0e} m. No cheaper run \
         was found.",
        best.method.name(),
        best.timestep,
        planned.uncertainty
    );
    out
}

/// Evaluations per second, with an exponent if there are too many digits for a column.
fn rate(rate: f64) -> String {
    if rate < 1e7 {
        format!("{rate:.1}")
    } else {
        Shown(rate).to_string()
    }
}

fn read_positive(text: &str) -> Result<f64, String> {
    let number: Option<f64> = text.parse().ok();
    let positive = number.filter(|number| number.is_finite() && *number > 0.0);
    needed(positive, "a number greater than 0", text)
}

fn read_duration(text: &str) -> Result<f64, String> {
    let duration = Some(read_positive(text)?).filter(|duration| *duration <= MAX_DURATION);
    needed(duration, &format!("at most {MAX_DURATION} s"), text)
}

fn read_angle(text: &str) -> Result<f64, String> {
    let angle: Option<f64> = text.trim().parse().ok();
    let needs = "a number for each joint, separated by commas";
    needed(angle.filter(|angle| angle.is_finite()), needs, text)
}

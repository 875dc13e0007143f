//! The subcommand that plans method and timestep for an allowed error.
//!
//! **Invariant:** of the options of serving it knows the number of links alone.

use clap::{Arg, ArgMatches, Command};

use super::links::Links;
use super::usage::{Origin, UsageError};
use crate::study::planner::MAX_DURATION;

/// The plan that is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanOptions {
    /// Largest error of the end effector \[m\].
    pub error: f64,
    /// How long \[s\].
    pub duration: Option<f64>,
    /// Whether the arm is under control, with the default gains.
    pub is_servo: bool,
    /// How many links the arm has.
    pub links: Links,
    /// Positions to which a servo moves the joints \[rad\]; a joint without a number stays at 0.
    pub setpoint: Vec<f64>,
}

/// Its name.
pub(super) const NAME: &str = "plan";

/// The subcommand as `clap` is to read it.
pub(super) fn command() -> Command {
    let option = |name: &'static str, value: &'static str, about: &'static str| {
        let arg = Arg::new(name).long(name).value_name(value).help(about);
        arg.allow_negative_numbers(true)
    };
    Command::new(NAME)
        .about("Find the cheapest method and timestep for an allowed error, and run them against the truth")
        .arg(option("error", "METRES", "Largest error of the end effector; it has to be given"))
        .arg(option(
            "duration",
            "SECONDS",
            "How long the arm swings from its starting pose, or `servo` for a move under control [default: 10]",
        ))
        .arg(option("links", "N", "Number of links of the arm, 2 or 3, whatever ARM_SIM_LINKS says [default: 2]"))
        .arg(
            option("setpoint", "RADIANS", "Where a servo moves the joints, with commas between [default: 0.8,-0.6,0]")
                .allow_hyphen_values(true),
        )
}

/// Reads the options that it was given.
///
/// # Errors
/// [`UsageError`] for the first value that is not as it should be.
pub(super) fn read(matches: &ArgMatches) -> Result<PlanOptions, UsageError> {
    let given = |name: &str| matches.get_one::<String>(name).map(String::as_str);
    let positive = |option: &'static str, text: &str| {
        let number = text.parse().ok();
        number
            .filter(|number: &f64| number.is_finite() && *number > 0.0)
            .ok_or_else(|| bad(option, "a number greater than 0", text))
    };
    let links = match given("links") {
        None | Some("2") => Links::Two,
        Some("3") => Links::Three,
        Some(value) => {
            return Err(UsageError::Links {
                origin: Origin::Option("links"),
                value: value.to_owned(),
            });
        }
    };
    let is_servo = given("duration") == Some("servo");
    let mut setpoint = vec![0.8, -0.6, 0.0];
    if let Some(text) = given("setpoint") {
        if !is_servo {
            // A free arm has none: it would be left out of account.
            return Err(UsageError::Value {
                argument: "--setpoint".to_owned(),
                needs: "must be left out without --duration servo".to_owned(),
                value: text.to_owned(),
            });
        }
        let joints: Result<Vec<f64>, _> = text.split(',').map(|one| one.trim().parse()).collect();
        setpoint = joints
            .ok()
            .filter(|joints| joints.len() == links.count() && joints.iter().all(|q| q.is_finite()))
            .ok_or_else(|| {
                bad(
                    "setpoint",
                    "a number for each joint, with commas between",
                    text,
                )
            })?;
    }
    let duration = match given("duration") {
        None | Some("servo") => None,
        Some(text) => Some(positive("duration", text)?),
    };
    if duration.is_some_and(|duration| duration > MAX_DURATION) {
        return Err(UsageError::Value {
            argument: "--duration".to_owned(),
            needs: format!("must be at most {MAX_DURATION} s"),
            value: given("duration").unwrap_or_default().to_owned(),
        });
    }
    Ok(PlanOptions {
        error: positive("error", given("error").unwrap_or_default())?,
        duration,
        is_servo,
        links,
        setpoint,
    })
}

fn bad(option: &'static str, needs: &'static str, value: &str) -> UsageError {
    UsageError::Plan {
        option,
        needs,
        value: value.to_owned(),
    }
}

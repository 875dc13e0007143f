//! `pendularm param`, the arm's parameters by name, and `pendularm diagnostics`, a summary of its state.
//!
//! **Invariant:** a printed parameter can be set again in the same form. The exit status of diagnostics is 0 only if
//! every part is OK.

use clap::{Args, Subcommand};
use serde::Deserialize;
use serde_json::value::RawValue;
use serde_json::{Value, json};

use super::output::{CommandError, Outcome, plain, print};
use super::session::{Session, member_of};
use super::values::read;
use crate::protocol::catalog::{Rosapi, Service, Topic};
use crate::protocol::ros::parameters::NO_SUCH;

/// The topic of the diagnostics.
const TOPIC: &str = Topic::Diagnostics.name();
/// The levels of `diagnostic_msgs/msg/DiagnosticStatus`, by their numbers.
const LEVELS: [&str; 4] = ["OK", "WARN", "ERROR", "STALE"];
/// Width of the column of keys. All keys of the runtime fit.
const KEY_WIDTH: usize = 24;

/// The verbs of parameters.
#[derive(Debug, Clone, PartialEq, Subcommand)]
pub enum ParamVerb {
    /// List the parameters, each after its node
    List,
    /// Print a parameter's value
    #[command(after_help = "\
Examples:
  pendularm param get /arm_sim gravity
  pendularm param get /arm_sim robot_description > arm.urdf

A text is printed as it is, with --json as JSON.")]
    Get(ParameterName),
    /// Set a parameter
    #[command(after_help = "\
Examples:
  pendularm param set /arm_sim timestep 0.002
  pendularm param set /arm_sim masses '[1, 0.5]'
  pendularm param set /arm_sim integrator verlet

It prints nothing after a success.")]
    Set {
        #[command(flatten)]
        parameter: ParameterName,
        /// The value, in JSON or YAML
        #[arg(allow_negative_numbers = true)]
        value: String,
    },
}

/// A parameter and its node.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct ParameterName {
    /// Its node: `/arm_sim`
    node: String,
    /// Its name; `pendularm param list` lists all
    name: String,
}

impl ParameterName {
    /// Its name in rosapi.
    fn full(&self) -> String {
        format!("/{}:{}", self.node.trim_start_matches('/'), self.name)
    }
}

pub(super) async fn run(verb: &ParamVerb, session: &mut Session) -> Outcome {
    match verb {
        ParamVerb::List => {
            let list = Service::Rosapi(Rosapi::GetParamNames).name();
            let names: Vec<String> = session.ask(list, &json!({}), "names").await?;
            names.iter().try_for_each(|full| {
                let (node, name) = full.split_once(':').unwrap_or(("", full));
                let json = json!({"node": node, "name": name});
                session.show_line(&json, &format!("{node} {name}"))
            })
        }
        ParamVerb::Get(parameter) => {
            let name = json!({"name": parameter.full()});
            let answer = call(session, Rosapi::GetParam, &name).await?;
            // JSON within JSON.
            match serde_json::from_str::<String>(&answer.value) {
                Ok(text) if !session.is_json => {
                    let lines: Vec<String> = text.split('\n').map(plain).collect();
                    print(&(lines.join("\n") + "\n"))
                }
                _ => session.show(&RawValue::from_string(answer.value)?, ""),
            }
        }
        ParamVerb::Set { parameter, value } => {
            let args = json!({"name": parameter.full(), "value": read(value)?.to_string()});
            call(session, Rosapi::SetParam, &args).await.map(drop)
        }
    }
}

/// The answer to a call about a parameter.
#[derive(Deserialize)]
struct ParameterAnswer {
    successful: bool,
    reason: String,
    #[serde(default)]
    value: String,
}

async fn call(session: &mut Session, question: Rosapi, args: &Value) -> Outcome<ParameterAnswer> {
    let values = session.call(Service::Rosapi(question).name(), args).await?;
    let answer: ParameterAnswer = serde_json::from_str(values.get())?;
    match answer.reason.as_str() {
        _ if answer.successful => Ok(answer),
        // The message names the command and the node.
        NO_SUCH => Err(CommandError::Refused(format!(
            "there is no parameter {}; `pendularm param list` lists all",
            args["name"]
        ))),
        _ => Err(CommandError::Refused(answer.reason)),
    }
}

/// A part in a message of the diagnostics.
#[derive(Deserialize)]
struct DiagnosedPart {
    level: usize,
    name: String,
    message: String,
    values: Vec<Detail>,
}

#[derive(Deserialize)]
struct Detail {
    key: String,
    value: String,
}

pub(super) async fn diagnostics(session: &mut Session) -> Outcome {
    session.subscribe(TOPIC, None).await?;
    let message = session.message(TOPIC).await?;
    let status = member_of(&message, "status").map_or("null", RawValue::get);
    let status: Vec<DiagnosedPart> = serde_json::from_str(status)?;
    match session.is_json {
        true => session.show(&message, "")?,
        false => print(&status.iter().map(page).collect::<String>())?,
    }
    match status.iter().find(|part| part.level != 0) {
        None => Ok(()),
        Some(DiagnosedPart { name, message, .. }) => {
            Err(CommandError::Refused(format!("{name}: {message}")))
        }
    }
}

fn page(part: &DiagnosedPart) -> String {
    let level = LEVELS.get(part.level).unwrap_or(&"STALE");
    let mut page = plain(&format!("{level} {}: {}", part.name, part.message)) + "\n";
    for Detail { key, value } in &part.values {
        page += plain(&format!("  {key:KEY_WIDTH$}  {value}")).trim_end();
        page.push('\n');
    }
    page
}

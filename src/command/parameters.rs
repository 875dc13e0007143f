//! `pendularm param`, the arm's parameters by name, and `pendularm diagnostics`, a summary of its state.
//!
//! **Invariant:** a printed parameter can be set again in the same form. The exit status of diagnostics is 0 only if
//! every part is OK.

use std::collections::BTreeMap;

use clap::{Args, Subcommand};
use serde::Deserialize;
use serde_json::value::RawValue;
use serde_json::{Value, json};

use super::output::{CommandError, Outcome, plain, print};
use super::session::{Session, read_member};
use super::values::read;
use crate::protocol::catalog::{Rosapi, Service, Topic};

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

A text is printed without quotes. With --json it is a JSON string.")]
    Get(ParameterName),
    /// Set a parameter
    #[command(after_help = "\
Examples:
  pendularm param set /arm_sim timestep 0.002
  pendularm param set /arm_sim masses '[1, 0.5]'
  pendularm param set /arm_sim integrator verlet

The command prints nothing after a success.")]
    Set {
        #[command(flatten)]
        parameter: ParameterName,
        /// Value, in JSON or YAML
        #[arg(allow_negative_numbers = true)]
        value: String,
    },
}

/// A parameter and its node.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct ParameterName {
    /// Node: `/arm_sim`
    node: String,
    /// Name; `pendularm param list` lists all
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
    match answer.successful {
        true => Ok(answer),
        false => Err(CommandError::Refused(answer.reason)),
    }
}

/// A part in a message of the diagnostics.
#[derive(Deserialize)]
struct DiagnosedPart {
    level: u8,
    name: String,
    message: String,
    values: Vec<BTreeMap<String, String>>,
}

pub(super) async fn diagnostics(session: &mut Session) -> Outcome {
    let topic = Topic::Diagnostics.name();
    session.subscribe(topic, None).await?;
    let message = session.message(topic).await?;
    let status: Vec<DiagnosedPart> = read_member(&message, "status")?;
    session.show(&message, "")?;
    match status.into_iter().find(|part| part.level != 0) {
        None => Ok(()),
        Some(part) => {
            // With a warning the message is the same as without one.
            let mut values = part.values.iter().filter(|_| part.level == 1);
            let warning = values.find(|one| one.get("key").is_some_and(|key| key == "warning"));
            let why = warning.and_then(|one| one.get("value"));
            let why = why.unwrap_or(&part.message);
            Err(CommandError::Refused(format!("{}: {why}", part.name)))
        }
    }
}

//! `pendularm param`: the arm's parameters by name.
//!
//! **Invariant:** a value that is printed can be set again as it was printed.

use clap::Command;
use serde::Deserialize;
use serde_json::value::RawValue;
use serde_json::{Value, json};

use super::asked::Asked;
use super::error::{CommandError, plain};
use super::output::print;
use super::verbs::{required, subject, verb};
use crate::protocol::catalog::{Rosapi, Service};
use crate::protocol::ros::parameters::NO_SUCH;

pub(super) fn command() -> Command {
    let node = || required("node", "NODE", "Whose parameter it is: /arm_sim");
    let name = || required("name", "NAME", "Its name; `pendularm param list` has all");
    let list = verb(
        "list",
        "List the parameters, each behind its node",
        "Example:\n  pendularm param list",
    );
    let get = verb(
        "get",
        "Print a parameter's value",
        "Examples:\n  pendularm param get /arm_sim gravity\n  \
         pendularm param get /arm_sim robot_description > arm.urdf\n\n\
         A text is printed as it is, with --json as JSON.",
    );
    let set = verb(
        "set",
        "Set a parameter",
        "Examples:\n  pendularm param set /arm_sim timestep 0.002\n  pendularm param set /arm_sim masses '[1, 0.5]'\n  \
         pendularm param set /arm_sim integrator verlet\n\n\
         VALUE is JSON or YAML. Nothing is printed if it was set.",
    );
    let value = required("value", "VALUE", "The value").allow_negative_numbers(true);
    subject("param", "Read and set parameters of a running pendularm").subcommands([
        list,
        get.args([node(), name()]),
        set.args([node(), name(), value]),
    ])
}

/// The name under which rosapi knows a parameter of a node.
fn full_name(asked: &Asked) -> String {
    format!(
        "/{}:{}",
        asked.text("node").trim_start_matches('/'),
        asked.text("name")
    )
}

pub(super) fn list(asked: &Asked) -> Result<(), CommandError> {
    let names: Vec<String> = asked.open()?.ask("get_param_names", &json!({}), "names")?;
    let mut text = String::new();
    for full in names {
        let (node, name) = full.split_once(':').unwrap_or(("", &full));
        text += &if asked.has("json") {
            json!({"node": node, "name": name}).to_string()
        } else {
            plain(&format!("{node} {name}"))
        };
        text.push('\n');
    }
    print(&text)
}

pub(super) fn get(asked: &Asked) -> Result<(), CommandError> {
    let values = call(asked, Rosapi::GetParam, &json!({"name": full_name(asked)}))?;
    // JSON within JSON.
    match serde_json::from_str::<String>(&values.value) {
        Ok(text) if !asked.has("json") => {
            let lines: Vec<String> = text.split('\n').map(plain).collect();
            print(&(lines.join("\n") + "\n"))
        }
        _ => {
            let value = RawValue::from_string(values.value);
            asked.show(&value.map_err(|error| CommandError::Lost(error.to_string()))?)
        }
    }
}

pub(super) fn set(asked: &Asked) -> Result<(), CommandError> {
    let value = asked.value("value", "VALUE")?.to_string();
    let args = json!({"name": full_name(asked), "value": value});
    call(asked, Rosapi::SetParam, &args).map(drop)
}

/// Values that say themselves whether it was done.
#[derive(Deserialize)]
struct ParameterAnswer {
    successful: bool,
    reason: String,
    #[serde(default)]
    value: String,
}

fn call(asked: &Asked, question: Rosapi, args: &Value) -> Result<ParameterAnswer, CommandError> {
    let service = Service::Rosapi(question).name();
    let values = asked.open()?.call(service, args)?;
    let answer: ParameterAnswer = serde_json::from_str(values.get())
        .map_err(|error| CommandError::refused(&format!("{service} answered: {error}")))?;
    if answer.successful {
        return Ok(answer);
    }
    Err(CommandError::refused(&match answer.reason.as_str() {
        // In the words of a shell, and with the node.
        NO_SUCH => format!(
            "there is no parameter {}; `pendularm param list` has all",
            args["name"]
        ),
        other => other.to_owned(),
    }))
}

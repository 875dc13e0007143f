//! `list` and `info` for topics, services, actions and nodes; `pendularm service call` and `pendularm action send_goal`.
//!
//! **Invariant:** `info` works only for names that the runtime lists. A value has only fields of its type; an unknown type
//! may have any. The command waits for the end of its goal. A signal cancels the goal first.

use clap::{Args, Subcommand};
use serde_json::value::RawValue;
use serde_json::{Value, json};

use super::output::{CommandError, Outcome};
use super::session::{Session, read_as};
use super::values::read;
use crate::output::print_error;
use crate::protocol::catalog::rosapi::PREFIX;
use crate::protocol::catalog::{Field, Rosapi, Service, Topic, types};
use crate::protocol::names::absolute;
use crate::protocol::ros::rosapi::asked_type;
use crate::signals::EndRequests;

/// The refusal of a value in several arguments.
pub(crate) const UNQUOTED: &str = "\
    an argument in YAML or JSON came as several words: put quotes around all of it, such as '{data: true}'; a TYPE is pkg/Name";

/// Fields of ROS 1 that the runtime also reads, each with its field of ROS 2.
const ROS_1: [(&str, &str); 3] = [("secs", "sec"), ("nsecs", "nanosec"), ("seq", "stamp")];

/// A type and a value of that type, both optional.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct TypedValue {
    /// Type, as pkg/Name; optional, and checked if given
    #[arg(value_name = "TYPE")]
    type_name: Option<String>,
    /// Value, in JSON or YAML; {} by default
    value: Option<String>,
}

impl TypedValue {
    /// Reads the value for a topic, a service or an action, and checks it against its type. Returns the type too, empty
    /// if it is unknown.
    pub(super) async fn checked(
        &self,
        kind: &str,
        name: &str,
        session: &mut Session,
    ) -> Outcome<(String, Value)> {
        let in_type = |one: char| one.is_alphanumeric() || "_/".contains(one);
        let is_type = |text: &&str| text.contains('/') && text.chars().all(in_type);
        let first = self.type_name.as_deref();
        let (type_name, text) = match (first.filter(is_type), self.value.as_deref()) {
            (None, Some(_)) => return Err(CommandError::Usage(UNQUOTED.to_owned())),
            (None, None) => (None, first),
            typed => typed,
        };
        let value = read(text.unwrap_or("{}"))?;
        let type_name = session.type_of(kind, name, type_name).await?;
        let part = match kind {
            "topic" => Rosapi::MessageDetails,
            "service" => Rosapi::ServiceRequestDetails,
            _ => Rosapi::ActionGoalDetails,
        };
        if let Some(layout) = asked_type(part, &type_name) {
            check(layout.fields, &value, "")
                .map_err(|why| CommandError::Usage(format!("{name} has {why}")))?;
        }
        // For a goal the runtime sends the warning itself.
        if *absolute(name) == *Topic::JointTrajectory.name() {
            let enable = Service::Enable.name();
            if let Ok(false) = session.ask(enable, &json!({}), "data").await {
                print_error(&format_args!(
                    "the controller is off, so the arm does not move there; to switch it on: pendularm service call \
                     {enable} '{{data: true}}'"
                ));
            }
        }
        Ok((type_name, value))
    }
}

/// The verbs for topics, services, actions and nodes.
#[derive(Debug, Clone, PartialEq, Subcommand)]
pub enum GraphVerb {
    /// List the names
    List {
        /// Show the types; nodes have none
        #[arg(short = 't', long)]
        show_types: bool,
    },
    /// Describe a topic, service, action or node
    Info {
        /// Name, with or without the leading slash
        name: String,
    },
}

/// The verbs of services.
#[derive(Debug, Clone, PartialEq, Subcommand)]
pub enum ServiceVerb {
    #[command(flatten)]
    Graph(GraphVerb),
    /// Call a service, and print its answer
    #[command(after_help = "\
Examples:
  pendularm service call /pid_controller/enable '{data: true}'
  pendularm service call /arm_sim/set_integrator '{method: rk4, timestep: 0.002}'
  pendularm service call --json /study/stability | jq .timestep_limit_held

VALUE has the fields by name, or all fields in order.")]
    Call {
        /// Name, with or without the leading slash
        service: String,
        #[command(flatten)]
        args: TypedValue,
    },
}

/// The verbs of actions.
#[derive(Debug, Clone, PartialEq, Subcommand)]
pub enum ActionVerb {
    #[command(flatten)]
    Graph(GraphVerb),
    /// Send a goal, and wait for its end
    #[command(
        name = "send_goal",
        visible_alias = "send",
        after_help = "\
Examples:
  pendularm service call /pid_controller/enable '{data: true}'   # the controller moves the arm
  pendularm action send_goal /ik_action '{x: 1.2, y: 0.5}' --feedback
  pendularm action send_goal --json /ik_action pendularm_interfaces/action/MoveTo '{\"x\": 1.2, \"y\": 0.5}'

The command prints `result` and `status`, and with --feedback each `feedback` before them. The first SIGINT cancels the
goal and waits for its end. The second one ends the command. Exit status: 0 for SUCCEEDED, 1 for CANCELED and ABORTED."
    )]
    SendGoal {
        /// Name, with or without the leading slash
        action: String,
        #[command(flatten)]
        goal: TypedValue,
        /// Print the feedback
        #[arg(short = 'f', long)]
        feedback: bool,
    },
}

pub(super) async fn run_graph(verb: &GraphVerb, kind: &str, session: &mut Session) -> Outcome {
    let name = match verb {
        GraphVerb::List { show_types } => return list(kind, *show_types, session).await,
        GraphVerb::Info { name } => name,
    };
    session.find(kind, name).await?;
    let questions: &[&str] = match kind {
        "topic" => &["topic_type", "publishers", "subscribers"],
        "service" => &["service_type", "service_node"],
        "action" => &["action_type"],
        _ => &["node_details"],
    };
    let mut members = Vec::new();
    for question in questions {
        let service = format!("{PREFIX}{question}");
        let answer = session.call(&service, &json!({kind: name})).await?;
        let inside = answer.get().strip_prefix('{');
        members.extend(inside.and_then(|inside| Some(inside.strip_suffix('}')?.to_owned())));
    }
    let description = RawValue::from_string(format!("{{{}}}", members.join(",")))?;
    session.show(&description, "")
}

async fn list(kind: &str, show_types: bool, session: &mut Session) -> Outcome {
    for name in session.names(kind).await? {
        if show_types && kind != "node" {
            let type_name = session.type_of(kind, &name, None).await?;
            let json = json!({"name": name, "type": type_name});
            session.show_line(&json, &format!("{name} [{type_name}]"))?;
        } else {
            session.show_line(&json!({"name": name}), &name)?;
        }
    }
    Ok(())
}

pub(super) async fn run_service(verb: &ServiceVerb, session: &mut Session) -> Outcome {
    match verb {
        ServiceVerb::Graph(verb) => run_graph(verb, "service", session).await,
        ServiceVerb::Call { service, args } => {
            let (_, args) = args.checked("service", service, session).await?;
            let values = session.call(service, &args).await?;
            session.show(&values, "")
        }
    }
}

pub(super) async fn run_action(verb: &ActionVerb, session: &mut Session) -> Outcome {
    match verb {
        ActionVerb::Graph(verb) => run_graph(verb, "action", session).await,
        ActionVerb::SendGoal {
            action,
            goal,
            feedback,
        } => {
            let (_, goal) = goal.checked("action", action, session).await?;
            let goal = json!({"op": "send_action_goal", "id": "goal", "action": action, "args": goal,
                "feedback": feedback});
            session.send(&goal).await?;
            follow(action, session).await
        }
    }
}

/// Waits for the end of a goal. The first signal cancels it, the second ends the command.
async fn follow(action: &str, session: &mut Session) -> Outcome {
    let cancel = json!({"op": "cancel_action_goal", "id": "goal", "action": action});
    let mut requests = EndRequests::listen().map_err(CommandError::system)?;
    let mut is_canceled = false;
    loop {
        let said = tokio::select! {
            said = session.receive() => said?,
            _ = requests.next() => {
                if is_canceled {
                    return Err(CommandError::Refused("ended before the result of the goal".to_owned()));
                }
                is_canceled = true;
                session.send(&cancel).await?;
                continue;
            }
        };
        let values = said.values.as_ref().map_or("null", |values| values.get());
        match said.op.as_str() {
            "action_feedback" => {
                let feedback = RawValue::from_string(format!("{{\"feedback\":{values}}}"))?;
                session.show(&feedback, "---\n")?;
                session.await_next();
            }
            "action_result" if !said.result => return Err(said.refusal(action)),
            "action_result" => {
                // The final statuses of `action_msgs/msg/GoalStatus`.
                let status = match read_as(said.status.as_deref()) {
                    Some(4) => "SUCCEEDED",
                    Some(5) => "CANCELED",
                    Some(6) => "ABORTED",
                    _ => "UNKNOWN",
                };
                let end = format!("{{\"result\":{values},\"status\":\"{status}\"}}");
                session.show(&RawValue::from_string(end)?, "---\n")?;
                return match status {
                    "SUCCEEDED" => Ok(()),
                    other => Err(CommandError::Refused(format!("the goal ended as {other}"))),
                };
            }
            _ => {}
        }
    }
}

/// Refuses the first member of `value`, at `path`, that is not one of the fields.
fn check(fields: &[Field], value: &Value, path: &str) -> Result<(), String> {
    match value {
        // As the whole value, a list has the values of all fields in order.
        Value::Array(items) if path.is_empty() => {
            let names = fields.iter().map(|field| field.name.to_owned());
            let named = names.zip(items.iter().cloned()).collect();
            check(fields, &Value::Object(named), path)
        }
        Value::Array(items) => (0..)
            .zip(items)
            .try_for_each(|(at, item)| check(fields, item, &format!("{path}[{at}]"))),
        Value::Object(members) => members.iter().try_for_each(|(name, member)| {
            let dot = if path.is_empty() { "" } else { "." };
            let path = format!("{path}{dot}{name}");
            let renamed = ROS_1.iter().find(|(old, _)| old == name);
            let name = renamed.map_or(name.as_str(), |(_, new)| new);
            match fields.iter().find(|field| field.name == name) {
                Some(field) => types::find(field.element().0)
                    .map_or(Ok(()), |layout| check(layout.fields, member, &path)),
                None => Err(unknown_field(fields, name, &path)),
            }
        }),
        // In YAML, a name and a value without a space after the colon are one text.
        Value::String(text) if text.contains(':') => check(fields, &json!({text: null}), path),
        _ => Ok(()),
    }
}

/// The refusal of a field.
fn unknown_field(fields: &[Field], name: &str, path: &str) -> String {
    let known: Vec<&str> = fields.iter().map(|field| field.name).collect();
    let known = match &known[..] {
        [] => "none".to_owned(),
        known => known.join(", "),
    };
    let hint = match name.split_once(':') {
        Some((name, value)) => format!(". Put a space after the colon: {{{name}: {value}}}"),
        None => String::new(),
    };
    format!("unknown field {path:?}; known fields: {known}{hint}")
}

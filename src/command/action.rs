//! `pendularm action`: goals with progress and an end.
//!
//! **Invariant:** a goal that was sent is awaited to its end; a signal asks for that end, and does not just leave.

use std::io::Write as _;

use clap::Command;
use serde_json::json;
use serde_json::value::RawValue;

use super::asked::Asked;
use super::error::CommandError;
use super::session::on_signal;
use super::verbs::{flag, required, show_types, subject, typed_value, verb};

/// The statuses of `action_msgs/msg/GoalStatus`, by their numbers.
const STATUSES: [&str; 7] = [
    "UNKNOWN",
    "ACCEPTED",
    "EXECUTING",
    "CANCELING",
    "SUCCEEDED",
    "CANCELED",
    "ABORTED",
];

pub(super) fn command() -> Command {
    let list = verb(
        "list",
        "List the actions that there are",
        "Example:\n  pendularm action list -t",
    );
    let send = verb(
        "send_goal",
        "Send a goal, and wait for its end",
        "Examples:\n  pendularm service call /pid_controller/enable '{data: true}'   # it moves the arm\n  \
         pendularm action send_goal /ik_action '{x: 1.2, y: 0.5}' --feedback\n  \
         pendularm action send_goal --json /ik_action pendularm_interfaces/action/MoveTo '{\"x\": 1.2, \"y\": 0.5}'\n\n\
         It prints `result` and `status`, and before them each `feedback` if that is wanted. SIGINT cancels the goal \
         and waits for\nits end; the second ends at once. Status 0 is SUCCEEDED; CANCELED and ABORTED are 1.",
    );
    let action = required(
        "action",
        "ACTION",
        "Its name, with or without the leading slash",
    );
    subject("action", "Send goals to actions of a running pendularm").subcommands([
        list.arg(show_types()),
        send.visible_alias("send")
            .arg(action)
            .args(typed_value("GOAL", "The goal, in JSON or YAML"))
            .arg(flag("feedback", "Print how it goes").short('f')),
    ])
}

pub(super) fn list(asked: &Asked) -> Result<(), CommandError> {
    let mut session = asked.open()?;
    let names: Vec<String> = session.ask("action_servers", &json!({}), "action_servers")?;
    asked.list(&names, |name| session.type_of("action", name, None))
}

pub(super) fn send_goal(asked: &Asked) -> Result<(), CommandError> {
    let action = asked.text("action");
    let (type_name, goal) = asked.typed_value("GOAL")?;
    let mut session = asked.open()?;
    let mut send = json!({"op": "send_action_goal", "id": "goal", "action": action, "args": goal,
        "feedback": asked.has("feedback")});
    if let (Some(type_name), Some(frame)) = (type_name, send.as_object_mut()) {
        frame.insert("action_type".to_owned(), type_name.into());
    }
    session.send(&send)?;
    let cancel = json!({"op": "cancel_action_goal", "id": "goal", "action": action});
    let mut sender = session.sender()?;
    on_signal(move || {
        // If that fails the connection has ended, which is noticed where it is read.
        let _ = sender.write_all(format!("{cancel}\n").as_bytes());
    })?;
    loop {
        let said = session.receive()?;
        let values = said.values.as_ref().map_or("null", |values| values.get());
        match said.op.as_str() {
            "action_feedback" => {
                asked.show_next(&raw(format!("{{\"feedback\":{values}}}"))?)?;
                session.await_next();
            }
            "action_result" => {
                let status = said
                    .status_number()
                    .and_then(|number| STATUSES.get(number))
                    .unwrap_or(&"UNKNOWN");
                if !said.result {
                    return Err(said.refusal(action));
                }
                let end = format!("{{\"result\":{values},\"status\":\"{status}\"}}");
                asked.show_next(&raw(end)?)?;
                return match *status {
                    "SUCCEEDED" => Ok(()),
                    other => Err(CommandError::refused(&format!("the goal ended as {other}"))),
                };
            }
            _ => {}
        }
    }
}

/// JSON that is put together of what is JSON.
fn raw(text: String) -> Result<Box<RawValue>, CommandError> {
    RawValue::from_string(text).map_err(|error| CommandError::Lost(error.to_string()))
}

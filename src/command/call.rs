//! `pendularm service call` and `pendularm action send_goal`.
//!
//! **Invariant:** the command waits for the end of its goal. A signal cancels the goal first.

use clap::Subcommand;
use serde_json::{Value, json};
#[cfg(unix)]
use tokio::signal::unix;
#[cfg(windows)]
use tokio::signal::windows;

use super::arguments::TypedValue;
use super::graph::{self, GraphVerb};
use super::output::{CommandError, raw};
use super::session::{RuntimeOptions, Session};
use crate::output::print_error;
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::names::absolute;

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

/// The topic that moves the arm while the controller is on. For a goal the runtime sends the warning itself.
const MOVING: &str = Topic::JointTrajectory.name();

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

Give the fields by name, or all of them in order.")]
    Call {
        /// Its name, with or without the leading slash
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

It prints `result` and `status`, and before them each `feedback` with --feedback. The first SIGINT cancels the goal and
waits for its end. The second one ends the command. Exit status: 0 for SUCCEEDED, 1 for CANCELED and ABORTED."
    )]
    SendGoal {
        /// Its name, with or without the leading slash
        action: String,
        #[command(flatten)]
        goal: TypedValue,
        /// Print the feedback
        #[arg(short = 'f', long)]
        feedback: bool,
    },
}

pub(super) async fn run_service(
    verb: &ServiceVerb,
    runtime: &RuntimeOptions,
) -> Result<(), CommandError> {
    match verb {
        ServiceVerb::Graph(verb) => graph::run(verb, "service", &mut runtime.open().await?).await,
        ServiceVerb::Call { service, args } => {
            let (type_name, args) = args.read()?;
            let mut session = runtime.open().await?;
            session.check("service", service, type_name, &args).await?;
            let values = session.call(service, &args).await?;
            session.show(&values, "")
        }
    }
}

pub(super) async fn run_action(
    verb: &ActionVerb,
    runtime: &RuntimeOptions,
) -> Result<(), CommandError> {
    match verb {
        ActionVerb::Graph(verb) => graph::run(verb, "action", &mut runtime.open().await?).await,
        ActionVerb::SendGoal {
            action,
            goal,
            feedback,
        } => {
            let (type_name, goal) = goal.read()?;
            let mut session = runtime.open().await?;
            session.check("action", action, type_name, &goal).await?;
            let goal = json!({"op": "send_action_goal", "id": "goal", "action": action, "args": goal,
                "feedback": feedback});
            session.send(&goal).await?;
            follow(action, &mut session).await
        }
    }
}

/// The signals that end a command.
#[cfg(unix)]
fn signals() -> std::io::Result<(unix::Signal, unix::Signal)> {
    let hear = unix::signal;
    Ok((
        hear(unix::SignalKind::interrupt())?,
        hear(unix::SignalKind::terminate())?,
    ))
}

/// The console events that end a command on Windows.
#[cfg(windows)]
fn signals() -> std::io::Result<(windows::CtrlC, windows::CtrlBreak)> {
    Ok((windows::ctrl_c()?, windows::ctrl_break()?))
}

/// Waits for the end of a goal. The first signal cancels it, the second ends the command.
async fn follow(action: &str, session: &mut Session) -> Result<(), CommandError> {
    let cancel = json!({"op": "cancel_action_goal", "id": "goal", "action": action});
    let (mut interrupt, mut terminate) = signals()?;
    let mut is_canceled = false;
    loop {
        let said = tokio::select! {
            said = session.receive() => said?,
            _ = async { tokio::select! { _ = interrupt.recv() => {}, _ = terminate.recv() => {} } } => {
                if is_canceled {
                    return Err(CommandError::refused("ended before the result of the goal"));
                }
                is_canceled = true;
                session.send(&cancel).await?;
                continue;
            }
        };
        let values = said.values.as_ref().map_or("null", |values| values.get());
        match said.op.as_str() {
            "action_feedback" => {
                session.show(&raw(format!("{{\"feedback\":{values}}}"))?, "---\n")?;
                session.await_next();
            }
            "action_result" if !said.result => return Err(said.refusal(action)),
            "action_result" => {
                let status = said.status_number();
                let status = status.and_then(|number| STATUSES.get(number));
                let status = status.unwrap_or(&"UNKNOWN");
                let end = format!("{{\"result\":{values},\"status\":\"{status}\"}}");
                session.show(&raw(end)?, "---\n")?;
                return match *status {
                    "SUCCEEDED" => Ok(()),
                    other => Err(CommandError::refused(&format!("the goal ended as {other}"))),
                };
            }
            _ => {}
        }
    }
}

impl Session {
    /// Checks a value against the type of its topic, service or action, before it is sent. Returns the type. Warns if
    /// the value moves the arm through the controller, which is off.
    pub(super) async fn check(
        &mut self,
        kind: &str,
        name: &str,
        type_name: Option<&str>,
        value: &Value,
    ) -> Result<String, CommandError> {
        let known = self.type_of(kind, name, type_name).await?;
        let layout = match kind {
            "topic" => "message_details",
            "service" => "service_request_details",
            _ => "action_goal_details",
        };
        self.check_fields(name, layout, &known, value).await?;
        if *absolute(name) == *MOVING {
            let enable = Service::Enable.name();
            let is_off = match self.call(enable, &json!({})).await {
                Err(CommandError::Refused(_)) => false,
                values => serde_json::from_str(values?.get())
                    .is_ok_and(|values: Value| values.get("data") == Some(&Value::Bool(false))),
            };
            if is_off {
                print_error(&format_args!(
                    "the controller is off, so the arm does not move there; to switch it on: pendularm service call \
                     {enable} '{{data: true}}'"
                ));
            }
        }
        Ok(known)
    }
}

//! `pendularm service`: what can be called, and calling it.
//!
//! **Invariant:** a call's refusal is the runtime's own words on standard error, and nothing on standard output.

use clap::Command;
use serde_json::json;

use super::asked::Asked;
use super::error::CommandError;
use super::verbs::{required, show_types, subject, typed_value, verb};

pub(super) fn command() -> Command {
    let list = verb(
        "list",
        "List the services that there are",
        "Example:\n  pendularm service list -t",
    );
    let call = verb(
        "call",
        "Call a service, and print its answer",
        "Examples:\n  pendularm service call /pid_controller/enable '{data: true}'\n  \
         pendularm service call /arm_sim/set_integrator '{method: rk4, timestep: 0.002}'\n  \
         pendularm service call --json /study/stability | jq .timestep_limit_held\n\n\
         ARGS are JSON or YAML, fields by name or all in their order; without any they are {}.",
    );
    let service = required(
        "service",
        "SERVICE",
        "Its name, with or without the leading slash",
    );
    subject("service", "Call services of a running pendularm").subcommands([
        list.arg(show_types()),
        call.arg(service).args(typed_value("ARGS", "The arguments")),
    ])
}

pub(super) fn list(asked: &Asked) -> Result<(), CommandError> {
    let mut session = asked.open()?;
    let names: Vec<String> = session.ask("services", &json!({}), "services")?;
    asked.list(&names, |name| session.type_of("service", name, None))
}

pub(super) fn call(asked: &Asked) -> Result<(), CommandError> {
    let service = asked.text("service");
    let (type_name, args) = asked.typed_value("ARGS")?;
    let mut session = asked.open()?;
    if type_name.is_some() {
        session.type_of("service", service, type_name)?;
    }
    let values = session.call(service, &args)?;
    asked.show(&values)
}

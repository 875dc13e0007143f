//! `list` and `info`: the topics, services, actions and nodes of a runtime.
//!
//! **Invariant:** `info` works only for names that the runtime lists.

use clap::Subcommand;
use serde_json::json;
use serde_json::value::RawValue;

use super::output::{CommandError, raw};
use super::session::Session;
use crate::protocol::names::are_same;

/// The verbs for topics, services, actions and nodes.
#[derive(Debug, Clone, PartialEq, Subcommand)]
pub enum GraphVerb {
    /// List their names
    List {
        /// Show the types (nodes have none)
        #[arg(short = 't', long)]
        show_types: bool,
    },
    /// Describe one: the type and the nodes of a topic, service or action; the topics and services of a node
    Info {
        /// Its name, with or without the leading slash
        name: String,
    },
}

/// The services of rosapi about that kind, each with the printed member of its answer.
fn questions(kind: &str) -> &'static [(&'static str, &'static str)] {
    match kind {
        "topic" => &[
            ("topic_type", "type"),
            ("publishers", "publishers"),
            ("subscribers", "subscribers"),
        ],
        "service" => &[("service_type", "type"), ("service_node", "node")],
        "action" => &[("action_type", "type")],
        _ => &[
            ("node_details", "publishing"),
            ("node_details", "subscribing"),
            ("node_details", "services"),
        ],
    }
}

pub(super) async fn run(
    verb: &GraphVerb,
    kind: &str,
    session: &mut Session,
) -> Result<(), CommandError> {
    let question = match kind {
        "action" => "action_servers".to_owned(),
        other => format!("{other}s"),
    };
    let names: Vec<String> = session.ask(&question, &json!({}), &question).await?;
    let name = match verb {
        GraphVerb::List { show_types } => return list(kind, names, *show_types, session).await,
        GraphVerb::Info { name } => name,
    };
    if !names.iter().any(|one| are_same(one, name)) {
        return Err(CommandError::refused(&format!(
            "there is no {kind} {name}; `pendularm {kind} list` lists all"
        )));
    }
    let mut members = Vec::new();
    for (question, member) in questions(kind) {
        let value: Box<RawValue> = session.ask(question, &json!({kind: name}), member).await?;
        members.push(format!("{member:?}:{value}"));
    }
    session.show(&raw(format!("{{{}}}", members.join(",")))?, "")
}

async fn list(
    kind: &str,
    names: Vec<String>,
    show_types: bool,
    session: &mut Session,
) -> Result<(), CommandError> {
    let mut entries = Vec::new();
    for name in names {
        entries.push(if show_types && kind != "node" {
            let type_name = session.type_of(kind, &name, None).await?;
            let text = format!("{name} [{type_name}]");
            (json!({"name": name, "type": type_name}), text)
        } else {
            (json!({"name": name}), name)
        });
    }
    session.show_list(&entries)
}

//! Rosapi's answers, from the catalog and from what clients have registered; without a connection.
//!
//! **Invariant:** answers are compared whole; names are spelled here as clients spell them.

mod nodes;
mod services;
mod topics;
mod types;

use pendularm::protocol::catalog::Rosapi;
use pendularm::protocol::ros::rosapi::{AnswerError, Census, ListedService, ListedTopic, answer};
use serde_json::Value;

/// Clients that talk on `/chat` and about `/joint_states`, listen to `/wish`, and provide two services.
fn census() -> Census {
    let topic = |name: &str, type_name: Option<&str>, published, subscribed| {
        let (name, type_name) = (name.into(), type_name.map(Into::into));
        ListedTopic {
            name,
            type_name,
            published,
            subscribed,
        }
    };
    let service = |name: &str, type_name: Option<&str>| ListedService {
        name: name.into(),
        type_name: type_name.map(Into::into),
    };
    Census {
        topics: vec![
            topic("/chat", Some("std_msgs/String"), true, false),
            topic("/joint_states", None, false, true),
            topic("/joint_trajectory", None, true, false),
            topic("/wish", None, false, true),
        ],
        services: vec![
            service("/add", Some("demo/srv/Add")),
            service("/nameless", None),
        ],
        actions: vec![
            service("/dance", Some("demo/action/Dance")),
            service("/untyped", None),
        ],
    }
}

/// The answer about the one name that a request gives.
fn asked(question: Rosapi, args: Value) -> Result<Value, AnswerError> {
    let fields = args.as_object().unwrap();
    let name = fields.values().next().and_then(Value::as_str);
    answer(question, name.unwrap_or_default(), &census())
}

#[track_caller]
fn values(question: Rosapi, args: Value) -> Value {
    match asked(question, args) {
        Ok(values) => values,
        Err(why) => panic!("{question:?}: {why}"),
    }
}

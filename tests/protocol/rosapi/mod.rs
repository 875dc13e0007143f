//! Rosapi's answers, from the catalog and from clients' registrations, without a connection.
//!
//! **Invariant:** answers are compared whole; names are spelled here as clients spell them.

use pendularm::protocol::catalog::{Action, Node, Rosapi, Service, Topic, types};
use pendularm::protocol::ros::rosapi::{Census, Listed, answer};
use serde_json::{Value, json};

/// Clients that publish on `/chat` and `/joint_states`, subscribe to `/wish`, and provide two services.
fn census() -> Census {
    let topic = |name: &str, type_name: Option<&str>, published, subscribed| {
        let (name, type_name) = (name.into(), type_name.map(Into::into));
        Listed {
            name,
            type_name,
            published,
            subscribed,
        }
    };
    let service = |name: &str, type_name: Option<&str>| topic(name, type_name, true, false);
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

/// A row: a service, its arguments, and the answer or the text of its refusal.
const ANSWERS: &str = include_str!("answers.txt");

/// The answer about the one name that a request gives.
fn asked(question: Rosapi, args: &Value) -> Result<Value, String> {
    let fields = args.as_object().unwrap();
    let name = fields.values().next().and_then(Value::as_str);
    answer(question, name.unwrap_or_default(), &census()).map_err(|why| why.to_string())
}

#[track_caller]
fn values(question: Rosapi) -> Value {
    asked(question, &json!({})).unwrap()
}

#[test]
fn every_question_has_the_answer_of_its_row() {
    let mut other = Vec::new();
    for row in ANSWERS.lines().filter(|row| row.contains(" => ")) {
        let (request, expected) = row.split_once(" => ").unwrap();
        let (name, args) = request.split_once(' ').unwrap();
        let mut questions = Rosapi::ALL.into_iter();
        let question = questions.find(|one| one.short_name() == name).expect(name);
        let found = match asked(question, &serde_json::from_str(args).unwrap()) {
            Ok(found) => found.to_string(),
            Err(why) => why,
        };
        if found != expected {
            other.push(format!("{request} => {found}"));
        }
    }
    assert!(other.is_empty(), "found:\n{}", other.join("\n"));
}

#[test]
fn every_node_is_listed() {
    let nodes = Node::ALL.map(|node| format!("/{}", node.name()));
    assert_eq!(values(Rosapi::Nodes), json!({"nodes": nodes}));
}

#[test]
fn services_are_listed_under_every_name_they_have() {
    let mut services: Vec<String> = Service::ALL.map(|one| one.name().to_owned()).to_vec();
    for question in Rosapi::ALL {
        for prefix in ["/rosapi/", "/rosapi_node/"] {
            services.push(format!("{prefix}{}", question.short_name()));
        }
    }
    services.extend(["/add".to_owned(), "/nameless".to_owned()]);
    assert_eq!(values(Rosapi::Services), json!({"services": services}));
}

#[test]
fn topics_are_the_runtimes_and_then_the_clients_each_with_its_type() {
    let mut topics: Vec<&str> = Topic::ALL.iter().map(|topic| topic.name()).collect();
    topics.extend(["/chat", "/wish"]);
    let mut types: Vec<&str> = Topic::ALL.iter().map(|topic| topic.type_name()).collect();
    types.extend(["std_msgs/String", ""]);
    let expected = json!({"topics": topics, "types": types});
    assert_eq!(values(Rosapi::Topics), expected);
    let mut raw = values(Rosapi::TopicsAndRawTypes);
    let texts = raw.as_object_mut().unwrap().remove("typedefs_full_text");
    assert_eq!(raw, expected);
    let texts = texts.unwrap().as_array().unwrap().clone();
    assert_eq!(texts.len(), topics.len());
    // The last two: a type that is known by its short name too, and none.
    assert_eq!(
        texts[topics.len() - 2..],
        [json!("string data\n"), json!("")]
    );
}

#[test]
fn the_interfaces_are_all_types_of_messages_services_and_actions() {
    let services = Service::ALL.map(Service::type_name);
    let questions = Rosapi::ALL.map(|question| Service::Rosapi(question).type_name());
    let actions = Action::ALL.map(Action::type_name);
    let messages = types::all().map(|one| one.name);
    let messages = messages.filter(|name| name.contains("/msg/"));
    let mut expected: Vec<&str> = messages
        .chain(services)
        .chain(questions)
        .chain(actions)
        .collect();
    expected.sort_unstable();
    expected.dedup();
    assert_eq!(values(Rosapi::Interfaces)["interfaces"], json!(expected));
    for topic in Topic::ALL {
        assert!(expected.contains(&topic.type_name()), "{topic:?}");
    }
}

#[test]
fn a_types_text_has_the_types_in_it_behind_lines_of_80_signs() {
    let line = "=".repeat(80);
    let expected = format!(
        "std_msgs/Header header\nstring[] name\nfloat64[] position  # rad\nfloat64[] velocity  # rad/s\n\
         float64[] effort  # N m\n{line}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp  # s, ns\nstring frame_id\n\
         {line}\nMSG: builtin_interfaces/Time\nint32 sec  # s\nuint32 nanosec  # ns\n"
    );
    let text = types::full_text("sensor_msgs/JointState").expect("a known type");
    assert_eq!(text, expected);
    assert_eq!(types::full_text("demo/X"), None);
}

#[test]
fn a_types_text_has_its_constants_first() {
    let begins = |name, expected| assert!(types::full_text(name).unwrap().starts_with(expected));
    begins("rcl_interfaces/msg/Log", "uint8 DEBUG=10\nuint8 INFO=20\n");
    begins(
        "diagnostic_msgs/DiagnosticStatus",
        "byte OK=0\nbyte WARN=1\n",
    );
}

//! The tables of docs/protocol.md against the catalog, and against the arm's defaults.

use std::collections::BTreeSet;

use super::codes;
use crate::papers::{table, text};
use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::Gains;
use pendularm::math::simulation::Simulation;
use pendularm::protocol::catalog::{Direction, Field, Rosapi, Service, Topic, types};
use pendularm::protocol::op;

#[test]
fn the_papers_list_every_topic_with_its_type_and_owner() {
    let rows = table(&text("docs/protocol.md"), "topic");
    assert_eq!(rows.len(), Topic::ALL.len());
    for (row, topic) in rows.iter().zip(Topic::ALL) {
        assert_eq!(codes(&row[0]), [topic.name()]);
        assert_eq!(codes(&row[1]), [topic.type_name()], "{}", topic.name());
        let (name, is_ours) = (topic.name(), topic.direction() == Direction::Published);
        assert_eq!(row[2].starts_with("any client"), !is_ours, "{name}");
        let is_owner = codes(&row[2]) == [topic.owner().name()];
        assert!(!is_ours || is_owner, "{name}");
    }
}

/// `tests/actors/exchanges/arm.txt` has the keys of a message.
#[test]
fn the_papers_list_the_keys_of_diagnostics() {
    let exchanges = text("tests/actors/exchanges/arm.txt");
    let sent = exchanges
        .lines()
        .find(|line| line.contains("\"key\":\"warning\""));
    let sent = sent.unwrap().split("{\"key\":\"").skip(1);
    let sent: Vec<&str> = sent.filter_map(|one| one.split('"').next()).collect();
    let rows = table(&text("docs/protocol.md"), "status");
    let listed: Vec<&str> = rows.iter().flat_map(|row| codes(&row[1])).collect();
    assert_eq!(listed, sent);
}

#[test]
fn the_papers_list_every_op() {
    let rows = table(&text("docs/protocol.md"), "op");
    let listed: Vec<&str> = rows.iter().map(|row| codes(&row[0])[0]).collect();
    let (mut listed, mut known) = (listed, op::OPS.to_vec());
    listed.sort_unstable();
    known.sort_unstable();
    assert_eq!(listed, known);
}

#[test]
fn the_papers_list_the_fields_of_our_own_messages() {
    let rows = table(&text("docs/protocol.md"), "message");
    let ours = |name: &str| name.starts_with("pendularm_interfaces/msg/");
    let topics = Topic::ALL.into_iter().map(Topic::type_name);
    for name in topics.filter(|name| ours(name)) {
        assert!(rows.iter().any(|row| codes(&row[0]) == [name]), "{name}");
    }
    for row in &rows {
        let name = codes(&row[0])[0];
        let fields = types::find(name).expect(name).fields;
        let names: Vec<&str> = fields.iter().map(|field| field.name).collect();
        let written: Vec<&str> = codes(&row[1]);
        let written: Vec<&str> = written.into_iter().filter(|code| *code != "null").collect();
        assert_eq!(written, names, "{name}");
    }
}

#[test]
fn the_papers_list_every_service_with_its_fields_in_order() {
    let rows = table(&text("docs/protocol.md"), "service");
    let listed: BTreeSet<&str> = rows.iter().flat_map(|row| codes(&row[0])).collect();
    let served: BTreeSet<&str> = Service::ALL.iter().map(|service| service.name()).collect();
    assert_eq!(listed, served);
    for row in &rows {
        let service = Service::from_name(codes(&row[0])[0]).unwrap();
        let fields = service.fields().iter();
        let expected: Vec<_> = fields.map(|field| (field.name, field.required)).collect();
        let is_required = |name: &str| !row[1].contains(&format!("*`{name}`*"));
        let names = codes(&row[1]).into_iter();
        let written: Vec<_> = names.map(|name| (name, is_required(name))).collect();
        assert_eq!(written, expected, "{}", service.name());
        // Explanations follow a colon.
        let said = row[2].split(':').next().unwrap();
        let echoes = ["both", "all three", "the three"];
        let values: Vec<&str> = if echoes.iter().any(|all| said.starts_with(all)) {
            written.iter().map(|(name, _)| *name).collect()
        } else {
            codes(said)
        };
        let fields = service.response_fields().iter();
        let fields: Vec<&str> = fields.map(|field| field.name).collect();
        assert_eq!(values, fields, "{}", service.name());
        if service == Service::SetIntegrator {
            let names = codes(&row[2]).into_iter();
            let methods: Vec<Method> = names.filter_map(|name| name.parse().ok()).collect();
            assert_eq!(methods, Method::ALL);
        }
    }
}

#[cfg(feature = "web")]
#[test]
fn the_papers_list_every_question_of_rosapi_with_its_fields_in_order() {
    let rows = table(&text("docs/protocol.md"), "rosapi");
    assert_eq!(rows.len(), Rosapi::ALL.len());
    for (row, question) in rows.iter().zip(Rosapi::ALL) {
        let service = Service::Rosapi(question);
        assert_eq!(codes(&row[0]), [question.short_name()]);
        let names = |fields: &[Field]| -> Vec<&str> { fields.iter().map(|one| one.name).collect() };
        assert_eq!(codes(&row[1]), names(service.fields()), "{question:?}");
        let values = names(service.response_fields());
        assert_eq!(codes(&row[2]), values, "{question:?}");
    }
}

/// The column of an arm of `N` links in the table of defaults.
fn defaults<const N: usize>() -> Vec<String> {
    let gains = Gains::<N>::default();
    let simulation = Simulation::new(Arm::<N>::default(), gains);
    let arm = simulation.arm();
    let list = |values: &[f64]| {
        let values: Vec<String> = values.iter().map(f64::to_string).collect();
        values.join(", ")
    };
    let [masses, lengths] = [arm.masses(), arm.lengths()].map(|values| {
        assert!(values.iter().all(|value| *value == values[0]));
        values[0]
    });
    vec![
        list(&[arm.gravity(), masses, lengths]),
        format!("`{}`, {}", simulation.method(), simulation.timestep()),
        list(&gains.kp),
        list(&gains.ki),
        list(&gains.kd),
    ]
}

#[test]
fn the_papers_list_the_arms_defaults() {
    let rows = table(&text("docs/protocol.md"), "default");
    let column = |k: usize| rows.iter().map(|row| row[k].clone()).collect::<Vec<_>>();
    assert_eq!(column(1), defaults::<2>());
    assert_eq!(column(2), defaults::<3>());
}

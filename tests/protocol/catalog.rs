//! The list of topics and services is consistent, and marks the exceptions.
//!
//! **Invariant:** `tests/house/readme/protocol.rs` compares its rows with docs/protocol.md.

use std::collections::HashSet;

use pendularm::protocol::catalog::{Service, Topic, types};

/// A topic that changes seldom must reach late subscribers.
#[test]
fn the_fixed_frames_and_the_descriptions_are_latched_and_nothing_else_is() {
    let latched: Vec<_> = Topic::ALL
        .into_iter()
        .filter(|topic| topic.is_latched())
        .collect();
    let lasting = [
        Topic::TfStatic,
        Topic::RobotDescription,
        Topic::RobotSemantics,
    ];
    assert_eq!(latched, lasting);
}

#[test]
fn parts_of_a_question_have_the_members_that_their_services_have_as_fields() {
    for service in [Service::Stability, Service::Rollout] {
        for field in service.fields() {
            let members = match field.name {
                "gains" => Service::SetGains.fields(),
                "params" => Service::SetParams.fields(),
                "limits" => Service::SetLimits.fields(),
                "sensors" => Service::SetSensors.fields(),
                // No service sets it.
                "tableau" => continue,
                _ => &[],
            };
            assert_eq!(types::members(field), members, "{field:?}");
        }
    }
}

#[test]
fn a_name_leads_back_to_what_it_names() {
    for topic in Topic::ALL {
        assert_eq!(Topic::from_name(topic.name()), Some(topic));
        assert_eq!(Topic::from_name(topic.short_name()), Some(topic));
        assert_eq!(Service::from_name(topic.name()), None);
    }
    for service in Service::ALL {
        assert_eq!(Service::from_name(service.name()), Some(service));
        assert_eq!(Topic::from_name(service.name()), None);
    }
    for other in ["", "/", "//joint_states", "/joint_states/", "/arm_sim"] {
        assert_eq!(Topic::from_name(other), None);
        assert_eq!(Service::from_name(other), None);
    }
}

#[test]
fn names_and_types_are_given_once_and_in_the_form_that_ros_gives_them() {
    let topics = Topic::ALL.map(|topic| (topic.name(), topic.type_name(), "msg"));
    let services = Service::ALL.map(|service| (service.name(), service.type_name(), "srv"));
    let mut seen = HashSet::new();
    for (name, type_name, kind) in topics.into_iter().chain(services) {
        // Moving and fixed frames have the same type, and so have all texts, and true and measured states.
        let shares = [
            "/tf_static",
            "/robot_description_semantic",
            "/joint_states_measured",
        ]
        .contains(&name);
        assert!(
            seen.insert(name) && (seen.insert(type_name) || shares),
            "{name} or {type_name} is listed twice"
        );
        let parts: Vec<&str> = type_name.split('/').collect();
        assert!(
            matches!(parts[..], [_, middle, _] if middle == kind),
            "{type_name}"
        );
    }
}

#[test]
fn a_field_is_listed_once_and_numbers_have_a_unit() {
    let topics = Topic::ALL.into_iter().map(Topic::fields);
    let requests = Service::ALL.into_iter().map(Service::fields);
    let responses = Service::ALL.into_iter().map(Service::response_fields);
    for fields in topics.chain(requests).chain(responses) {
        let distinct: HashSet<&str> = fields.iter().map(|field| field.name).collect();
        assert_eq!(distinct.len(), fields.len(), "{fields:?}");
        for field in fields
            .iter()
            .filter(|field| field.kind.starts_with("float64"))
        {
            assert!(!field.unit.is_empty(), "{field:?}");
        }
    }
}

#[test]
fn a_type_is_found_with_and_without_its_middle_part_and_with_no_other() {
    for one in types::all() {
        let found = |name: &str| types::find(name).map(|found| found.name);
        let [package, middle, last] = one.name.split('/').collect::<Vec<_>>()[..] else {
            panic!("{}", one.name);
        };
        assert_eq!(found(one.name), Some(one.name));
        assert_eq!(found(&format!("{package}/{last}")), Some(one.name));
        for other in ["srv", "action", ""].map(|part| format!("{package}/{part}/{last}")) {
            let is_other = middle != other.split('/').nth(1).unwrap_or_default();
            assert!(!is_other || found(&other).is_none(), "{other}");
        }
        assert_eq!(found(&format!("{}/", one.name)), None);
    }
}

/// Messages are encoded by a walk through their types, which must end.
#[test]
fn no_type_has_itself_inside() {
    fn walk(one: types::Type, above: &mut Vec<&'static str>) {
        assert!(!above.contains(&one.name), "{above:?}: {}", one.name);
        above.push(one.name);
        for field in one.fields {
            if let Some(inside) = types::find(field.element().0) {
                walk(inside, above);
            }
        }
        above.pop();
    }
    for one in types::all() {
        walk(one, &mut Vec::new());
    }
}

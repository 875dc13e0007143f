//! Refusals of fields: one table of all services, in virtual time.
//!
//! `rows.txt` has the table for 2 links. A row is a service, a field, a literal for it, and the status that the client gets.

use std::collections::{BTreeMap, BTreeSet};

use crate::stage::Stage;
use crate::system::in_virtual_time;
use crate::virtual_time::Client;
use pendularm::protocol::catalog::Service;
use serde_json::{Value, json};

/// The name of a record, whose service needs a disk.
const WITHOUT_ROWS: &str = "name";

/// Services that apply each field separately, with valid values that differ from the present ones.
const FIELD_BY_FIELD: [(&str, &str); 10] = [
    (
        "/arm_sim/set_integrator",
        r#"{"method":"euler","timestep":0.002}"#,
    ),
    (
        "/arm_sim/set_params",
        r#"{"gravity":2.0,"masses":[2.0,3.0],"lengths":[0.5,0.25]}"#,
    ),
    ("/arm_sim/set_friction", r#"{"viscous":[0.5,0.25]}"#),
    ("/arm_sim/pause", r#"{"data":true}"#),
    (
        "/arm_sim/set_state",
        r#"{"position":[0.1,0.2],"velocity":[0.3,0.4]}"#,
    ),
    ("/pid_controller/enable", r#"{"data":true}"#),
    (
        "/pid_controller/set_gains",
        r#"{"kp":[1.0,2.0],"ki":[3.0,4.0],"kd":[5.0,6.0]}"#,
    ),
    (
        "/pid_controller/set_period",
        r#"{"period":0.02,"delay":true}"#,
    ),
    (
        "/pid_controller/set_limits",
        r#"{"effort":[25.0,10.0],"anti_windup":"conditional","tracking_time":0.5}"#,
    ),
    (
        "/pid_controller/set_sensors",
        r#"{"encoder_step":[0.001,0.0],"velocity":"difference","delay":2}"#,
    ),
];

/// Service, field, literal, status.
type Row = [&'static str; 4];

fn rows(table: &'static str) -> Vec<Row> {
    let row = |line: &'static str| line.splitn(4, " | ").collect::<Vec<_>>().try_into();
    table.lines().map(|line| row(line).unwrap()).collect()
}

fn rows_of_2_links() -> Vec<Row> {
    rows(include_str!("rows.txt"))
}

/// The first row of each field, in the order of the catalogue.
fn first_rows(service: Service) -> Vec<Row> {
    let rows = rows_of_2_links();
    let of = |name: &str| {
        rows.iter()
            .find(|row| row[0] == service.name() && row[1] == name)
    };
    let fields = service.fields().iter();
    fields.filter_map(|field| of(field.name)).copied().collect()
}

/// The nodes of all services but the recorder; the arm is paused.
async fn start<const N: usize>() -> (Stage<N>, Client) {
    let stage = Stage::start().await;
    stage.compute();
    let mut client = stage.connect();
    call(&mut client, "/arm_sim/pause", "{\"data\":true}").await;
    call(&mut client, "/arm_sim/reset", "{}").await;
    (stage, client)
}

async fn call(client: &mut Client, service: &str, args: &str) -> Value {
    let frame = format!("{{\"op\":\"call_service\",\"service\":\"{service}\",\"args\":{args}}}");
    client.send_text(&frame).await;
    client
        .receive_where(|frame| frame["op"] == "service_response")
        .await
}

/// All settings, as their services return them.
async fn settings(client: &mut Client) -> BTreeMap<&'static str, Value> {
    let mut settings = BTreeMap::new();
    for (service, _) in FIELD_BY_FIELD {
        let answer = call(client, service, "{}").await;
        assert_eq!(
            (&answer["result"], &answer["status"]),
            (&json!(true), &json!(""))
        );
        settings.insert(service, answer["values"].clone());
    }
    // A query would start a trial.
    let trial = json!({"duration": 60.0, "epsilon": 0.02, "success_hold": 0.5});
    settings.insert("/ik_trial/start", trial);
    settings
}

/// A valid value for every required field.
fn required(service: &str) -> &'static [(&'static str, &'static str)] {
    match service {
        "/arm_sim/integration_step" => &[
            ("function", "\"t\""),
            ("x0", "0"),
            ("dt", "0.1"),
            ("steps", "3"),
            ("integrator", "\"rk4\""),
        ],
        "/arm_sim/step" => &[("steps", "1")],
        "/arm_sim/disturb" => &[("effort", "[1,1]"), ("duration", "1")],
        "/ik/solve" | "/ik_action/send_goal" => &[("x", "1"), ("y", "1")],
        "/study/held_limit" => &[("mass_matrix", "[1]")],
        "/study/method" => &[("tableau", "{\"name\":\"rk4\"}")],
        "/study/plan" => &[("error", "0.001")],
        "/arm_sim/get_parameters"
        | "/arm_sim/get_parameter_types"
        | "/arm_sim/describe_parameters" => &[("names", "[]")],
        "/arm_sim/set_parameters" => &[("parameters", "[]")],
        _ => &[],
    }
}

/// The required fields, with some replaced or added.
fn request(service: &str, changes: &[(&str, &str)]) -> String {
    let is_kept = |(name, _): &&(&str, &str)| changes.iter().all(|(field, _)| field != name);
    let kept = required(service).iter().filter(is_kept);
    let members: Vec<String> = kept
        .chain(changes)
        .map(|(name, value)| format!("\"{name}\":{value}"))
        .collect();
    format!("{{{}}}", members.join(","))
}

async fn assert_refused(client: &mut Client, rows: &[Row]) {
    let before = settings(client).await;
    for [service, field, literal, status] in rows {
        let answer = call(client, service, &request(service, &[(field, literal)])).await;
        assert_eq!(answer["status"], *status, "{service} {field} {literal}");
        assert_eq!(answer["result"], false, "{service} {field} {literal}");
        let nothing = json!({});
        let values = before.get(service).unwrap_or(&nothing);
        assert_eq!(&answer["values"], values, "{service} {field} {literal}");
    }
    assert_eq!(settings(client).await, before, "nothing has changed");
}

#[test]
fn every_bad_literal_is_refused_with_its_row_and_changes_nothing() {
    in_virtual_time(async {
        let (_stage, mut client) = start::<2>().await;
        assert_refused(&mut client, &rows_of_2_links()).await;
        let (_stage, mut client) = start::<3>().await;
        assert_refused(&mut client, &rows(include_str!("rows_3_links.txt"))).await;
    });
}

#[test]
fn every_field_of_every_service_has_a_row() {
    let mut rows = rows_of_2_links();
    rows.extend(self::rows(include_str!("rows_3_links.txt")));
    for service in Service::ALL {
        let fields = service.fields().iter().map(|field| field.name);
        for field in fields.filter(|name| *name != WITHOUT_ROWS) {
            let has_row = rows
                .iter()
                .any(|row| row[0] == service.name() && row[1] == field);
            assert!(has_row, "{} {field} has no row in rows.txt", service.name());
        }
    }
}

#[test]
fn all_that_is_wrong_is_listed_at_once() {
    in_virtual_time(async {
        let (_stage, mut client) = start::<2>().await;
        for service in Service::ALL {
            let rows = first_rows(service);
            let bad: Vec<_> = rows.iter().map(|row| (row[1], row[2])).collect();
            if bad.is_empty() {
                continue;
            }
            let answer = call(&mut client, service.name(), &request(service.name(), &bad)).await;
            let mut got: Vec<&str> = answer["status"].as_str().unwrap().split("; ").collect();
            let mut statuses: Vec<&str> = rows.iter().map(|row| row[3]).collect();
            got.sort_unstable();
            statuses.sort_unstable();
            assert_eq!(got, statuses, "{service:?}");
        }
    });
}

/// So each service is served, and answers as its row in the catalogue says. `tests/wire/record.rs` has the recorder, and
/// `tests/actors/exchanges/mod.rs` the answers of rosapi.
#[test]
fn every_service_needs_its_required_fields_and_answers_with_those_of_its_row() {
    in_virtual_time(async {
        let (_stage, mut client) = start::<2>().await;
        let served = Service::ALL.into_iter();
        for service in served.filter(|one| !one.name().starts_with("/recorder")) {
            let name = service.name();
            let answer = call(&mut client, name, "5").await;
            let status = answer["status"].as_str().unwrap();
            let whole = "args must be an object or an array, got 5";
            assert!(status.starts_with(whole), "{service:?}: {status}");
            let names = required(name).iter().map(|(name, _)| name);
            let statuses: Vec<String> = names.map(|name| format!("{name} is required")).collect();
            if !statuses.is_empty() {
                let answer = call(&mut client, name, "{}").await;
                assert_eq!(answer["status"], statuses.join("; "), "{service:?}");
                assert_eq!(answer["values"], json!({}), "{service:?}");
            }
            if !matches!(service, Service::Rosapi(_)) {
                let is_run = service.fields().iter().any(|one| one.name == "duration");
                let short = is_run.then_some(("duration", "0.1"));
                let answer = call(&mut client, name, &request(name, short.as_slice())).await;
                assert_eq!(answer["result"], true, "{answer}");
                let written = answer["values"].as_object().unwrap().keys();
                let listed = service.response_fields().iter().map(|field| field.name);
                let listed: BTreeSet<&str> = listed.collect();
                assert_eq!(
                    written.map(String::as_str).collect::<BTreeSet<_>>(),
                    listed,
                    "{name}"
                );
            }
        }
    });
}

#[test]
fn valid_fields_take_effect_beside_a_rejected_one() {
    in_virtual_time(async {
        for (service, good) in FIELD_BY_FIELD {
            let good: Value = serde_json::from_str(good).unwrap();
            for row in first_rows(Service::from_name(service).unwrap()) {
                let (_stage, mut client) = start::<2>().await;
                let mut expected = call(&mut client, service, "{}").await["values"].clone();
                let others = good.as_object().unwrap().iter();
                let others: Vec<_> = others.filter(|(name, _)| *name != row[1]).collect();
                let texts: Vec<String> =
                    others.iter().map(|(_, value)| value.to_string()).collect();
                let mut members = vec![(row[1], row[2])];
                for ((name, value), text) in others.iter().zip(&texts) {
                    members.push((name.as_str(), text));
                    expected[name.as_str()] = (*value).clone();
                }
                let answer = call(&mut client, service, &request(service, &members)).await;
                assert_eq!(answer["status"], row[3], "{service}");
                for name in good.as_object().unwrap().keys() {
                    assert_eq!(answer["values"][name], expected[name], "{service} {row:?}");
                }
            }
        }
    });
}

//! The suite of the specification against this program: every rule holds, and every rule can fail.

#![allow(
    clippy::cast_possible_truncation,
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    dead_code,
    unreachable_pub,
    reason = "a test that panics has failed; programs share their helpers"
)]

#[path = "../support/common.rs"]
#[rustfmt::skip]
mod common;
mod causes;
mod paper;
#[path = "../support/papers.rs"]
#[rustfmt::skip]
mod papers;
mod program;
mod wrong;

use std::collections::BTreeSet;
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use pendularm_conformance::bench::Found;
use pendularm_conformance::sabotage::faults::{self, Planted};
use pendularm_conformance::sabotage::proxy::{Fault, Proxy, Side};
use pendularm_conformance::{Results, Row, Rule, Selection, report, rules, run};
use serde_json::Value;

use common::Runtime;

/// Programs that are tested at once. A rule waits longer than it computes.
const WORKERS: usize = 16;

/// The results of `try_one` for each item, at several programs at once.
fn of_each<T: Sync, R: Send>(links: usize, items: &[T], try_one: impl Fn(&Runtime, &T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let work = || {
        let program = Runtime::with_links(links);
        let mut results = Vec::new();
        while let Some(item) = items.get(next.fetch_add(1, Ordering::Relaxed)) {
            results.push(try_one(&program, item));
        }
        results
    };
    thread::scope(|scope| {
        let workers: Vec<_> = (0..WORKERS).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect()
    })
}

fn all_hold(links: usize) {
    let ids: Vec<&str> = rules::all().filter(|rule| rule.applies_to(links)).map(|rule| rule.id).collect();
    let rows: Vec<Row> = of_each(links, &ids, |program, id| {
        let selection = Selection { rule: Some((*id).to_owned()), ..Selection::default() };
        let results = run(&program.address.to_string(), &selection, |_, _| {}).unwrap();
        assert_eq!(results.notes, [""; 0], "{id}");
        results.rows.into_iter().find(|row| row.rule.id == *id).unwrap()
    });
    let failing: Vec<String> = rows.iter().filter(|row| !row.holds()).map(report::paragraph).collect();
    assert!(failing.is_empty(), "{}", failing.join("\n"));
    assert!(rows.len() > 130, "{} rules alone", rows.len());
}

#[test]
fn every_rule_holds_for_2_links() {
    all_hold(2);
}

#[test]
fn every_rule_holds_for_3_links() {
    all_hold(3);
}

/// A check without a rule would never run, and a rule without a check would be left out.
#[test]
fn every_rule_has_a_check_and_every_fault_a_rule() {
    let ids: Vec<&str> = rules::all().map(|rule| rule.id).collect();
    let distinct: BTreeSet<&str> = ids.iter().copied().collect();
    let checks: BTreeSet<&str> = rules::checks().map(|(id, _)| *id).collect();
    assert_eq!((ids.len(), &checks), (149, &distinct));
    assert!(rules::all().all(|rule| rule.counts() || rule.category == "Remarks"));
    let planted = faults::all();
    let mut faults = planted.iter().map(|planted| planted.rule);
    assert_eq!(faults.find(|rule| !distinct.contains(rule)), None);
}

/// Planted faults that are a mistake of the table, and a part of its description. For the others a cause would be false.
const CAUSES: [(&str, &str); 19] = [
    ("the integral does not reach the effort", "the integral term is missing"),
    ("the live arm keeps its masses", "the masses of the links are not used"),
    ("does not wait", "the goal is reached at the first entry"),
    ("division is right-associative", "/ is right-associative"),
    ("minus is right-associative", "- is right-associative"),
    ("ignores parentheses", "parentheses are ignored"),
    ("^ is left-associative", "^ is left-associative"),
    ("ln is the decimal logarithm", "ln is the decimal logarithm"),
    ("euler is midpoint", "midpoint instead of euler"),
    ("midpoint is verlet", "verlet instead of midpoint"),
    ("verlet is midpoint", "midpoint instead of verlet"),
    ("rk4 is verlet", "verlet instead of rk4"),
    ("rk4 is midpoint", "midpoint instead of rk4"),
    ("ignores the timestep", "the timestep is 0.001 s"),
    ("ignores velocities", "the derivative term ignores the velocity of the setpoint"),
    ("euler is semi-implicit, as verlet for a constant force", "verlet instead of euler"),
    ("keeps the integral while disabled", "enable does not clear the integral"),
    ("steps by euler at 10 ms", "euler instead of rk4"),
    ("the load does not follow from the lengths", "the lengths of the links are not used"),
];

/// The outcome of a rule against a server with a fault: nothing if it fails for the fault. On a busy machine the suite
/// may fail to prepare the arm. That is no result, so the rule is tried again.
fn escapes(program: &Runtime, found: &Found, planted: &Planted, links: usize) -> Option<String> {
    let mut outcome = String::new();
    for _ in 0..3 {
        let proxy = Proxy::start(&program.address.to_string(), planted.fault(links)).unwrap();
        let selection = Selection { rule: Some(planted.rule.to_owned()), ..Selection::default() };
        let rows = run(&proxy.address, &selection, |_, _| {}).map(|results| results.rows);
        // Without the proxy, so the next fault meets the server in its initial state.
        found.restore(&program.address.to_string());
        match rows.as_deref() {
            Ok([row]) => match &row.got {
                Err(why) if !why.starts_with("while preparing") => {
                    println!("{links} links, {}: {}: {why}", planted.rule, planted.says);
                    let is_true = |cause: &String| CAUSES.iter().any(|(says, of)| *says == planted.says && cause.contains(of));
                    let accused = row.cause.iter().find(|cause| !is_true(cause));
                    return accused.map(|cause| format!("{}: {}: a false cause: {cause}", planted.rule, planted.says));
                }
                Ok(got) => return Some(format!("{}: {}: holds: {got}", planted.rule, planted.says)),
                Err(why) => outcome = why.clone(),
            },
            rows => outcome = format!("{rows:?}"),
        }
    }
    Some(format!("{}: {}: {outcome}", planted.rule, planted.says))
}

/// Rules for arms of any size are tried with 2 links.
fn each_fails(links: usize) {
    let is_tried = |rule: &Rule| rule.applies_to(links) && (links == 2 || !rule.applies_to(2));
    let ids: BTreeSet<&str> = rules::all().filter(is_tried).map(|rule| rule.id).collect();
    let mut planted = faults::all();
    planted.retain(|planted| ids.contains(planted.rule));
    let covered: BTreeSet<&str> = planted.iter().map(|planted| planted.rule).collect();
    let without: Vec<_> = ids.difference(&covered).collect();
    assert!(without.is_empty(), "rules without a fault: {without:?}");
    let outcomes = of_each(links, &planted, |program, planted| {
        let found = Found::at(&program.address.to_string(), &Arc::default()).unwrap();
        escapes(program, &found, planted, links)
    });
    let escaped: Vec<String> = outcomes.into_iter().flatten().collect();
    assert!(escaped.is_empty(), "{} of {} faults escape:\n{}", escaped.len(), planted.len(), escaped.join("\n"));
}

#[test]
fn every_rule_fails_for_a_planted_fault_with_2_links() {
    each_fails(2);
}

#[test]
fn every_rule_fails_for_a_planted_fault_with_3_links() {
    each_fails(3);
}

#[test]
fn a_port_without_a_server_and_a_silent_server_are_reported_soon() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let began = Instant::now();
    let report = || run(&address, &Selection::default(), |_, _| {}).unwrap_err();
    let silent = report();
    assert!(silent.contains("it gave no answer to a call"), "{silent}");
    drop(listener);
    let absent = report();
    assert!(absent.contains("no connection"), "{absent}");
    assert!(began.elapsed() < Duration::from_secs(10));
}

/// Like an unfinished server, on which the rules of the other sections can be tried. The first one is for the checkpoint.
#[test]
fn services_that_never_answer_fail_their_own_rules_alone() {
    let program = Runtime::start();
    for (missing, rule) in [("/arm_sim/set_ /arm_sim/r /pid /joint /ik", "method"), ("/ik_ /arm_sim/r", "gains-1")] {
        let is_missing = move |name: &Value| missing.split(' ').any(|start| name.as_str().is_some_and(|name| name.starts_with(start)));
        let fault: Fault =
            Box::new(move |_, frame| if is_missing(&frame["service"]) || is_missing(&frame["topic"]) { vec![] } else { vec![frame] });
        let proxy = Proxy::start(&program.address.to_string(), fault).unwrap();
        let selection = Selection { rule: Some(rule.to_owned()), ..Selection::default() };
        let rows = run(&proxy.address, &selection, |_, _| {}).unwrap().rows;
        assert!(!rows.is_empty() && rows.iter().all(Row::holds), "{rows:?}");
    }
}

#[test]
fn answers_of_the_wrong_types_fail_the_rules_and_nothing_else() {
    let program = Runtime::start();
    let mut asked = 0;
    let fault: Fault = Box::new(move |side, mut frame| {
        if side == Side::Server {
            asked += 1;
            for (at, name) in ["values", "result", "status", "msg"].into_iter().enumerate() {
                // The first answers have the number of links.
                if asked > 20
                    && let Some(member) = frame.get_mut(name)
                {
                    *member = [Value::Null, 7.into(), "x".into(), Value::Array(vec![])][(asked + at) % 4].clone();
                }
            }
        }
        vec![frame]
    });
    let proxy = Proxy::start(&program.address.to_string(), fault).unwrap();
    let selection = Selection { category: Some("pid".to_owned()), ..Selection::default() };
    let rows = run(&proxy.address, &selection, |_, _| {}).unwrap().rows;
    let holding: Vec<String> = rows.iter().filter(|row| row.holds()).map(report::line).collect();
    assert!(!rows.is_empty() && holding.len() < 3, "{}", holding.join("\n"));
}

/// The results against our server behind a fault that is made of the frames of the server alone.
fn behind(change: impl FnMut(&mut Value) -> bool + Send + 'static, selection: &Selection) -> Results {
    let (program, mut change) = (Runtime::start(), change);
    let fault: Fault = Box::new(move |side, mut frame| if side == Side::Client || change(&mut frame) { vec![frame] } else { vec![] });
    run(&Proxy::start(&program.address.to_string(), fault).unwrap().address, selection, |_, _| {}).unwrap()
}

fn failing(results: &Results) -> Vec<&str> {
    results.rows.iter().filter(|row| !row.holds()).map(|row| row.rule.id).collect()
}

fn selected(rule: &str) -> Selection {
    Selection { rule: Some(rule.to_owned()), ..Selection::default() }
}

#[test]
fn an_answer_without_an_id_or_with_another_is_used_and_charged_to_the_envelope_alone() {
    let without = |frame: &mut Value| {
        frame.as_object_mut().unwrap().retain(|name, _| name != "id");
        true
    };
    let another = |frame: &mut Value| {
        let is_refusal = frame["result"] == false;
        frame["id"] = if is_refusal { "another".into() } else { frame["id"].take() };
        true
    };
    for rule in ["envelope", "checkpoint", "gains"] {
        let charged: &[&str] = if rule == "envelope" { &["envelope-1", "envelope-3"] } else { &[] };
        assert_eq!(failing(&behind(without, &selected(rule))), charged, "{rule}");
        let charged: &[&str] = if rule == "envelope" { &["envelope-3"] } else { &[] };
        assert_eq!(failing(&behind(another, &selected(rule))), charged, "{rule}");
    }
    let results = behind(without, &selected("envelope-3"));
    assert!(report::summary(&results).contains("an answer came, but without id"));
}

#[test]
fn a_missing_service_earns_nothing_for_refusing_and_is_told_once() {
    let missing = |frame: &mut Value| {
        if frame["service"].as_str().is_some_and(|name| name.starts_with("/ik")) {
            (frame["result"], frame["values"], frame["status"]) =
                (false.into(), Value::Object(Default::default()), "no such service".into());
        }
        true
    };
    let results = behind(missing, &Selection { category: Some("inverse".to_owned()), ..Selection::default() });
    assert_eq!(report::count(&results, "Inverse kinematics").0, 0, "{}", report::summary(&results));
    let (groups, rest) = report::failures(&results);
    assert!(rest.is_empty() && groups.len() == 1, "{}", report::summary(&results));
    assert!(groups[0].0.contains("/ik/solve") && groups[0].0.contains("which the server lacks"), "{}", groups[0].0);
    assert!(report::summary(&results).lines().all(|line| line.chars().count() <= 120));
}

#[test]
fn a_service_is_waited_for_three_times() {
    let silent = |frame: &mut Value| frame["service"] != "/arm_sim/integration_step";
    let began = Instant::now();
    let results = behind(silent, &selected("function"));
    assert_eq!(failing(&results).len(), 14);
    assert!(began.elapsed() < Duration::from_secs(20), "{:?}", began.elapsed());
}

#[test]
fn half_the_speed_and_10_messages_a_second_are_remarks() {
    let mut count = 0;
    let slow = move |frame: &mut Value| {
        if frame["topic"] == "/joint_states" {
            let stamp = &mut frame["msg"]["header"]["stamp"];
            let half = (stamp["sec"].as_f64().unwrap() + 1e-9 * stamp["nanosec"].as_f64().unwrap()) / 2.0;
            (stamp["sec"], stamp["nanosec"]) = (half.floor().into(), (1e9 * half.fract()).floor().into());
            count += 1;
        }
        frame["topic"] != "/joint_states" || count % 6 == 0
    };
    let results = behind(slow, &selected("pace"));
    assert_eq!(failing(&results), ["pace-1", "pace-2"]);
    assert!(results.is_good() && report::count(&results, "") == (0, 0), "a remark does not count");
    assert!(report::summary(&results).contains("remark: Simulation time runs at wall time"), "{}", report::summary(&results));
}

#[test]
fn a_used_server_is_not_accused_of_its_user() {
    let program = Runtime::start();
    let mut client = common::Client::to(program.address);
    client.send(&serde_json::json!({"op": "call_service", "service": "/pid_controller/enable", "args": {"data": true}}));
    let points = serde_json::json!([{"positions": [0.5, -0.5]}]);
    client.send(&serde_json::json!({"op": "publish", "topic": "/joint_trajectory", "msg": {"points": points}}));
    thread::sleep(Duration::from_millis(700));
    let results = run(&program.address.to_string(), &selected("enable-1"), |_, _| {}).unwrap();
    assert!(results.is_good() && results.rows[0].is_aside, "{}", report::summary(&results));
    let why = results.rows[0].got.as_ref().unwrap_err();
    assert!(why.contains("a fresh server"), "{why}");
}

#[test]
fn a_controller_that_stays_on_is_not_accused_of_its_integral() {
    for says in ["cannot be disabled", "keeps the effort while paused"] {
        let (program, planted) = (Runtime::start(), faults::all().into_iter().find(|planted| planted.says == says).unwrap());
        let proxy = Proxy::start(&program.address.to_string(), planted.fault(2)).unwrap();
        let rows = run(&proxy.address, &selected("enable"), |_, _| {}).unwrap().rows;
        let causes: Vec<&String> = rows.iter().filter_map(|row| row.cause.as_ref()).collect();
        assert!(rows.iter().any(Row::fails) && causes.is_empty(), "{says}: {causes:?}");
    }
}

#[test]
fn a_setting_that_the_server_does_not_take_back_is_told() {
    let mut calls = 0;
    let forgets = move |frame: &mut Value| {
        calls += usize::from(frame["service"] == "/pid_controller/set_gains");
        if calls > 1 && frame["service"] == "/pid_controller/set_gains" {
            frame["values"]["kp"][0] = 99.0.into();
        }
        true
    };
    let results = behind(forgets, &selected("pause-2"));
    assert!(results.notes.iter().any(|note| note.starts_with("/pid_controller/set_gains is not restored: kp was")), "{:?}", results.notes);
    assert!(!results.is_good());
}

#[test]
fn wrong_equations_are_told_before_the_rules_that_rest_on_them() {
    // As if the arm's links were shorter than it says.
    let program = Runtime::start();
    let fault: Fault = Box::new(|side, mut frame| {
        if side == Side::Client && frame["service"] == "/arm_sim/set_params" && frame["args"].get("masses").is_some() {
            frame["args"]["lengths"] = serde_json::json!([0.8, 0.7]);
        }
        vec![frame]
    });
    let proxy = Proxy::start(&program.address.to_string(), fault).unwrap();
    let selection = Selection { category: Some("dynamics and".to_owned()), ..Selection::default() };
    let results = run(&proxy.address, &selection, |_, _| {}).unwrap();
    let (groups, _) = report::failures(&results);
    let told: Vec<String> = groups.iter().map(|(reason, rows)| format!("{reason}: {}", report::ids(rows))).collect();
    let expected = "rest on the equations of motion: mend the rules dynamics-2 to -7 first: set_integrator-6, -7, -8, -9";
    assert!(told.iter().any(|told| told.contains(expected)), "{told:?}");
}

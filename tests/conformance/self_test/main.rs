//! The suite of the specification against this program: every rule holds, and every rule can fail.

#![allow(
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    dead_code,
    unreachable_pub,
    reason = "a test that panics has failed; programs share their helpers"
)]

#[path = "../../support/common.rs"]
#[rustfmt::skip]
mod common;
mod faults;
mod proxy;

use std::collections::BTreeSet;
use std::net::TcpListener;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use pendularm_conformance::bench::Found;
use pendularm_conformance::{CATEGORIES, Row, Rule, Selection, rules, run, totals};
use serde_json::Value;

use common::Runtime;
use faults::Planted;
use proxy::{Fault, Proxy, Side};

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
        let mut rows = run(&program.address.to_string(), &selection, |_| {}).unwrap();
        rows.retain(|row| row.rule.id == *id);
        rows.pop().unwrap()
    });
    let failing: Vec<String> = rows.iter().filter(|row| !row.holds()).map(Row::to_string).collect();
    assert!(failing.is_empty(), "{}\n{}", failing.join("\n"), totals(&rows));
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
    assert_eq!((ids.len(), &checks), (147, &distinct));
    assert!(rules::all().all(|rule| CATEGORIES.contains(&rule.category)));
    let planted = faults::all();
    let mut faults = planted.iter().map(|planted| planted.rule);
    assert_eq!(faults.find(|rule| !distinct.contains(rule)), None);
}

/// The outcome of a rule against a server with a fault: nothing if it fails for the fault. On a busy machine the suite
/// may fail to prepare the arm. That is no result, so the rule is tried again.
fn escapes(program: &Runtime, found: &Found, planted: &Planted, links: usize) -> Option<String> {
    let mut outcome = String::new();
    for _ in 0..3 {
        let proxy = Proxy::start(&program.address.to_string(), planted.fault(links));
        let selection = Selection { rule: Some(planted.rule.to_owned()), ..Selection::default() };
        let rows = run(&proxy.address, &selection, |_| {});
        // Without the proxy, so the next fault meets the server in its initial state.
        found.restore(&program.address.to_string());
        match rows.as_deref() {
            Ok([row]) => match &row.got {
                Err(why) if !why.starts_with("while preparing") => {
                    println!("{links} links, {}: {}: {why}", planted.rule, planted.says);
                    return None;
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
        let found = Found::at(&program.address.to_string()).unwrap();
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
    let report = || run(&address, &Selection::default(), |_| {}).unwrap_err();
    let silent = report();
    assert!(silent.contains("gave no answer"), "{silent}");
    drop(listener);
    let absent = report();
    assert!(absent.contains("no connection"), "{absent}");
    assert!(began.elapsed() < Duration::from_secs(30));
}

/// Like an unfinished server, on which the rules of the other sections can be tried. The first one is for the checkpoint.
#[test]
fn services_that_never_answer_fail_their_own_rules_alone() {
    let program = Runtime::start();
    for (missing, rule) in [("/arm_sim/set_ /arm_sim/r /pid /joint /ik", "method"), ("/ik_ /arm_sim/r", "gains-1")] {
        let is_missing = move |name: &Value| missing.split(' ').any(|start| name.as_str().is_some_and(|name| name.starts_with(start)));
        let fault: Fault =
            Box::new(move |_, frame| if is_missing(&frame["service"]) || is_missing(&frame["topic"]) { vec![] } else { vec![frame] });
        let proxy = Proxy::start(&program.address.to_string(), fault);
        let selection = Selection { rule: Some(rule.to_owned()), ..Selection::default() };
        let rows = run(&proxy.address, &selection, |_| {}).unwrap();
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
    let proxy = Proxy::start(&program.address.to_string(), fault);
    let selection = Selection { category: Some("pid".to_owned()), ..Selection::default() };
    let rows = run(&proxy.address, &selection, |_| {}).unwrap();
    let holding: Vec<String> = rows.iter().filter(|row| row.holds()).map(Row::to_string).collect();
    assert!(!rows.is_empty() && holding.len() < 3, "{}", holding.join("\n"));
}

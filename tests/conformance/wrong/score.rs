//! The share of wrong servers whose cause the suite names, over TCP.

use std::collections::BTreeSet;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use pendularm_conformance::{Row, run};

use super::{Wrong, all, right};
use crate::{WORKERS, selected};

/// The number of rules that fail, and the causes that the suite names for them.
fn causes(server: &Wrong, sections: &[&str]) -> (usize, BTreeSet<String>) {
    let address = server.serve();
    let rows = sections.iter().flat_map(|section| run(&address, &selected(section), |_, _| {}).unwrap().rows);
    let failing: Vec<Row> = rows.filter(Row::fails).collect();
    (failing.len(), failing.into_iter().filter_map(|row| row.cause).collect())
}

#[test]
fn nine_in_ten_wrong_servers_get_the_right_cause_and_none_a_false_one() {
    let (servers, next) = (all(), AtomicUsize::new(0));
    let outcomes = Mutex::new(Vec::new());
    let work = || {
        while let Some(server) = servers.get(next.fetch_add(1, Ordering::Relaxed)) {
            let (failing, causes) = causes(server, server.rules);
            outcomes.lock().unwrap().push((server, failing, causes));
        }
    };
    thread::scope(|scope| {
        // A server waits longer than it computes.
        for _ in 0..2 * WORKERS {
            scope.spawn(work);
        }
    });
    let outcomes = outcomes.into_inner().unwrap();
    let wrong = outcomes.iter().filter(|(_, failing, _)| *failing > 0);
    let (mut found, mut missed, mut accused) = (0, Vec::new(), Vec::new());
    for (server, _, causes) in wrong.clone() {
        let name = format!("{} ({} links, {:?})", server.says, server.links, server.rules);
        let (true_ones, false_ones): (Vec<&String>, Vec<&String>) = causes.iter().partition(|cause| cause.contains(&server.says));
        match true_ones.is_empty() {
            false => found += 1,
            true => missed.push(name.clone()),
        }
        accused.extend(false_ones.iter().map(|cause| format!("{name}: {cause}")));
    }
    let unseen: Vec<&String> = outcomes.iter().filter(|(_, failing, _)| *failing == 0).map(|(server, ..)| &server.says).collect();
    let count = wrong.count();
    println!("{found} of {count} wrong servers get the right cause; missed: {missed:#?}; no rule fails: {unseen:#?}");
    assert!(accused.is_empty(), "false accusations: {accused:#?}");
    assert!(count >= 40, "{count} wrong servers");
    assert!(found * 10 >= count * 9, "{found} of {count}");
}

/// The same program without a mistake: a cause is named for none of its failing rules.
#[test]
fn the_right_server_of_the_same_program_is_accused_of_nothing() {
    for links in [2, 3] {
        for section in ["method", "set_integrator", "set_params", "function", "ik", "law", "trajectory", "enable", "checkpoint"] {
            assert_eq!(causes(&right(links), &[section]), (0, BTreeSet::new()), "{links} links, {section}");
        }
    }
}

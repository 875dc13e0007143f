//! Replays of false records.

use crate::system::in_virtual_time;
use pendularm::record::{
    AT_ONCE, Content, MAX_STEPS_BETWEEN_MESSAGES, RecordEntry, ReplayError, replay,
};

use crate::recorder::{file, random_run};

/// A run of two seconds.
fn short_run() -> Vec<RecordEntry> {
    in_virtual_time(random_run::<2>(4))
}

fn is_state(entry: &RecordEntry) -> bool {
    matches!(entry.content, Content::State { .. })
}

/// The entry of a state with another step and time.
fn moved(mut entry: RecordEntry, to_step: u64, log_time: u64) -> RecordEntry {
    if let Content::State { step, .. } = &mut entry.content {
        *step = to_step;
    }
    entry.log_time = log_time;
    entry
}

fn input(step: u64, note: &str, log_time: u64) -> RecordEntry {
    let note = note.to_owned();
    let content = Content::Input { step, note };
    RecordEntry { log_time, content }
}

fn refused(entries: &[RecordEntry]) -> ReplayError {
    replay(&*file(entries)).expect_err("no such record is made")
}

#[test]
fn a_step_that_no_arm_has_come_to_is_refused_with_the_message() {
    let entries = short_run();
    let last = entries.iter().rposition(is_state).unwrap();
    let Content::State { step, .. } = entries[last].content else {
        unreachable!()
    };
    for more in [MAX_STEPS_BETWEEN_MESSAGES + 1, 1 << 60] {
        let mut lies = entries.clone();
        // Its time has room for any number.
        lies[last] = moved(lies[last].clone(), step + more, 1 << 60);
        let why = refused(&lies);
        assert!(
            matches!(&why, ReplayError::Leap { due, most, .. } if *due > *most && *most == MAX_STEPS_BETWEEN_MESSAGES),
            "{why}"
        );
        let why = why.to_string();
        assert!(
            why.starts_with("/recorder/states, message ") && why.contains(": step "),
            "{why}"
        );
    }
    // So is an input.
    let mut lies = entries;
    lies.push(input(u64::MAX, "{\"reset\":null}", lies.len() as u64));
    let why = refused(&lies).to_string();
    assert!(why.starts_with("/recorder/inputs, message "), "{why}");
}

/// Each leap alone would be allowed.
#[test]
fn a_record_has_no_more_steps_than_its_time_has_room_for() {
    let entries = short_run();
    let state = entries.iter().rfind(|entry| is_state(entry)).unwrap();
    let begin = entries.iter().find(|entry| !is_state(entry)).unwrap();
    let Content::Input { step: first, .. } = begin.content else {
        unreachable!()
    };
    let at_once = first + AT_ONCE;
    let lies = [
        begin.clone(),
        input(at_once, "{\"enable\":false}", begin.log_time),
        moved(state.clone(), at_once + 1000, begin.log_time + 1000),
    ];
    let why = refused(&lies);
    assert!(
        matches!(
            why,
            ReplayError::Leap {
                due: 1000,
                most: 100,
                ..
            }
        ),
        "{why}"
    );
}

#[test]
fn a_beginning_whose_counts_would_overflow_is_refused() {
    let mut entries = short_run();
    let begin = entries
        .iter_mut()
        .find_map(|entry| match &mut entry.content {
            Content::Input { note, .. } => Some(note),
            _ => None,
        });
    let begin = begin.unwrap();
    for field in ["steps", "steps_since_base"] {
        let whole = begin.clone();
        let from = whole.find(&format!("\"{field}\":")).unwrap() + field.len() + 3;
        let to = from + whole[from..].find(',').unwrap();
        *begin = format!("{}{}{}", &whole[..from], u64::MAX, &whole[to..]);
        let lies = [input(0, begin, 0)];
        let why = refused(&lies).to_string();
        assert!(why.contains(&format!("{field} must be at most")), "{why}");
        begin.clone_from(&whole);
    }
}

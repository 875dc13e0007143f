//! Replays of false records.

use crate::system::in_virtual_time;
use pendularm::record::{
    AT_ONCE, Content, MAX_STEPS_BETWEEN_MESSAGES, RecordEntry, ReplayError, replay,
};
use serde_json::json;
use tokio::time::sleep;

use crate::recorder::{Notes, file, stop};
use crate::stage::{Stage, ms};

/// A run of half a second with the controller on.
async fn short_run() -> Vec<RecordEntry> {
    let stage = Stage::<2>::start().await;
    let mut client = stage.connect();
    let notes = Notes::default();
    notes.take(&stage).await;
    client.enable().await;
    client.publish_trajectory(json!([0.5, -0.5])).await;
    sleep(ms(500)).await;
    stop(&stage).await;
    notes.entries()
}

fn refused(entries: &[RecordEntry]) -> ReplayError {
    replay(&*file(entries)).expect_err("no such record is made")
}

#[test]
fn a_step_that_no_arm_has_come_to_is_refused_with_the_message() {
    let entries = in_virtual_time(short_run());
    let last = entries
        .iter()
        .rposition(|entry| matches!(entry.content, Content::State { .. }))
        .unwrap();
    let with_steps = |more: u64| {
        let mut entries = entries.clone();
        let Content::State { step, .. } = &mut entries[last].content else {
            unreachable!()
        };
        *step += more;
        // Its time has room for any number.
        entries[last].log_time = 1 << 60;
        entries
    };
    for more in [MAX_STEPS_BETWEEN_MESSAGES, 1 << 60] {
        let why = refused(&with_steps(more));
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
    let mut lies = entries.clone();
    let log_time = lies.len() as u64;
    let content = Content::Input {
        step: u64::MAX,
        note: "\"reset\"".to_owned(),
    };
    lies.push(RecordEntry { log_time, content });
    let why = refused(&lies).to_string();
    assert!(why.starts_with("/recorder/inputs, message "), "{why}");
}

/// Each leap alone would be allowed.
#[test]
fn a_record_has_no_more_steps_than_its_time_has_room_for() {
    let entries = in_virtual_time(short_run());
    let state = entries
        .iter()
        .rfind(|entry| matches!(entry.content, Content::State { .. }))
        .unwrap();
    let begin = entries
        .iter()
        .find(|entry| matches!(entry.content, Content::Input { .. }))
        .unwrap();
    let Content::Input { step: first, .. } = begin.content else {
        unreachable!()
    };
    let at = |step: u64, log_time: u64| {
        let Content::State {
            position,
            velocity,
            effort,
            ..
        } = state.content.clone()
        else {
            unreachable!()
        };
        let content = Content::State {
            step,
            position,
            velocity,
            effort,
        };
        RecordEntry { log_time, content }
    };
    let mut lies = vec![begin.clone()];
    lies.push(RecordEntry {
        log_time: begin.log_time,
        content: Content::Input {
            step: first + AT_ONCE,
            note: "{\"enable\":false}".to_owned(),
        },
    });
    lies.push(at(first + AT_ONCE + 1000, begin.log_time + 1000));
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
    let mut entries = in_virtual_time(short_run());
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
        let lies = [RecordEntry {
            log_time: 0,
            content: Content::Input {
                step: 0,
                note: begin.clone(),
            },
        }];
        let why = refused(&lies).to_string();
        assert!(why.contains(&format!("{field} must be at most")), "{why}");
        begin.clone_from(&whole);
    }
}

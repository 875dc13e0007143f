//! Recorded steps taken again, along a path, and from a record that lies.

use crate::system::in_virtual_time;
use pendularm::record::{AT_ONCE, Content, MAX_LEAP, RecordEntry, ReplayError, replay};
use serde_json::json;
use tokio::time::sleep;

use crate::recorder::{Notes, file, replayed, stop};
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
fn a_path_is_followed_again_bit_for_bit() {
    in_virtual_time(async {
        let stage = Stage::<3>::start().await;
        let mut client = stage.connect();
        client.enable().await;
        let notes = Notes::default();
        notes.take(&stage).await;
        let point = |positions: [f64; 3], velocities: [f64; 3], sec: u32| {
            json!({"positions": positions, "velocities": velocities,
                "time_from_start": {"sec": sec, "nanosec": 0}})
        };
        let points = [
            point([0.4, -0.3, 0.2], [0.1, 0.0, -0.1], 1),
            point([0.6, 0.3, -0.4], [0.0; 3], 2),
        ];
        let trajectory = json!({"joint_names": ["joint1", "joint2", "joint3"], "points": points});
        client
            .send(
                &json!({"op": "send_action_goal", "id": "path", "args": {"trajectory": trajectory},
                "action": "/joint_trajectory_controller/follow_joint_trajectory",
                "action_type": "control_msgs/action/FollowJointTrajectory"}),
            )
            .await;
        let end = client
            .receive_where(|frame| frame["op"] == "action_result")
            .await;
        assert_eq!(end["values"]["error_code"], 0, "{end}");
        sleep(ms(200)).await;
        stop(&stage).await;
        let entries = notes.entries();
        let is_setpoint = |entry: &&RecordEntry| matches!(&entry.content, Content::Input { note, .. } if note.contains("setpoint"));
        let moves = entries.iter().filter(is_setpoint).count();
        assert!(moves > 300, "the setpoint was moved {moves} times in 2 s");
        let verdict = replayed(&entries);
        assert_eq!((verdict.links, verdict.difference), (3, None));
        assert!(verdict.steps >= 2000 && verdict.states > 100);

        // A different setpoint on the way changes the path, and the comparison finds it.
        let mut other = entries.clone();
        let at = other.iter().position(|entry| is_setpoint(&entry)).unwrap();
        other.remove(at + moves / 2);
        assert!(replayed(&other).difference.is_some());
    });
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
    for more in [MAX_LEAP, 1 << 60] {
        let why = refused(&with_steps(more));
        assert!(
            matches!(&why, ReplayError::Leap { due, most, .. } if *due > *most && *most == MAX_LEAP),
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

/// Each of the leaps might be, by itself.
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

//! The setpoint that a `/joint_trajectory` message sets, with the joints of a 3-link arm.
//!
//! A row of `trajectory.txt` has a message, and its positions and velocities or the reason of its rejection.

use pendularm::math::pid::Setpoint;
use pendularm::protocol::wire::json::Payload;
use pendularm::services::trajectory::read_setpoint;
use serde_json::value::RawValue;

const ROWS: &str = include_str!("trajectory.txt");

#[test]
fn every_message_has_the_setpoint_or_the_rejection_of_its_row() {
    let mut other = Vec::new();
    for row in ROWS.lines().filter(|row| row.contains(" => ")) {
        let (msg, _) = row.split_once(" => ").unwrap();
        let raw = RawValue::from_string(msg.to_owned()).expect(row);
        let found = match read_setpoint::<3>(&Payload::from(raw)) {
            Ok(Setpoint { position, velocity }) => format!("{position:?} {velocity:?}"),
            Err(rejection) => rejection.to_string(),
        };
        let found = format!("{msg} => {}", found.replace(".0", ""));
        other.extend((found != row).then_some(found));
    }
    assert!(other.is_empty(), "found:\n{}", other.join("\n"));
}

//! Whole connections with the runtime's own nodes behind them: the arm, inverse kinematics, goals, trials, rosapi.
//!
//! Asserted is all that [`pendularm_fuzz::session`] says, and that every position and velocity that the arm publishes is a number.
//!
//! Input: whether room is scarce, whether they speak through a WebSocket, the script.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pendularm_fuzz::client::Door;
use pendularm_fuzz::limits::{DOING, hold};
use pendularm_fuzz::session::{Step, play_with_arm};

fuzz_target!(|script: (bool, bool, Vec<Step<'_>>)| {
    let (is_scarce, is_socket, steps) = script;
    let door = if is_socket { Door::Socket } else { Door::Plain };
    hold(0, DOING, || play_with_arm(door, is_scarce, &steps));
});

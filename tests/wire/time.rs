//! Simulation time against wall time. `clock_diagnostics.rs` has tiny timesteps.

use std::time::Instant;

use crate::arm::{in_one_of_three_tries, let_simulate, stamp};
use crate::common::{Client, PATIENCE, Runtime};
use serde_json::json;

/// How far simulation time is ahead of `epoch`'s wall time: the largest of some messages, since what delays a message
/// on its way to us only makes it less.
fn lead(client: &mut Client, epoch: Instant) -> f64 {
    let mut lead = f64::NEG_INFINITY;
    for _ in 0..20 {
        let time = stamp(&client.message("/joint_states"));
        lead = lead.max(time - epoch.elapsed().as_secs_f64());
    }
    lead
}

#[test]
fn simulation_time_advances_with_wall_time() {
    in_one_of_three_tries("within 0.5 %", || {
        let runtime = Runtime::start();
        let mut client = runtime.connect();
        client.subscribe("/joint_states");
        let epoch = Instant::now();
        let before = lead(&mut client, epoch);
        let_simulate(&mut client, 3.0);
        let after = lead(&mut client, epoch);
        let share = (after - before) / epoch.elapsed().as_secs_f64();
        (share.abs() < 0.005)
            .then_some(())
            .ok_or(format!("{share}"))
    });
}

/// At a timestep of 1e-8 s no machine keeps up. If each call caused 5 ms of steps, these 5120 calls would take more
/// than 25 s. While only wake-ups step, they take a second or two. There are several callers: on a busy machine a
/// wake-up then has more than one call to answer.
#[test]
fn calls_to_a_slow_arm_share_wake_ups() {
    let runtime = Runtime::start();
    let mut callers: Vec<_> = (0..16).map(|_| runtime.connect()).collect();
    callers[0].ask("/arm_sim/set_integrator", json!({"timestep": 1e-8}));
    let call = b"{\"op\":\"call_service\",\"service\":\"/pid_controller/enable\",\"id\":\"p\"}\n";
    let deadline = Instant::now() + PATIENCE;
    std::thread::scope(|scope| {
        for caller in &mut callers {
            scope.spawn(|| {
                caller.send_bytes(&call.repeat(320));
                for answered in 0..320 {
                    let frame = caller.next_frame(deadline);
                    let frame = frame.unwrap_or_else(|error| panic!("{error} after {answered}"));
                    assert_eq!(frame["result"], true, "{frame}");
                }
            });
        }
    });
}

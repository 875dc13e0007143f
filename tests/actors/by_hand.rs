//! A paused arm that clients step: every answer is bit-identical to the offline stepper's.

use crate::stage::Stage;
use crate::system::in_virtual_time;
use crate::virtual_time::Client;
use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::{ControlPeriod, Simulation};
use serde_json::json;

/// Both take steps, with or without an effort of the client in place of the controller's.
async fn step(
    client: &mut Client,
    offline: &mut Simulation<2>,
    steps: u64,
    effort: Option<[f64; 2]>,
) {
    let mut args = json!({"steps": steps});
    if let Some(effort) = effort {
        args["effort"] = json!(effort);
        offline.drive(Some(effort));
    }
    offline.advance(steps);
    if effort.is_some() {
        offline.drive(None);
    }
    let State { position, velocity } = offline.state();
    let expected = json!({"steps": steps, "time": offline.time(), "position": position,
        "velocity": velocity, "effort": offline.effort()});
    assert_eq!(client.ask("/arm_sim/step", args).await, expected);
}

async fn paused() -> (Stage<2>, Client, Simulation<2>) {
    let stage = Stage::<2>::start().await;
    let mut client = stage.connect();
    client.ask("/arm_sim/pause", json!({"data": true})).await;
    client.ask("/arm_sim/reset", json!({})).await;
    let offline = Simulation::new(Arm::default(), Gains::default());
    (stage, client, offline)
}

/// Changes something on both at random.
async fn change(client: &mut Client, offline: &mut Simulation<2>, random: &mut fastrand::Rng) {
    let pair = [random.f64() * 6.0 - 3.0, random.f64() * 6.0 - 3.0];
    let on = random.bool();
    match random.u8(0..9) {
        0 => {
            client
                .ask("/pid_controller/enable", json!({"data": on}))
                .await;
            offline.enable(on);
        }
        1 => {
            client.publish_trajectory(json!(pair)).await;
            offline.set_setpoint(Setpoint::at(pair));
        }
        2 => {
            let period = [0.0, 0.0013, 0.004, 0.01][random.usize(0..4)];
            let delay = u8::from(on);
            let control = ControlPeriod { period, delay };
            offline.set_control_period(control);
            let args = json!({"period": period, "delay": on});
            let answer = client.ask("/pid_controller/set_period", args).await;
            let effective = control.effective(offline.timestep());
            assert_eq!(
                answer,
                json!({"period": period, "effective_period": effective, "delay": on})
            );
        }
        3 => {
            let timestep = [0.0005, 0.001, 0.003][random.usize(0..3)];
            let args = json!({"method": "verlet", "timestep": timestep});
            client.ask("/arm_sim/set_integrator", args).await;
            offline.set_method(Method::Verlet);
            if timestep != offline.timestep() {
                offline.set_timestep(timestep);
            }
        }
        4 => {
            let args = json!({"position": pair, "velocity": "fast"});
            let answer = client.call("/arm_sim/set_state", args).await;
            let velocity = offline.state().velocity;
            offline.set_state(State {
                position: pair,
                velocity,
            });
            assert_eq!(
                answer["values"],
                json!({"position": pair, "velocity": velocity})
            );
        }
        5 => {
            let push = json!({"effort": pair, "duration": 0.003});
            assert_eq!(client.ask("/arm_sim/disturb", push.clone()).await, push);
            offline.disturb(pair, 0.003);
        }
        6 => {
            // While the controller is on, it is refused.
            client.command_effort(json!(pair)).await;
            if !offline.pid().is_enabled() {
                offline.set_command(pair);
            }
        }
        7 => {
            client.ask("/arm_sim/reset", json!({})).await;
            offline.reset();
        }
        _ => step(client, offline, random.u64(1..40), Some(pair)).await,
    }
}

#[test]
fn steps_of_a_client_equal_the_offline_steppers_for_all_settings_between_them() {
    in_virtual_time(async {
        for seed in 0..8 {
            let (_stage, mut client, mut offline) = paused().await;
            let mut random = fastrand::Rng::with_seed(seed);
            for _ in 0..50 {
                change(&mut client, &mut offline, &mut random).await;
                step(&mut client, &mut offline, random.u64(1..30), None).await;
            }
        }
    });
}

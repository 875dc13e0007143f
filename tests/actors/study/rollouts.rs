//! Offline runs during a live run.

use super::*;
use crate::system::in_real_time;

fn joints(values: &Value) -> Vec<[f64; 2]> {
    serde_json::from_value(values.clone()).unwrap()
}

/// Against the live arm's stepper, asked for every sample; the numbers as written read back as the same bits.
#[test]
fn a_rollout_is_the_live_simulation_bit_for_bit() {
    in_real_time(async {
        let bench = study::<2>();
        let mut client = caller_of(&bench).await;
        for method in Method::ALL {
            for controlled in [false, true] {
                let mut args = json!({"q0": [0.4, -0.3], "qdot0": [0.5, 1], "duration": 1, "timestep": 0.005,
                    "samples": 51, "integrator": method.name(), "setpoint": [1, -0.5],
                    "params": {"gravity": 9.81, "masses": [1, 2], "lengths": [1, 0.5]}});
                let mut live = Simulation::new(
                    Arm::new([1.0, 0.5], [1.0, 2.0], 9.81).unwrap(),
                    Gains {
                        kp: [200.0, 100.0],
                        ki: [20.0, 0.0],
                        kd: [30.0, 12.0],
                    },
                );
                if controlled {
                    args["gains"] = json!({"kp": [200, 100], "ki": [20, 0], "kd": [30, 12]});
                    live.enable(true);
                }
                live.set_method(method);
                live.set_timestep(0.005);
                live.set_control_period(settings::<2>().control.period);
                live.set_state(State {
                    position: [0.4, -0.3],
                    velocity: [0.5, 1.0],
                });
                live.set_setpoint(Setpoint::at([1.0, -0.5]));
                let values = client.ask(Service::Rollout.name(), args.clone()).await;
                let times: Vec<f64> = serde_json::from_value(values["times"].clone()).unwrap();
                assert_eq!(times.len(), 51);
                let (positions, velocities) =
                    (joints(&values["positions"]), joints(&values["velocities"]));
                let efforts = joints(&values["efforts"]);
                assert_eq!(efforts[0], [0.0; 2]);
                for k in 0..51 {
                    assert_eq!(times[k], live.time());
                    assert_eq!(positions[k], live.state().position, "{method}, sample {k}");
                    assert_eq!(velocities[k], live.state().velocity);
                    assert_eq!(efforts[k], *live.effort());
                    live.advance(4);
                }
                assert_eq!(values["energy"].as_array().unwrap().len(), 51);
                assert_eq!(values["evaluations"], 200 * method.evaluations());
                assert_eq!(values["error"], Value::Null, "no reference was asked for");
                assert_eq!(values["error_uncertainty"], Value::Null);
                assert!(values["wall_time"].as_f64().unwrap() > 0.0);
                assert_eq!(values["sampling_error"], Value::Null);
                assert_eq!(values["divergence"], Value::Null);
                assert_eq!(values.as_object().unwrap().len(), 12);
            }
        }
    });
}

#[test]
fn an_empty_rollout_is_ten_seconds_of_the_present_free_arm() {
    in_real_time(async {
        let bench = study::<2>();
        let values = caller_of(&bench)
            .await
            .ask(Service::Rollout.name(), json!({}))
            .await;
        let mut live = Simulation::new(settings::<2>().control.arm, no_control());
        live.set_method(Method::Midpoint);
        live.set_timestep(0.002);
        let start = settings::<2>().state;
        live.set_state(start);
        live.advance(5000);
        assert_eq!(values["times"].as_array().unwrap().len(), 1001);
        assert_eq!(values["times"][1000], live.time());
        let positions = joints(&values["positions"]);
        assert_eq!(positions[1000], live.state().position);
        assert_eq!(positions[0], start.position);
        assert_eq!(values["evaluations"], 10_000);
    });
}

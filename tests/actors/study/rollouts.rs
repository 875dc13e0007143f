//! Runs computed beside the live arm.

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
        let mut client = caller_of(&bench);
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
                live.set_state(State {
                    position: [0.4, -0.3],
                    velocity: [0.5, 1.0],
                });
                live.set_setpoint(Setpoint {
                    position: [1.0, -0.5],
                    velocity: [0.0; 2],
                });
                let values = client.values(Service::Rollout, &args).await;
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
                assert_eq!(values.as_object().unwrap().len(), 11);
            }
        }
    });
}

#[test]
fn an_empty_rollout_is_ten_seconds_of_the_present_arm_left_to_itself() {
    in_real_time(async {
        let bench = study::<3>();
        let run = bench.ask(RunOffline::default()).await.unwrap().run;
        let mut live = Simulation::new(settings::<3>().control.arm, no_control());
        live.set_method(Method::Midpoint);
        live.set_timestep(0.002);
        live.advance(5000);
        assert_eq!(run.times().len(), 1001);
        assert_eq!(run.times()[1000], live.time());
        assert_eq!(run.positions()[1000], live.state().position);
        assert_eq!(run.positions()[0], [0.0; 3]);
        assert_eq!(run.evaluations(), 10_000);
    });
}

/// At the same timestep the order tells; the reference changes neither the samples nor what counts as evaluations.
#[test]
fn methods_can_be_compared_by_their_errors() {
    in_real_time(async {
        let bench = study::<2>();
        let control = SetGains {
            kp: Some([200.0, 100.0]),
            kd: Some([30.0, 12.0]),
            ..SetGains::default()
        };
        for gains in [None, Some(control)] {
            let mut errors = Vec::new();
            for method in [Method::Euler, Method::Midpoint, Method::Rk4] {
                let alone = RunOffline {
                    q0: Some([0.4, -0.3]),
                    duration: Some(1.0),
                    timestep: Some(0.005),
                    samples: Some(11),
                    method: Some(method),
                    gains: gains.clone(),
                    setpoint: Some([1.0, -0.5]),
                    ..RunOffline::default()
                };
                let compared = RunOffline {
                    reference: Some(true),
                    ..alone.clone()
                };
                let compared = bench.ask(compared).await.unwrap().run;
                errors.push(compared.deviation().unwrap().known().expect("finite"));
                let alone = bench.ask(alone).await.unwrap().run;
                assert!(alone.deviation().is_none(), "no reference was asked for");
                assert_eq!(compared.times(), alone.times());
                assert_eq!(compared.positions(), alone.positions());
                assert_eq!(compared.velocities(), alone.velocities());
                assert_eq!(compared.efforts(), alone.efforts());
                assert_eq!(compared.energy(), alone.energy());
                assert_eq!(compared.evaluations(), alone.evaluations());
            }
            // Orders 1, 2 and 4 at a timestep some fifty times shorter than the motion.
            assert!(
                errors[0] > 20.0 * errors[1] && errors[1] > 20.0 * errors[2],
                "{errors:?}"
            );
            assert!(errors[2] > 0.0);
        }
    });
}

#[test]
fn a_rollout_that_diverges_ends_with_its_last_finite_sample() {
    in_real_time(async {
        let bench = study::<2>();
        let mut client = caller_of(&bench);
        let args = json!({"integrator": "euler", "timestep": 1, "duration": 1000, "q0": [1, 1], "reference": true,
            "gains": {"kp": [1e9, 1e9], "ki": [0, 0], "kd": [1e9, 1e9]}});
        let values = client.values(Service::Rollout, &args).await;
        let times = values["times"].as_array().unwrap();
        assert!(times.len() < 1001, "{}", times.len());
        for key in ["positions", "velocities", "efforts", "energy"] {
            assert_eq!(values[key].as_array().unwrap().len(), times.len());
        }
        assert!(values["positions"].to_string().len() > 10);
        assert!(!values["positions"].to_string().contains("null"));
    });
}

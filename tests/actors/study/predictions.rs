//! Limits, advice and plans: the study's own, with missing fields taken from the arm, and the refusal of fields.

use super::*;
use crate::system::in_real_time;

/// The service's values for these limits and this motion.
fn stability_values<const N: usize>(
    limits: &Limits<N>,
    clocks: &ClockLimits,
    motion: &Motion,
) -> Value {
    let critical = limits.critical.unwrap();
    let bears = Some(motion.timestep).filter(|timestep| timestep.is_finite());
    json!({
        "control_period_limit": clocks.period,
        "timestep_limit": clocks.timestep,
        "timestep_limit_held": limits.held,
        "timestep_limit_continuous": limits.continuous,
        "equilibrium": limits.equilibrium.to_vec(),
        "equilibrium_kind": limits.rest.name(),
        "minimum_over_poses_held": limits.minimum_held,
        "minimum_over_poses_continuous": limits.minimum_continuous,
        "minimum_over_poses_bound": limits.bound,
        "bound_is_proven": limits.bound_is_proven,
        "certified": limits.certified,
        "worst_pose": limits.worst_pose.map(|pose| pose.to_vec()),
        "critical": {
            "growth_per_step": critical.growth_per_step, "frequency": critical.frequency,
            "joint": critical.joint,
        },
        "timestep_limit_motion": bears,
        "motion_speed": motion.speed,
        "advised_timestep": limits.advised_for(motion),
        "advised_duration": null,
    })
}

/// The service's values for this loop from the state of the arm.
fn predicted<const N: usize>(control: &ControlLoop<N>) -> Value {
    let motion = Motion::ahead(control, &settings::<N>().state);
    stability_values(&limits(control), &clock_limits(control), &motion)
}

async fn assert_predictions_are_the_studys<const N: usize>() {
    let bench = study::<N>();
    let mut client = caller_of(&bench).await;
    let control = settings::<N>().control;
    let all = settings_as_args::<N>();
    let nulls = json!({"integrator": null, "gains": {"kp": null, "colour": "red"}, "params": null, "setpoint": null});
    let some = json!({"integrator": "rk4", "gains": {"kd": vec![9.0; N]}, "params": {"gravity": 0},
        "setpoint": vec![0.7; N], "control_period": 0.003});
    let mut changed = control.with_method(Method::Rk4);
    changed.arm = Arm::new([0.8; N], [1.5; N], 0.0).unwrap();
    changed.gains.kd = [9.0; N];
    changed.setpoint = Setpoint::at([0.7; N]);
    changed.period.period = 0.003;
    let (own, changed) = (predicted(&control), predicted(&changed));
    for (args, expected) in [
        (json!({}), &own),
        (all, &own),
        (nulls, &own),
        (some, &changed),
    ] {
        let values = client.ask(Service::Stability.name(), args).await;
        assert_eq!(values, *expected);
    }
}

#[test]
fn predictions_are_the_studys_and_missing_fields_are_the_arms_own() {
    in_real_time(async {
        assert_predictions_are_the_studys::<2>().await;
        assert_predictions_are_the_studys::<3>().await;
    });
}

/// The searches for gains and plans are the library's. Each field has its effect; missing fields are the arm's own.
#[test]
fn advice_is_the_studys_and_missing_fields_are_the_arms_own() {
    in_real_time(async {
        let bench = study::<2>();
        let mut client = caller_of(&bench).await;
        let Present { control, state } = settings::<2>();
        let mut changed = control.with_method(Method::Euler).with_timestep(0.001);
        changed.arm = control.arm.weightless();
        changed.gains.kp = [200.0; 2];
        changed.setpoint = Setpoint::at([0.7; 2]);
        changed.period.period = 0.004;
        let (position, velocity) = ([0.1; 2], [0.5; 2]);
        let moving = State { position, velocity };
        let all = json!({"settling_time": 2.5, "timestep": 0.001, "integrator": "euler", "error": 1e-4, "duration": 2,
            "controller": true, "control_period": 0.004, "q0": position, "qdot0": velocity, "setpoint": [0.7, 0.7],
            "gains": {"kp": [200, 200]}, "params": {"gravity": 0}});
        let some = json!({"error": 0.05, "controller": true});
        for (args, control, start, [settling_time, duration, error]) in [
            (some, control, state, [4.0, 4.0, 0.05]),
            (all, changed, moving, [2.5, 2.0, 1e-4]),
        ] {
            let mut every_step = control;
            every_step.period.period = 0.0;
            let required = GainsRequirements {
                settling_time,
                margin: 1.25,
            };
            let found = at_once(search_gains(every_step, required)).unwrap();
            let values = client.ask(Service::SuggestGains.name(), args.clone()).await;
            assert_eq!(values["kp"], json!(found.gains.kp));
            let limit = found.limit.unwrap();
            assert_eq!(values["timestep_limit"], limit);
            assert_eq!(values["margin"], limit / control.timestep);
            let best = at_once(plan(Task {
                control,
                start,
                duration,
                error,
            }))
            .unwrap()
            .best;
            let values = client.ask(Service::Plan.name(), args).await;
            let period = control.period.period;
            assert_eq!(values["integrator"], best.method.name());
            assert_eq!(values["timestep"], best.timestep);
            assert_eq!(values["error"], best.error);
            // The timesteps are whole parts of a given period.
            assert_eq!(values["control_period"], period.max(best.timestep));
            for timestep in values["timesteps"].as_array().unwrap() {
                let steps = period / timestep.as_f64().unwrap();
                assert!((steps - steps.round()).abs() < 1e-9, "{values}");
            }
        }
    });
}

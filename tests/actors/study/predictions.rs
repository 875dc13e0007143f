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
            "growth_per_step": critical.growth_per_step,
            "frequency": critical.frequency,
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
    let nulls = json!({"integrator": null, "gains": {"kp": null, "colour": "red"}, "params": null,
        "setpoint": null});
    let some =
        json!({"integrator": "rk4", "gains": {"kd": vec![9.0; N]}, "params": {"gravity": 0}});
    let mut changed = control.with_method(Method::Rk4);
    changed.arm = Arm::new([0.8; N], [1.5; N], 0.0).unwrap();
    changed.gains.kd = [9.0; N];
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

/// The search for gains and for a plan are the library's; fields that are left out are the arm's own.
#[test]
fn advice_is_the_studys_and_missing_fields_are_the_arms_own() {
    in_real_time(async {
        let bench = study::<2>();
        let mut client = caller_of(&bench).await;
        let Present { control, state } = settings::<2>();
        let requirements = GainsRequirements {
            settling_time: 4.0,
            margin: 1.25,
        };
        let found = at_once(search_gains(control, requirements)).unwrap();
        let values = client.ask(Service::SuggestGains.name(), json!({})).await;
        assert_eq!(values["kp"], json!(found.gains.kp));
        let limit = found.limit.unwrap();
        assert_eq!(values["timestep_limit"], limit);
        assert_eq!(values["margin"], limit / control.timestep);
        let task = Task {
            control,
            start: state,
            duration: 4.0,
            error: 0.05,
        };
        let best = at_once(plan(task)).unwrap().best;
        let args = json!({"error": 0.05, "controller": true});
        let values = client.ask(Service::Plan.name(), args).await;
        assert_eq!(values["integrator"], best.method.name());
        assert_eq!(values["timestep"], best.timestep);
        assert_eq!(values["control_period"], best.timestep);
        // The hold of the efforts is not part of the error, and the timesteps are whole parts of the period.
        let args = json!({"error": 1e-4, "controller": true, "control_period": 0.004});
        let values = client.ask(Service::Plan.name(), args).await;
        assert_eq!(values["control_period"], 0.004);
        for timestep in values["timesteps"].as_array().unwrap() {
            let steps = 0.004 / timestep.as_f64().unwrap();
            assert!((steps - steps.round()).abs() < 1e-9, "{values}");
        }
    });
}

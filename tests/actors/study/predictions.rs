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

async fn assert_predictions_are_the_studys<const N: usize>() {
    let bench = study::<N>();
    let mut client = caller_of(&bench).await;
    let Present { control, state } = settings::<N>();
    let expected = limits(&control);
    let motion = Motion::ahead(&control, &state);
    assert!(expected.held.is_some_and(|limit| limit > 0.0));
    let predicted = bench.ask(PredictStability::default()).await.unwrap();
    assert_eq!((predicted.limits, predicted.motion), (expected, motion));
    let written = stability_values(&expected, &clock_limits(&control), &motion);
    let all = settings_as_args::<N>();
    let nulls = json!({"integrator": null, "gains": {"kp": null, "colour": "red"}, "params": null,
        "setpoint": null});
    for args in [json!({}), all, nulls] {
        assert_eq!(client.ask(Service::Stability.name(), args).await, written);
    }
}

#[test]
fn predictions_are_the_studys_and_missing_fields_are_the_arms_own() {
    in_real_time(async {
        assert_predictions_are_the_studys::<2>().await;
        assert_predictions_are_the_studys::<3>().await;
    });
}

#[test]
fn members_that_are_left_out_of_an_object_are_the_arms_own() {
    in_real_time(async {
        let bench = study::<2>();
        let predicted = bench
            .ask(PredictStability {
                gains: Some(SetGains {
                    kd: Some([9.0, 4.0]),
                    ..SetGains::default()
                }),
                params: Some(gravity(0.0)),
                method: Some(Method::Rk4),
                setpoint: None,
                control_period: None,
            })
            .await
            .unwrap();
        let mut control = settings::<2>().control.with_method(Method::Rk4);
        control.arm = Arm::new(*control.arm.lengths(), *control.arm.masses(), 0.0).unwrap();
        control.gains.kd = [9.0, 4.0];
        assert_eq!(predicted.limits, limits(&control));
    });
}

/// Without gravity and control there is no limit. Euler on a free swing is stable at no timestep.
#[test]
fn no_limit_is_null_and_no_stable_timestep_is_zero() {
    in_real_time(async {
        let bench = study::<2>();
        let mut client = caller_of(&bench).await;
        let none = json!({"kp": [0, 0], "ki": [0, 0], "kd": [0, 0]});
        let args = json!({"gains": none, "params": {"gravity": 0}});
        let values = client.ask(Service::Stability.name(), args).await;
        for limit in [
            "timestep_limit_held",
            "timestep_limit_continuous",
            "minimum_over_poses_held",
            "minimum_over_poses_continuous",
            "minimum_over_poses_bound",
            "worst_pose",
            "critical",
        ] {
            assert!(values[limit].is_null(), "{limit} {values}");
        }
        // Only the motion limits: the links turn at 0.2 and 0.4 rad/s, and one of them might get all their energy.
        let speed = values["motion_speed"].as_f64().unwrap();
        assert!((0.4..2.0).contains(&speed), "{values}");
        assert_eq!(values["timestep_limit_motion"], 0.3 / speed);
        assert_eq!(values["advised_timestep"], 0.8 * (0.3 / speed));
        let args = json!({"gains": none, "integrator": "euler"});
        let values = client.ask(Service::Stability.name(), args).await;
        assert_eq!(values["timestep_limit_held"], 0.0, "{values}");
        assert_eq!(values["advised_timestep"], 0.0, "{values}");
    });
}

/// The search for gains and for a plan are the library's; fields that are left out are the arm's
/// own.
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
        let suggested = bench.ask(SuggestGains::default()).await.unwrap();
        assert_eq!(suggested.found, found);
        assert_eq!(suggested.timestep, control.timestep);
        let values = client.ask(Service::SuggestGains.name(), json!({})).await;
        assert_eq!(values["kp"], json!(found.gains.kp));
        assert_eq!(values["timestep_limit"], json!(found.limit));
        let task = Task {
            control,
            start: state,
            duration: 4.0,
            error: 0.05,
        };
        let planned = at_once(plan(task)).unwrap();
        let run = bench.ask(plan_with(0.05)).await.unwrap();
        assert_eq!(run.planned, planned);
        assert_eq!(run.control_period, Some(run.planned.best.timestep));
        let args = json!({"error": 0.05, "controller": true});
        let values = client.ask(Service::Plan.name(), args).await;
        let best = planned.best;
        assert_eq!(values["integrator"], best.method.name());
        assert_eq!(values["timestep"], json!(best.timestep));
        assert_eq!(
            client
                .refusal(Service::Plan.name(), json!({"error": -1, "controller": 1}))
                .await,
            "error must be greater than 0, got -1; controller must be true or false, got 1"
        );
        let tiny = SuggestGains {
            timestep: Some(2_f64.powi(-20)),
            ..SuggestGains::default()
        };
        let refused = bench.ask(tiny).await.unwrap_err();
        assert_eq!(
            refused.to_string(),
            "settling_time / timestep must be at most 1e6 steps, got 4.1943e6"
        );
        let too_long = PlanRun {
            duration: Some(1e9),
            ..plan_with(0.05)
        };
        let refused = bench.ask(too_long).await.unwrap_err();
        assert!(
            matches!(refused, Refused::Study(PlanError::TooLong(_))),
            "{refused}"
        );
    });
}

#[test]
fn refused_advice_names_a_field_and_spells_no_number_out() {
    in_real_time(async {
        let bench = study::<2>();
        let mut client = caller_of(&bench).await;
        for (service, args, why) in [
            (
                Service::SuggestGains,
                json!({"settling_time": 5e-324}),
                "settling_time: no gains found that settle within 5e-324 s and leave a margin of ",
            ),
            (
                Service::Plan,
                json!({"error": 5e-324, "duration": 1}),
                "error must be larger or duration shorter: the motion itself ",
            ),
        ] {
            let refused = client.refusal(service.name(), args).await;
            assert!(
                refused.starts_with(why) && !refused.contains("inf"),
                "{refused}"
            );
        }
    });
}

/// The request has a controller of 250 Hz, so the hold of its efforts is not part of the error.
#[test]
fn a_plan_for_a_given_control_period_has_whole_parts_of_it_as_timesteps() {
    in_real_time(async {
        let bench = study::<2>();
        let given = PlanRun {
            control_period: Some(0.004),
            ..plan_with(1e-4)
        };
        let run = bench.ask(given).await.unwrap();
        assert_eq!(run.control_period, Some(0.004));
        for one in &run.planned.candidates {
            let steps = 0.004 / one.timestep;
            assert!((steps - steps.round()).abs() < 1e-9 && one.error <= 1e-4);
        }
    });
}

/// A plan for the controller, with only the allowed error given.
fn plan_with(error: f64) -> PlanRun<2> {
    PlanRun {
        error,
        duration: None,
        controller: true,
        q0: None,
        qdot0: None,
        params: None,
        gains: None,
        setpoint: None,
        control_period: None,
    }
}

//! Warnings about a timestep, and the estimated error.

use super::*;

#[test]
fn a_warning_is_logged_at_its_start_and_its_end_running_or_paused() {
    in_virtual_time(async {
        let mut arm = Consulting::new(0.004).await;
        arm.ask(enable(true)).await;
        arm.client.subscribe(Topic::Diagnostics.name()).await;
        sleep(Duration::from_millis(2100)).await;
        for message in arm.told(Topic::Diagnostics.name()).await {
            assert_eq!(message["status"][0]["level"], 0);
            assert_eq!(
                (
                    value(&message, "timestep_limit"),
                    value(&message, "warning")
                ),
                ("0.004", "")
            );
        }
        for paused in [false, true] {
            let state = if paused { "paused" } else { "running" };
            arm.ask(pause(paused)).await;
            for (timestep, level) in [(0.005, 1), (0.004, 0)] {
                // Within a tick of the change, not a second later.
                sleep(Duration::from_millis(5)).await;
                arm.told(Topic::Diagnostics.name()).await;
                arm.ask(integrator(Some(timestep), None)).await;
                sleep(Duration::from_millis(20)).await;
                let told = arm.told(Topic::Diagnostics.name()).await;
                let status = &told[0]["status"][0];
                assert_eq!(
                    (&status["level"], &status["message"]),
                    (&json!(level), &json!(state))
                );
                let warning = value(&told[0], "warning");
                assert_eq!(
                    warning,
                    if level == 1 {
                        "the timestep 0.005 s exceeds 0.004 s, the predicted stability limit of rk4 at the present setpoint"
                    } else {
                        ""
                    }
                );
            }
        }
        arm.oracle.limit.set(0.0);
        arm.ask(enable(false)).await;
        sleep(Duration::from_millis(300)).await;
        let told = arm.told(Topic::Diagnostics.name()).await;
        assert_eq!(
            value(told.last().unwrap(), "warning"),
            "rk4 is predicted to be unstable at every timestep with the controller off"
        );
    });
}

/// Which clock is too slow. A shorter timestep does not mend a control period that is too long, and the reverse.
#[test]
fn a_warning_names_the_clock_that_is_too_slow() {
    in_virtual_time(async {
        let mut arm = Consulting::new(0.004).await;
        arm.oracle.period_limit.set(0.008);
        arm.ask(enable(true)).await;
        arm.client.subscribe(Topic::Diagnostics.name()).await;
        let period = |period: f64| SetPeriod {
            period: Some(period),
            ..SetPeriod::default()
        };
        for (time, timestep, warning) in [
            (0.0, 0.001, ""),
            (
                0.01,
                0.001,
                "the control period 0.01 s exceeds 0.008 s, the predicted stability limit of the controller at \
                 the present setpoint",
            ),
            (0.006, 0.001, ""),
            (
                0.006,
                0.006,
                "the timestep 0.006 s exceeds 0.004 s, the predicted stability limit of rk4 at the present \
                 setpoint with a control period of 0.006 s",
            ),
            (
                0.012,
                0.006,
                "the control period 0.012 s exceeds 0.008 s, the predicted stability limit of the controller \
                 at the present setpoint",
            ),
        ] {
            arm.ask(period(time)).await;
            arm.ask(integrator(Some(timestep), None)).await;
            sleep(Duration::from_millis(300)).await;
            arm.told(Topic::Diagnostics.name()).await;
            sleep(Duration::from_millis(1100)).await;
            let told = arm.told(Topic::Diagnostics.name()).await;
            assert_eq!(value(&told[0], "warning"), warning, "{time} and {timestep}");
            assert_eq!(value(&told[0], "control_period_limit"), "0.008");
        }
    });
}

#[test]
fn an_arm_without_a_limit_reports_it_and_does_not_warn() {
    in_virtual_time(async {
        let mut arm = Consulting::new(f64::INFINITY).await;
        arm.client.subscribe(Topic::Diagnostics.name()).await;
        arm.ask(pause(true)).await;
        // At rest without gravity, so that nothing moves either.
        arm.ask(gravity(0.0)).await;
        arm.ask(Reset::default()).await;
        arm.ask(integrator(Some(1e6), None)).await;
        sleep(Duration::from_secs(2)).await;
        let told = arm.told(Topic::Diagnostics.name()).await;
        let message = told.last().unwrap();
        assert_eq!(
            (value(message, "timestep_limit"), value(message, "warning")),
            ("inf", "")
        );
    });
}

/// A free arm is stable, but may turn too fast, or fall too far, for the method. The warning names the smaller of the
/// two limits.
#[test]
fn a_motion_too_fast_for_the_timestep_causes_a_warning() {
    in_virtual_time(async {
        let mut arm = Consulting::new(0.2).await;
        arm.client.subscribe(Topic::Diagnostics.name()).await;
        arm.ask(pause(true)).await;
        for (timestep, warned) in [(0.05, false), (0.15, true)] {
            arm.ask(integrator(Some(timestep), None)).await;
            sleep(Duration::from_secs(2)).await;
            let told = arm.told(Topic::Diagnostics.name()).await;
            let message = told.last().unwrap();
            let limit: f64 = value(message, "timestep_limit_motion").parse().unwrap();
            assert!((0.05..0.15).contains(&limit), "{limit}");
            let warning = value(message, "warning");
            assert_eq!(!warning.is_empty(), warned, "{warning}");
            let said = "the predicted limit of rk4 for a motion of 16.403 rad/s";
            assert_eq!(warning.contains(said), warned, "{warning}");
        }
        // Beyond both limits the warning names the smaller one.
        arm.ask(integrator(Some(0.3), None)).await;
        sleep(Duration::from_secs(2)).await;
        let told = arm.told(Topic::Diagnostics.name()).await;
        let warning = value(told.last().unwrap(), "warning").to_owned();
        assert!(warning.contains("16.403 rad/s"), "{warning}");
    });
}

#[test]
fn the_error_estimate_is_published_ten_times_a_second_with_a_subscriber() {
    in_virtual_time(async {
        let mut arm = Consulting::new(0.004).await;
        arm.ask(integrator(None, Some(Method::Midpoint))).await;
        arm.client.subscribe(Topic::ErrorEstimate.name()).await;
        sleep(Duration::from_secs(3)).await;
        let told = arm.told(Topic::ErrorEstimate.name()).await;
        assert!((29..=31).contains(&told.len()), "{}", told.len());
        assert_eq!(arm.gauges.error_estimates(), told.len() as u64);
        arm.ask(pause(true)).await;
        sleep(Duration::from_millis(200)).await;
        let simulation = arm.simulation().await;
        let expected = estimate(&simulation).unwrap();
        assert!(expected.local_error > 0.0);
        assert_eq!(
            *arm.told(Topic::ErrorEstimate.name()).await.last().unwrap(),
            json!({"method": "midpoint", "timestep": 0.001, "local_error": expected.local_error,
                "velocity_error": expected.velocity_error, "error_per_second": expected.error_per_second, "predicted_limit": 0.004})
        );
        arm.client.unsubscribe(Topic::ErrorEstimate.name()).await;
        let before = arm.gauges.error_estimates();
        sleep(Duration::from_secs(3)).await;
        assert_eq!(arm.gauges.error_estimates(), before);
    });
}

#[test]
fn an_arm_that_has_diverged_has_no_local_error() {
    in_virtual_time(async {
        let mut arm = Consulting::new(f64::INFINITY).await;
        arm.client.subscribe(Topic::ErrorEstimate.name()).await;
        arm.ask(SetGains {
            kp: Some([1e200; 2]),
            ..SetGains::default()
        })
        .await;
        arm.hold([1.0, 1.0]).await;
        arm.ask(integrator(Some(0.01), Some(Method::Euler))).await;
        arm.ask(enable(true)).await;
        sleep(Duration::from_secs(1)).await;
        let told = arm.told(Topic::ErrorEstimate.name()).await;
        assert_eq!(
            *told.last().unwrap(),
            json!({"method": "euler", "timestep": 0.01, "local_error": null, "velocity_error": null, "error_per_second": null, "predicted_limit": null})
        );
    });
}

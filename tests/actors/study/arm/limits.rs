//! When the arm asks for its limit, and for which loop.

use super::*;

#[test]
fn without_subscribers_no_limit_is_asked_for_and_no_error_estimated() {
    in_virtual_time(async {
        let mut arm = Consulting::new(0.004).await;
        arm.client.subscribe(Topic::ErrorEstimate.name()).await;
        arm.client.unsubscribe(Topic::ErrorEstimate.name()).await;
        arm.client.subscribe(Topic::JointStates.name()).await;
        let (_, before) = (arm.questions().await, arm.gateway.gauges.error_estimates());
        for timestep in [0.01, 0.02, 0.03] {
            arm.ask(integrator(Some(timestep), Some(Method::Verlet)))
                .await;
            arm.ask(enable(true)).await;
            arm.hold([timestep, 1.0]).await;
            sleep(Duration::from_secs(2)).await;
        }
        assert_eq!(arm.questions().await, []);
        assert_eq!(arm.gateway.gauges.error_estimates(), before);
    });
}

#[test]
fn the_limit_is_asked_for_when_the_loop_in_force_changes_and_never_else() {
    in_virtual_time(async {
        let mut arm = Consulting::new(0.004).await;
        arm.client.subscribe(Topic::Diagnostics.name()).await;
        let first = arm.questions().await;
        let free = ControlLoop::free(Arm::default());
        assert_eq!(first, [free]);
        sleep(Duration::from_secs(10)).await;
        assert_eq!(arm.questions().await, []);
        // Changes that do not affect the present loop: with the controller off, also gains and setpoint.
        arm.ask(integrator(Some(0.002), Some(Method::Rk4))).await;
        arm.ask(gravity(9.81)).await;
        arm.ask(SetGains {
            kp: Some([50.0, 50.0]),
            ..SetGains::default()
        })
        .await;
        arm.hold([1.0, -1.0]).await;
        arm.ask(pause(true)).await;
        arm.ask(pause(false)).await;
        assert_eq!(arm.questions().await, []);
        arm.ask(enable(true)).await;
        let gains = Gains {
            kp: [50.0; 2],
            ..Gains::default()
        };
        let setpoint = Setpoint::at([1.0, -1.0]);
        let mut control = ControlLoop {
            gains,
            setpoint,
            timestep: 0.002,
            ..free
        };
        assert_eq!(arm.questions().await, [control]);
        arm.ask(integrator(None, Some(Method::Midpoint))).await;
        control.method = Method::Midpoint;
        assert_eq!(arm.questions().await, [control]);
        arm.ask(gravity(1.0)).await;
        control.arm = Arm::new([1.0; 2], [1.0; 2], 1.0).unwrap();
        assert_eq!(arm.questions().await, [control]);
        arm.ask(SetGains {
            ki: Some([0.0, 0.0]),
            ..SetGains::default()
        })
        .await;
        control.gains.ki = [0.0; 2];
        assert_eq!(arm.questions().await, [control]);
        arm.hold([0.5, 0.5]).await;
        control.setpoint.position = [0.5; 2];
        assert_eq!(arm.questions().await, [control]);
        arm.ask(Reset::default()).await;
        control.setpoint.position = [0.0; 2];
        assert_eq!(arm.questions().await, [control]);
        arm.client.unsubscribe(Topic::Diagnostics.name()).await;
        arm.hold([0.5, 0.5]).await;
        assert_eq!(arm.questions().await, []);
    });
}

/// A thousand setpoints a second for two seconds cause twenty requests, and one at the start.
#[test]
fn a_stream_of_setpoints_costs_ten_predictions_a_second() {
    in_virtual_time(async {
        let mut arm = Consulting::new(0.004).await;
        arm.ask(enable(true)).await;
        arm.client.subscribe(Topic::Diagnostics.name()).await;
        for k in 0..2000 {
            arm.hold([1e-4 * f64::from(k), 0.0]).await;
            sleep(Duration::from_millis(1)).await;
        }
        let questions = arm.questions().await;
        assert!((15..=22).contains(&questions.len()), "{}", questions.len());
        let last = questions.last().unwrap().setpoint.position;
        assert_eq!(last, [1e-4 * 1999.0, 0.0], "the latest has the last word");
    });
}

/// The limit of other gains does not apply. Between the change and the answer the limit is unknown, and there is no
/// warning.
#[test]
fn a_limit_of_another_loop_causes_no_warning() {
    in_virtual_time(async {
        let mut arm = Consulting::new(0.0).await;
        arm.client.subscribe(Topic::Diagnostics.name()).await;
        // Between two ticks, so that none comes between the change and the message.
        sleep(Duration::from_millis(508)).await;
        arm.told(Topic::Diagnostics.name()).await;
        arm.oracle.limit.set(0.004);
        arm.ask(enable(true)).await;
        arm.ask(pause(true)).await;
        sleep(Duration::from_millis(100)).await;
        let told = arm.told(Topic::Diagnostics.name()).await;
        let told: Vec<_> = told
            .iter()
            .map(|one| {
                (
                    one["status"][0]["level"].as_u64().unwrap(),
                    value(one, "timestep_limit"),
                )
            })
            .collect();
        assert_eq!(told, [(0, "NaN"), (0, "0.004")]);
    });
}

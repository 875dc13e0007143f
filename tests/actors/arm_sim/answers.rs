//! Answers and statuses: that they come, to whom, and after what.

use super::*;

#[test]
fn a_bad_trajectory_is_answered_to_its_sender_alone_with_the_frames_id() {
    in_virtual_time(async {
        let bench = ArmBench::<2>::new(Arm::default());
        let held = *bench.snapshot().await.pid().setpoint();
        let id = json!({"my": [1, "id"]});
        bench
            .trajectory(json!({"points": []}), Some(id.clone()))
            .await;
        let [Said::Responded(CALLER, frame)] = &bench.heard.take()[..] else {
            panic!("one status")
        };
        assert_eq!(
            (&frame["op"], &frame["level"], &frame["id"]),
            (&json!("status"), &json!("error"), &id)
        );
        bench
            .trajectory(
                json!({"points": [{"positions": [1]}], "joint_names": ["joint2"]}),
                None,
            )
            .await;
        let [Said::Responded(CALLER, frame)] = &bench.heard.take()[..] else {
            panic!("one status")
        };
        assert!(
            frame.get("id").is_none() && frame["msg"].as_str().unwrap().contains("joint1"),
            "{frame}"
        );
        assert_eq!(*bench.snapshot().await.pid().setpoint(), held);
    });
}

#[test]
fn a_message_of_a_change_comes_before_the_response_and_shows_the_change() {
    in_virtual_time(async {
        let bench = ArmBench::<2>::new(Arm::default());
        bench.want(Topic::Diagnostics, true).await;
        sleep(ms(100)).await;
        bench.heard.take();
        let echo = bench.ask(pause(true)).await;
        let said = bench.heard.take();
        let [Said::Published(Topic::Diagnostics, frame), Said::Answered] = &said[..] else {
            panic!("{said:?}")
        };
        assert_eq!(frame["msg"]["status"][0]["message"], "paused");
        assert!(echo.values && echo.rejected.is_empty(), "{echo:?}");
        bench.ask(pause(true)).await;
        let said = bench.heard.take();
        assert_eq!(said, [Said::Answered], "nothing has changed");
    });
}

#[test]
fn every_service_of_the_arm_answers_whatever_it_is_asked() {
    in_virtual_time(async {
        let bench = ArmBench::<3>::new(Arm::default());
        let services = [
            Service::SetIntegrator,
            Service::SetParams,
            Service::Pause,
            Service::Reset,
            Service::Enable,
            Service::SetGains,
        ];
        for service in services {
            let fields = service.response_fields();
            for args in [
                json!({}),
                json!([]),
                json!([null, null, null]),
                json!([0, 0, 0, 0, 0]),
                json!({"data": {}, "kp": 1, "method": [], "gravity": "x"}),
            ] {
                let response = bench.call(service, args.clone()).await;
                let status = response["status"].as_str().unwrap();
                assert_eq!(response["result"], status.is_empty(), "{response}");
                let values = response["values"].as_object().unwrap();
                assert_eq!(values.len(), fields.len(), "{args}: {response}");
                assert!(
                    fields.iter().all(|field| values.contains_key(field.name)),
                    "{response}"
                );
            }
        }
    });
}

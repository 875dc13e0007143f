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

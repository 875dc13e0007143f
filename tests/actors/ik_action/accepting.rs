//! Goals that are accepted and goals that are rejected, and the effects of a new goal.

use super::*;

#[test]
fn a_goal_is_answered_with_its_id_and_then_its_trajectory_goes_out() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe("/joint_trajectory").await;
        client.heard.clear();
        let values = client.ask(SEND, json!({"x": 1, "y": 1})).await;
        assert_eq!(values.as_object().unwrap().len(), 1);
        assert!(values["goal_id"].is_string());
        let trajectory = client.message("/joint_trajectory").await;
        assert_eq!(client.story(), [SEND, "/joint_trajectory"]);
        assert_eq!(trajectory["joint_names"], json!(["joint1", "joint2"]));
        assert_eq!(trajectory["points"].as_array().unwrap().len(), 1);
        assert_eq!(trajectory["points"][0]["velocities"], json!([0.0, 0.0]));
        let positions = numbers(&trajectory["points"][0]["positions"]);
        let hand = forward(&[1.0, 1.0], &[positions[0], positions[1]]).position;
        // A closed form loses a few units in the last place.
        assert!((hand - glam::DVec2::ONE).length() < 1e-14);
        client.settle().await;
        let setpoint = *stage.simulation().await.pid().setpoint();
        assert_eq!(setpoint.position, positions[..], "bit for bit, over JSON");
        assert_eq!(setpoint.velocity, [0.0, 0.0]);
    });
}

#[test]
fn sending_a_goal_never_enables_the_controller() {
    in_virtual_time(async {
        let (stage, _client) = Stage::<2>::with_a_floating_arm().await;
        stage.send_goal(elsewhere()).await;
        pass(ms(1000)).await;
        let simulation = stage.simulation().await;
        assert!(!simulation.pid().is_enabled());
        assert_eq!(simulation.effort(), &[0.0, 0.0]);
        assert_eq!(simulation.state().position, [0.0, 0.0]);
    });
}

#[test]
fn the_target_echoes_x_and_y_and_phi_where_one_was_asked_for() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<3>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        let mut oriented = to(1.0, 0.5);
        oriented.target.orientation = Some(0.75);
        stage.send_goal(oriented).await;
        stage.send_goal(to(1.0, 0.5)).await;
        stage.cancel().await.unwrap();
        client.settle().await;
        let targets: Vec<Value> = client
            .messages(RESULT)
            .iter()
            .map(|result| result["target"].clone())
            .collect();
        assert_eq!(
            targets,
            [
                json!({"x": 1.0, "y": 0.5, "phi": 0.75}),
                json!({"x": 1.0, "y": 0.5})
            ]
        );
    });
}

#[test]
fn a_rejected_goal_changes_nothing() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        client.subscribe(FEEDBACK).await;
        client.subscribe("/joint_trajectory").await;
        let goal_id = stage.send_goal(elsewhere()).await;
        client.settle().await;
        let setpoint = *stage.simulation().await.pid().setpoint();
        client.heard.clear();
        assert!(asked(&stage.action, to(2.1, 0.0)).await.is_err());
        for args in [
            json!({"x": 1}),
            json!({"x": 1, "y": 0, "epsilon": -1}),
            json!({"x": 1, "y": 0, "success_hold": "long"}),
        ] {
            client.refusal(SEND, args).await;
        }
        let feedback = client.messages_for(ms(500), FEEDBACK).await;
        assert!(feedback.iter().all(|message| message["goal_id"] == goal_id));
        // Its clock went on from where it was: no new goal under the old name.
        assert!(number(&feedback.last().unwrap()["elapsed"]) > 0.4);
        assert!(client.messages("/joint_trajectory").is_empty());
        assert!(client.messages(RESULT).is_empty());
        assert_eq!(*stage.simulation().await.pid().setpoint(), setpoint);
    });
}

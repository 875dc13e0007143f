//! Services beside a record: which there are, what they answer, and what they refuse.

use super::*;
use crate::stage::numbers;

#[test]
fn the_arm_is_asked_about_as_it_was_and_not_changed() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("settings", &entries).await;
        let mut client = show.connect();
        drive(&mut client, "pause", json!({})).await;
        for (sec, gravity, lengths) in [(3, 4.25, [1.5, 1.0]), (1, 9.81, [1.0, 1.0])] {
            seek(&mut client, sec, 0).await;
            let params = client.ask("/arm_sim/set_params", json!({})).await;
            assert_eq!(number(&params["gravity"]), gravity);
            assert_eq!(numbers(&params["lengths"]), lengths);
            let param = client
                .ask("/rosapi/get_param", json!({"name": "gravity"}))
                .await;
            assert_eq!(param["value"], gravity.to_string());
        }
        let enabled = client.ask("/pid_controller/enable", json!({})).await;
        assert_eq!(enabled["data"], true);
        let integrator = client.ask("/arm_sim/set_integrator", json!({})).await;
        assert_eq!(integrator["method"], "rk4");
        for (service, args, field) in [
            ("/arm_sim/set_params", json!({"gravity": 1}), "gravity"),
            (
                "/arm_sim/set_integrator",
                json!({"timestep": 0.1}),
                "timestep",
            ),
            ("/pid_controller/set_gains", json!({"kp": [1, 1]}), "kp"),
            ("/pid_controller/enable", json!({"data": false}), "data"),
        ] {
            let refused = client.call(service, args).await;
            assert_eq!(refused["result"], false, "{refused}");
            let status = refused["status"].as_str().unwrap();
            assert_eq!(
                status,
                format!("{field} cannot be changed: this is a record")
            );
        }
        let params = client.ask("/arm_sim/set_params", json!({})).await;
        assert_eq!(params["gravity"], 9.81);
    });
}

#[test]
fn what_is_listed_is_served_and_a_live_arms_services_are_not() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("listed", &entries).await;
        let mut client = show.connect();
        let services = client.ask("/rosapi/services", json!({})).await["services"].clone();
        let services: Vec<&str> = services
            .as_array()
            .unwrap()
            .iter()
            .map(|one| one.as_str().unwrap())
            .collect();
        assert!(
            services.contains(&"/rosbag2_player/seek") && services.contains(&"/arm_sim/set_params")
        );
        for missing in [
            "/arm_sim/reset",
            "/ik/solve",
            "/study/stability",
            "/recorder/start",
        ] {
            assert!(!services.contains(&missing), "{missing}");
            let refused = client.call(missing, json!({})).await;
            assert_eq!(
                refused["status"],
                format!("{missing} is not served by this runtime")
            );
        }
        let actions = client.ask("/rosapi/action_servers", json!({})).await;
        assert_eq!(actions["action_servers"], json!([]));
        let seek = client
            .ask(
                "/rosapi/service_type",
                json!({"service": "/rosbag2_player/seek"}),
            )
            .await;
        assert_eq!(seek["type"], "rosbag2_interfaces/srv/Seek");
        let details = client
            .ask(
                "/rosapi/service_request_details",
                json!({"type": "rosbag2_interfaces/srv/Seek"}),
            )
            .await;
        assert_eq!(details["typedefs"][0]["fieldnames"], json!(["time"]));
    });
    // And the other way round.
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let mut client = stage.connect();
        let refused = client.call("/rosbag2_player/pause", json!({})).await;
        assert_eq!(
            refused["status"],
            "/rosbag2_player/pause is not served by this runtime"
        );
    });
}

#[test]
fn bad_wishes_are_refused_by_name() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("refused", &entries).await;
        let mut client = show.connect();
        for rate in [
            json!(0),
            json!(MAX_RATE + 1.0),
            json!(-MAX_RATE - 1.0),
            json!("fast"),
            json!(null),
        ] {
            let refused = client
                .call("/rosbag2_player/set_rate", json!({"rate": rate}))
                .await;
            assert_eq!(refused["result"], false, "{refused}");
            assert!(
                refused["status"]
                    .as_str()
                    .unwrap()
                    .starts_with("rate must be"),
                "{refused}"
            );
        }
        for rate in [MAX_RATE, -MAX_RATE] {
            drive(&mut client, "set_rate", json!({"rate": rate})).await;
        }
        for time in [
            json!(3),
            json!({"sec": -1}),
            json!({"sec": 1, "nanosec": "x"}),
        ] {
            let refused = client
                .call("/rosbag2_player/seek", json!({"time": time}))
                .await;
            assert!(
                refused["status"].as_str().unwrap().starts_with("time"),
                "{refused}"
            );
        }
        let missing = client.call("/rosbag2_player/seek", json!({})).await;
        assert_eq!(missing["status"], "time is required");
        // A time beyond its end is its end.
        seek(&mut client, 4_000_000_000, 0).await;
        let end = drive(&mut client, "get_position", json!({})).await;
        assert_eq!(end["position"], end["duration"]);
    });
}

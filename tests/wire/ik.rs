//! `/ik/solve` of the running program, as any client meets it.

use crate::common::{Client, Runtime};
use pendularm::math::kinematics::forward;
use serde_json::{Value, json};

const SOLVE: &str = "/ik/solve";

fn positions<const N: usize>(values: &Value) -> [f64; N] {
    let positions: Vec<f64> = serde_json::from_value(values["positions"].clone()).unwrap();
    positions.try_into().unwrap()
}

/// Shares of the reach; no two of them make a target on the very edge.
const GRID: [f64; 7] = [-0.99, -0.7, -0.31, 0.0, 0.2, 0.6, 0.95];

/// How many targets of the grid lie within the reach.
fn within_reach() -> usize {
    let targets = GRID.iter().flat_map(|x| GRID.map(|y| x.hypot(y)));
    targets.filter(|distance| *distance < 1.0).count()
}

/// Asks for every target of the grid; what is solved must come back through forward kinematics. Gives how many were.
fn round_trips<const N: usize>(client: &mut Client, lengths: [f64; N], phi: Option<f64>) -> usize {
    let reach: f64 = lengths.iter().sum();
    let mut solved = 0;
    for (x, y) in GRID
        .iter()
        .flat_map(|x| GRID.map(|y| (x * reach, y * reach)))
    {
        let mut args = json!({"x": x, "y": y});
        if let Some(phi) = phi {
            args["phi"] = json!(phi);
        }
        let response = client.call(SOLVE, args);
        if response["result"] == true {
            let q = positions::<N>(&response["values"]);
            let hand = forward(&lengths, &q);
            let miss = (hand.position.x - x).hypot(hand.position.y - y);
            // The specification's own bound.
            assert!(miss <= 1e-9 * reach, "({x}, {y}): {miss}");
            // Two links have no orientation to choose, and ignore what is asked.
            if let Some(phi) = phi.filter(|_| N == 3) {
                let off = (hand.orientation - phi).rem_euclid(std::f64::consts::TAU);
                assert!(off.min(std::f64::consts::TAU - off) < 1e-9);
            }
            solved += 1;
        } else {
            assert_eq!(response["values"], json!({}));
            assert_ne!(response["status"], "");
        }
    }
    solved
}

#[test]
fn two_links_round_trip_through_forward_kinematics() {
    let runtime = Runtime::with_links(2);
    let mut client = runtime.connect();
    assert_eq!(round_trips(&mut client, [1.0, 1.0], None), within_reach());
    assert_eq!(
        round_trips(&mut client, [1.0, 1.0], Some(0.5)),
        within_reach()
    );
}

#[test]
fn three_links_round_trip_with_and_without_an_orientation() {
    let runtime = Runtime::with_links(3);
    let mut client = runtime.connect();
    assert_eq!(round_trips(&mut client, [1.0; 3], None), within_reach());
    let with_phi = round_trips(&mut client, [1.0; 3], Some(2.0));
    assert!((10..within_reach()).contains(&with_phi), "{with_phi}");
}

#[test]
fn a_solve_after_new_lengths_uses_the_new_lengths() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let target = json!({"x": 2.5, "y": 0.5});
    client.refusal(SOLVE, target.clone());
    client.ask("/arm_sim/set_params", json!({"lengths": [2.0, 1.0]}));
    let q = positions::<2>(&client.ask(SOLVE, target));
    let hand = forward(&[2.0, 1.0], &q).position;
    assert!((hand.x - 2.5).hypot(hand.y - 0.5) < 3e-9);
}

#[test]
fn arguments_may_come_as_an_array_in_the_documented_order() {
    let runtime = Runtime::with_links(3);
    let mut client = runtime.connect();
    client.ask("/arm_sim/pause", json!({"data": true}));
    let named = client.ask(SOLVE, json!({"x": 1, "y": 0.5, "phi": 1}));
    assert_eq!(client.ask(SOLVE, json!([1, 0.5, 1])), named);
    assert!(
        client
            .refusal(SOLVE, json!([1, 0.5, 1, 2]))
            .contains("args")
    );
}

#[test]
fn numbers_that_are_not_finite_are_rejected_by_name() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for literal in ["NaN", "Infinity", "-Infinity", "1e999"] {
        client.send_bytes(
            format!("{{\"op\":\"call_service\",\"service\":\"/ik/solve\",\"args\":{{\"x\":{literal},\"y\":0}}}}\n")
                .as_bytes(),
        );
        let response = client.receive_where("a response", |frame| frame["service"] == SOLVE);
        assert_eq!(response["result"], false);
        assert_eq!(response["status"], "x must be a finite number");
    }
}

#[test]
fn solving_moves_nothing() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_trajectory");
    client.subscribe("/ik_action/result");
    client.ask(SOLVE, json!({"x": 1, "y": 1}));
    client.settle();
    assert!(client.kept.iter().all(|frame| frame["op"] != "publish"));
}

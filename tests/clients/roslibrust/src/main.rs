//! roslibrust, unmodified, over WebSocket: `pendularm-client-roslibrust HOST:PORT`.

use std::time::Duration;

use roslibrust::rosbridge::ClientHandle;
use roslibrust::{MessageDescriptor, RosMessageType, RosServiceType};
use serde::{Deserialize, Serialize};
use tokio::time::timeout;

const PATIENCE: Duration = Duration::from_secs(30);

macro_rules! messages {
    ($($name:ident($type_name:literal) { $($field:ident: $kind:ty),* })*) => {$(
        #[derive(Debug, Clone, Default, Serialize, Deserialize)]
        struct $name { $($field: $kind),* }
        impl RosMessageType for $name {
            const DESCRIPTION: MessageDescriptor =
                MessageDescriptor::new::<Self>($type_name, "", "", "", &[0; 32]);
        }
    )*};
}

messages! {
    Nothing("std_msgs/Empty") {}
    Topics("rosapi/TopicsResponse") { topics: Vec<String>, types: Vec<String> }
    Switch("pendularm_interfaces/EnableRequest") { data: bool }
    Target("pendularm_interfaces/SendGoalRequest") { x: f64, y: f64 }
    Accepted("pendularm_interfaces/SendGoalResponse") { goal_id: String }
    JointState("sensor_msgs/JointState") { name: Vec<String>, position: Vec<f64> }
    IkResult("pendularm_interfaces/IkResult") { goal_id: String, outcome: String }
    Point("trajectory_msgs/JointTrajectoryPoint") { positions: Vec<f64> }
    JointTrajectory("trajectory_msgs/JointTrajectory") { points: Vec<Point> }
}

macro_rules! services {
    ($($name:ident($type_name:literal): $request:ty => $response:ty;)*) => {$(
        struct $name;
        impl RosServiceType for $name {
            const ROS_SERVICE_NAME: &'static str = $type_name;
            type Request = $request;
            type Response = $response;
        }
    )*};
}

services! {
    GetTopics("rosapi/Topics"): Nothing => Topics;
    Enable("pendularm_interfaces/Enable"): Switch => Switch;
    SendGoal("pendularm_interfaces/SendGoal"): Target => Accepted;
}

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let address = std::env::args().nth(1).ok_or("HOST:PORT is missing")?;
    let client = ClientHandle::new(format!("ws://{address}")).await?;

    let all = client
        .call_service::<GetTopics>("/rosapi/topics", Nothing {})
        .await?;
    let at = all.topics.iter().position(|topic| topic == "/joint_states");
    let type_name = at.and_then(|at| all.types.get(at)).map(String::as_str);
    assert_eq!(type_name, Some("sensor_msgs/msg/JointState"));

    let states = client.subscribe::<JointState>("/joint_states").await?;
    let state = timeout(PATIENCE, states.next()).await?;
    assert_eq!(state.name, ["joint1", "joint2"]);

    let enabled = client
        .call_service::<Enable>("/pid_controller/enable", Switch { data: true })
        .await?;
    assert!(enabled.data);
    let trajectories = client
        .advertise::<JointTrajectory>("/joint_trajectory")
        .await?;
    let points = vec![Point {
        positions: vec![0.2, 0.3],
    }];
    trajectories.publish(&JointTrajectory { points }).await?;

    let results = client.subscribe::<IkResult>("/ik_action/result").await?;
    let goal = Target { x: 0.5, y: 1.2 };
    let accepted = client
        .call_service::<SendGoal>("/ik_action/send_goal", goal)
        .await?;
    let result = timeout(PATIENCE, results.next()).await?;
    assert_eq!(
        (result.goal_id, result.outcome.as_str()),
        (accepted.goal_id, "reached")
    );
    println!("roslibrust: ok");
    Ok(())
}

//! A node of the crate ros2-client in the graph that pendularm-ros2 makes: ros2-client-peer ROUTER DOMAIN.
//!
//! It has its own CDR, its own tokens, and its own hashes of the services of parameters.

use std::error::Error;
use std::thread::sleep;
use std::time::{Duration, Instant};

use ros2_client::ros2::QosProfile;
use ros2_client::{
    ActionClient, ActionTypeName, Context, ContextOptions, MessageTypeName, Name, Node, NodeName,
    NodeOptions, Parameter, ParameterValue,
};
use serde::{Deserialize, Serialize};

type Done<T = ()> = Result<T, Box<dyn Error>>;

/// A wait that takes longer has failed.
const LIMIT: Duration = Duration::from_secs(60);

#[derive(Debug, Deserialize)]
struct Stamp {
    sec: i32,
    nanosec: u32,
}

#[derive(Debug, Deserialize)]
struct Header {
    stamp: Stamp,
    frame_id: String,
}

#[derive(Debug, Deserialize)]
struct JointState {
    header: Header,
    name: Vec<String>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    effort: Vec<f64>,
}

#[derive(Serialize, Deserialize)]
struct Nothing {}

fn wait_for<T>(what: &str, mut get: impl FnMut() -> Option<T>) -> Done<T> {
    let deadline = Instant::now() + LIMIT;
    loop {
        if let Some(found) = get() {
            return Ok(found);
        }
        if Instant::now() > deadline {
            return Err(format!("not within {LIMIT:?}: {what}").into());
        }
        sleep(Duration::from_millis(10));
    }
}

fn check(is_so: bool, what: &str) -> Done {
    if is_so { Ok(()) } else { Err(what.into()) }
}

fn open(router: &str, domain: &str) -> Done<Context> {
    let mut config = zenoh::Config::default();
    let endpoints = format!("[{router:?}]");
    for (key, value) in [
        ("mode", "\"client\""),
        ("connect/endpoints", endpoints.as_str()),
        ("scouting/multicast/enabled", "false"),
    ] {
        config
            .insert_json5(key, value)
            .map_err(|error| error.to_string())?;
    }
    let options = ContextOptions::new()
        .domain_id(domain.parse()?)
        .zenoh_config(config);
    Ok(Context::with_options(options)?)
}

fn the_graph_shows_the_arm(context: &Context) -> Done {
    wait_for("the arm's node", || {
        let names = context.node_names();
        names.iter().any(|name| name == "/arm_sim").then_some(())
    })?;
    for topic in ["/joint_states", "/robot_description", "/tf"] {
        wait_for(topic, || {
            (context.publisher_count(topic) == 1).then_some(())
        })?;
    }
    let topic = "/joint_trajectory";
    wait_for(topic, || {
        (context.subscription_count(topic) == 1).then_some(())
    })
}

fn joint_states_are_read(node: &Node) -> Done<usize> {
    let topic = node.create_topic(
        &Name::new("/", "joint_states")?,
        MessageTypeName::new("sensor_msgs", "JointState"),
        &QosProfile::default(),
    );
    let subscription = node.create_subscription::<JointState>(&topic, None)?;
    let (mut last, mut different) = (None, 0);
    for number in 0..60 {
        let (state, _) = wait_for("joint states", || subscription.try_take().ok().flatten())?;
        let stamp = (state.header.stamp.sec, state.header.stamp.nanosec);
        // A tick that comes late is followed at once by the next, perhaps before the arm has taken a step.
        check(last <= Some(stamp), "stamps that never go back")?;
        different += u32::from(last < Some(stamp));
        last = Some(stamp);
        let lengths = [&state.position, &state.velocity, &state.effort].map(Vec::len);
        let is_whole = state.name == ["joint1", "joint2"] && lengths == [2, 2, 2];
        let is_whole = is_whole && state.header.frame_id == "world";
        check(is_whole, &format!("{number}: {state:?}"))?;
    }
    check(different >= 50, "stamps that grow")?;
    Ok(60)
}

fn parameters_are_read_and_set(node: &Node) -> Done<usize> {
    let client = node.create_parameter_client(&NodeName::new("/", "arm_sim")?)?;
    let names = client.list_parameters(&[])?;
    check(
        names.iter().any(|name| name == "gravity"),
        "gravity is listed",
    )?;
    let set = |value| {
        let name = "gravity".to_owned();
        client.set_parameters([Parameter { name, value }])
    };
    check(
        set(ParameterValue::Double(1.62))? == [Ok(())],
        "gravity is set",
    )?;
    let values = client.get_parameters(&["gravity", "nonsense"])?;
    let expected = [ParameterValue::Double(1.62), ParameterValue::NotSet];
    check(values == expected, &format!("{values:?}"))?;
    let refused = set(ParameterValue::String("heavy".to_owned()))?;
    let is_refused = refused
        .iter()
        .all(|one| one.as_ref().is_err_and(|why| !why.is_empty()));
    check(is_refused && refused.len() == 1, &format!("{refused:?}"))?;
    check(
        set(ParameterValue::Double(9.81))? == [Ok(())],
        "gravity is set back",
    )?;
    let described = client.describe_parameters(&["gravity"])?;
    check(described.len() == 1, "gravity is described")?;
    Ok(names.len())
}

/// The crate knows the hashes of no action but one, so that it can't send a goal; it can cancel, and hears the states.
fn goals_are_cancelled(node: &Node) -> Done<String> {
    let name = Name::new("/", "ik_action")?;
    let kind = ActionTypeName::new("pendularm_interfaces", "MoveTo");
    let client: ActionClient<Nothing, Nothing, Nothing> =
        node.create_action_client(&name, &kind)?;
    let answer = client.cancel_all_goals()?;
    check(answer.goals_canceling.is_empty(), "no goal is there")?;
    Ok(format!("{:?}", answer.return_code))
}

fn main() -> Done {
    let mut words = std::env::args().skip(1);
    let (Some(router), Some(domain)) = (words.next(), words.next()) else {
        return Err("ros2-client-peer ROUTER DOMAIN".into());
    };
    let context = open(&router, &domain)?;
    let options = NodeOptions::new().enable_rosout(false);
    let node = context.new_node(NodeName::new("/", "ros2_client_peer")?, options)?;
    the_graph_shows_the_arm(&context)?;
    println!("{} joint states", joint_states_are_read(&node)?);
    println!("{} parameters", parameters_are_read_and_set(&node)?);
    println!("goals are cancelled: {}", goals_are_cancelled(&node)?);
    Ok(())
}

//! The node `rosapi`: its questions to the arm, for other nodes and for clients.

use crate::system::in_virtual_time;
use actix::prelude::*;
use pendularm::actors::arm::ik_action::GoalTracker;
use pendularm::actors::arm::sim::{ArmSim, SetParams};
use pendularm::actors::compute::integration::Integration;
use pendularm::actors::compute::study::Study;
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::gateway::registry::Attach;
use pendularm::actors::node::ask;
#[cfg(feature = "record")]
use pendularm::actors::recorder::Recorder;
use pendularm::actors::resources::aside::{PLACES, WorkKind, aside};
use pendularm::actors::ros::parameters::Parameters;
use pendularm::actors::ros::rosapi::{
    ArmParameters, GetParam, NotSet, ParamChange, ParameterValue, RosapiNode, SetParam,
};
use pendularm::actors::ros::tf_web::TfRepublisher;
use pendularm::actors::wire::Nodes;
use pendularm::math::arm::Arm;
use pendularm::math::pid::Gains;
use pendularm::protocol::catalog::{self, Service};
use pendularm::protocol::ros::parameters::Parameter;
use serde_json::{Value, json};

use crate::stage::start_goal_nodes;
use crate::virtual_time::{Gateway, Peer, WIDE};

/// A gateway with the arm and `rosapi` behind it.
async fn start() -> (Gateway, Addr<RosapiNode<2>>) {
    let gateway = Gateway::bare().await;
    let publish = gateway.registry.clone().recipient();
    let gauges = std::sync::Arc::clone(&gateway.gauges);
    let arm = ArmSim::<2>::new(Arm::default(), Gains::default(), publish, gauges).start();
    let parameters = ArmParameters::of(&arm);
    let rosapi = RosapiNode::new(gateway.registry.clone().recipient(), parameters).start();
    let mut nodes = Nodes::default();
    RosapiNode::attach(&rosapi, &mut nodes);
    gateway.registry.send(Attach(nodes)).await.unwrap();
    (gateway, rosapi)
}

#[test]
fn a_parameter_is_set_and_read_as_a_value() {
    in_virtual_time(async {
        let (_gateway, rosapi) = start().await;
        let set = |gravity| {
            let change = SetParams {
                gravity: Some(gravity),
                ..SetParams::default()
            };
            let change = Ok(ParamChange::Params(change));
            ask(&rosapi.clone().recipient(), SetParam::<2> { change })
        };
        assert_eq!(set(3.7).await, Ok(Ok(())));
        let answer = set(f64::NAN).await.unwrap();
        assert!(matches!(answer, Err(NotSet::Rejected(_))), "{answer:?}");
        let question = GetParam::<2> {
            parameter: Some(Parameter::Gravity),
            default: String::new(),
        };
        let answer = ask(&rosapi.recipient(), question).await;
        assert_eq!(answer, Ok(Ok(ParameterValue::Number(3.7))));
    });
}

#[test]
fn every_service_that_is_listed_is_served() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let publish = || gateway.registry.clone().recipient();
        let gauges = std::sync::Arc::clone(&gateway.gauges);
        let arm = ArmSim::<2>::new(Arm::default(), Gains::default(), publish(), gauges).start();
        let mut nodes = Nodes::default();
        ArmSim::attach(&arm, &mut nodes);
        let tracker = GoalTracker::of(&arm);
        let pose = arm.clone().recipient();
        start_goal_nodes(&gateway.registry, pose, tracker, 1, &mut nodes);
        let pool = WorkerPool::without_threads();
        let study = Study::<2>::new(arm.clone().recipient(), pool.clone()).start();
        Study::attach(&study, &mut nodes);
        Integration::attach(&Integration::new(pool).start(), &mut nodes);
        let parameters = ArmParameters::of(&arm);
        Parameters::attach(&Parameters::new(parameters.clone()).start(), &mut nodes);
        let rosapi = RosapiNode::new(gateway.registry.clone().recipient(), parameters).start();
        RosapiNode::attach(&rosapi, &mut nodes);
        let frames = TfRepublisher::new(arm.clone().recipient(), publish()).start();
        TfRepublisher::attach(&frames, &mut nodes);
        #[cfg(feature = "record")]
        {
            let registry = gateway.registry.clone().recipient();
            let recorder = Recorder::<2>::new(arm.recipient(), registry, None, 1).start();
            Recorder::attach(&recorder, &mut nodes);
        }
        let questions = catalog::Rosapi::ALL.map(Service::Rosapi);
        for service in Service::ALL.into_iter().chain(questions) {
            assert!(nodes.services.contains_key(&service), "{service:?}");
        }
    });
}

async fn response(client: &mut Peer, question: &str, args: Value) -> Value {
    let service = format!("/rosapi/{question}");
    client
        .send(json!({"op": "call_service", "service": service, "args": args}))
        .await;
    client.receive().await
}

#[test]
fn a_question_without_its_field_or_with_arguments_of_another_form_is_refused() {
    in_virtual_time(async {
        let (gateway, _) = start().await;
        let mut client = gateway.connect(WIDE);
        let nameless = response(&mut client, "topic_type", json!({})).await;
        assert_eq!(
            (&nameless["result"], &nameless["status"]),
            (&json!(false), &json!("topic is required"))
        );
        let neither = response(&mut client, "topics", json!(5)).await;
        assert_eq!(neither["result"], false);
        let positional = response(&mut client, "topic_type", json!(["/clock"])).await;
        assert_eq!(
            positional["values"],
            json!({"type": "rosgraph_msgs/msg/Clock"})
        );
    });
}

/// A list of thousands is made only for a client that is about to write it: one that waits holds
/// none.
#[test]
fn the_list_is_made_once_there_is_a_place_to_write_it() {
    in_virtual_time(async {
        let (gateway, _rosapi) = start().await;
        let (mut asker, mut other) = (gateway.connect(WIDE), gateway.connect(WIDE));
        for n in 0..100 {
            other.advertise(&format!("/t/{n}")).await;
        }
        other.call("/none", 1).await;
        other.receive().await;
        let (free, held) = std::sync::mpsc::channel::<()>();
        let held = std::sync::Arc::new(std::sync::Mutex::new(held));
        for _ in 0..PLACES {
            let held = std::sync::Arc::clone(&held);
            actix_rt::spawn(aside(WorkKind::Listing, move || {
                held.lock().unwrap().recv()
            }));
        }
        turns().await;
        let question = json!({"op": "call_service", "service": "/rosapi/topics"});
        asker.send(question).await;
        turns().await;
        other.advertise("/late").await;
        turns().await;
        drop(free);
        let answer = asker.receive().await;
        let topics = answer["values"]["topics"].as_array().unwrap();
        assert!(topics.contains(&json!("/late")), "{topics:?}");
        assert!(topics.contains(&json!("/t/99")));
    });
}

/// Lets everything happen that waits for nothing but its turn. The clock stands still while another thread is at work.
async fn turns() {
    for _ in 0..100 {
        tokio::task::yield_now().await;
    }
}

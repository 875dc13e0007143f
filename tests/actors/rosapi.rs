//! The node `rosapi`: its questions to the arm, for other nodes and for clients.

use crate::system::in_virtual_time;
use actix::prelude::*;
use pendularm::actors::arm::sim::SetParams;
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::gateway::registry::Attach;
use pendularm::actors::node::ask;
#[cfg(feature = "record")]
use pendularm::actors::recorder::Recorder;
use pendularm::actors::resources::aside::{PLACES, WorkKind, aside};
use pendularm::actors::ros::rosapi::{
    GetParam, NotSet, ParamChange, ParameterValue, RosapiNode, SetParam,
};
use pendularm::actors::wire::Nodes;
use pendularm::protocol::catalog::{self, Service};
use pendularm::protocol::ros::parameters::Parameter;
use serde_json::{Value, json};

use crate::nodes::start_nodes;
use crate::virtual_time::{Gateway, Peer, WIDE};

/// A gateway with all nodes, and `rosapi`.
async fn start() -> (Gateway, Addr<RosapiNode<2>>) {
    let gateway = Gateway::bare().await;
    let mut nodes = Nodes::default();
    let pool = WorkerPool::without_threads();
    let started = start_nodes(&gateway.registry, &gateway.gauges, &pool, 1, &mut nodes);
    gateway.registry.send(Attach(nodes)).await.unwrap();
    (gateway, started.rosapi)
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
        let mut nodes = Nodes::default();
        let pool = WorkerPool::without_threads();
        let started = start_nodes::<2>(&gateway.registry, &gateway.gauges, &pool, 1, &mut nodes);
        #[cfg(feature = "record")]
        {
            let registry = gateway.registry.clone().recipient();
            let recorder = Recorder::new(started.arm.recipient(), registry, None, 1).start();
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

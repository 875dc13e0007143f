//! The node `rosapi`: that every listed service is served, and when its lists are made.

use crate::system::in_virtual_time;
use actix::prelude::*;
use pendularm::actors::compute::workers::WorkerPool;
#[cfg(feature = "record")]
use pendularm::actors::recorder::Recorder;
use pendularm::actors::resources::long_work::{PLACES, WorkKind, run_long_work};
use pendularm::actors::wire::Nodes;
use pendularm::protocol::catalog::{self, Service};
use serde_json::json;

use crate::nodes::start_whole;
use crate::virtual_time::{Gateway, WIDE};
use pendularm::actors::nodes::start_arm;

#[test]
fn every_service_that_is_listed_is_served() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut nodes = Nodes::default();
        let pool = WorkerPool::without_threads();
        let arm = start_arm::<2>(&gateway.registry, &gateway.gauges, &pool, 1, &mut nodes);
        #[cfg(feature = "record")]
        {
            let registry = gateway.registry.clone().recipient();
            let recorder = Recorder::new(arm.recipient(), registry, None, 1).start();
            Recorder::attach(&recorder, &mut nodes);
        }
        let questions = catalog::Rosapi::ALL.map(Service::Rosapi);
        for service in Service::ALL.into_iter().chain(questions) {
            assert!(nodes.services.contains_key(&service), "{service:?}");
        }
    });
}

/// A list of thousands is made only when the client can write it. A waiting client holds no list.
#[test]
fn the_list_is_made_once_there_is_a_place_to_write_it() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        start_whole::<2>(&gateway.registry, &gateway.gauges, 1).await;
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
            actix_rt::spawn(run_long_work(WorkKind::Listing, move || {
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

/// Runs every task that only waits for its turn. The clock does not move while another thread works.
async fn turns() {
    for _ in 0..100 {
        tokio::task::yield_now().await;
    }
}

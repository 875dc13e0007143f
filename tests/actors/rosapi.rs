//! Every listed service is served. `exchanges/rosapi.txt` has the lists.

use crate::system::in_virtual_time;
use actix::prelude::*;
use pendularm::actors::compute::workers::WorkerPool;
#[cfg(feature = "record")]
use pendularm::actors::recorder::Recorder;
use pendularm::actors::wire::Nodes;
use pendularm::protocol::catalog::{self, Service};

use crate::virtual_time::Gateway;
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

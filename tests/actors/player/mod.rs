//! A record in the arm's place: what clients hear of it, forward, back and from anywhere. Here a run of four seconds,
//! and its record being played.

mod bounds;
mod files;
mod playing;
mod services;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use actix::prelude::*;
use pendularm::actors::gateway::registry::{Attach, Registry};
use pendularm::actors::player::{self, MAX_RATE};
use pendularm::actors::resources::gauges::Gauges;
use pendularm::actors::wire::Nodes;
use pendularm::record::RecordEntry;
use serde_json::{Value, json};
use tokio::time::sleep;

use crate::recorder::{Notes, file, stop};
use crate::stage::{Client, Stage, connect, ms, number};
use crate::system::in_virtual_time;

/// A run of four seconds: the controller on, a setpoint, and after two seconds longer links and less gravity.
async fn run() -> Vec<RecordEntry> {
    let stage = Stage::<2>::start().await;
    let mut client = stage.connect();
    let notes = Notes::default();
    notes.take(&stage).await;
    client.enable().await;
    sleep(ms(500)).await;
    client.publish_trajectory(json!([0.5, -0.5])).await;
    sleep(ms(1500)).await;
    let changed = json!({"lengths": [1.5, 1.0], "gravity": 4.25});
    client.ask("/arm_sim/set_params", changed).await;
    sleep(ms(2000)).await;
    stop(&stage).await;
    notes.entries()
}

/// A record under a name of its own, being played.
struct Show {
    registry: Addr<Registry>,
    gauges: Arc<Gauges>,
}

fn on_disk(name: &str, bytes: &[u8]) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("player-{name}.mcap"));
    fs::write(&path, bytes).unwrap();
    path
}

impl Show {
    async fn of(name: &str, entries: &[RecordEntry]) -> Self {
        let gauges = Arc::new(Gauges::default());
        let registry = Registry::new(Arc::clone(&gauges)).start();
        let mut nodes = Nodes::default();
        let path = on_disk(name, &file(entries));
        player::start(&path, &registry, System::current().arbiter(), &mut nodes).unwrap();
        registry.send(Attach(nodes)).await.unwrap();
        Self { registry, gauges }
    }

    fn connect(&self) -> Client {
        connect(&self.registry, &self.gauges)
    }
}

async fn drive(client: &mut Client, how: &str, args: Value) -> Value {
    client.ask(&format!("/rosbag2_player/{how}"), args).await
}

async fn seek(client: &mut Client, sec: u32, nanosec: u32) {
    let time = json!({"time": {"sec": sec, "nanosec": nanosec}});
    let answer = drive(client, "seek", time).await;
    assert_eq!(answer, json!({"success": true}));
}

async fn position(client: &mut Client) -> f64 {
    number(&drive(client, "get_position", json!({})).await["position"])
}

fn time_of(state: &Value) -> f64 {
    let stamp = &state["header"]["stamp"];
    number(&stamp["sec"]) + 1e-9 * number(&stamp["nanosec"])
}

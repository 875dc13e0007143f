//! Records of runs: the reports of arm and registry suffice to repeat every step.

mod contents;
mod damage;
mod replays;

use std::sync::{Arc, Mutex};

use pendularm::actors::arm::sim::SetListener;
use pendularm::actors::gateway::registry::SetTap;
use pendularm::actors::recorder::listeners;
use pendularm::math::integrator::Method;
use pendularm::record::{
    Content, McapWriter, RecordEnding, RecordEntry, RecordedMessage, Recording, ReplayVerdict,
    RunSettings, replay,
};
use serde_json::json;
use tokio::time::{Instant, sleep};

use crate::stage::{Stage, ms};
use crate::system::in_virtual_time;
use crate::virtual_time::Client;

/// Entries in the order in which they are reported.
#[derive(Clone, Default)]
struct Notes(Arc<Mutex<Noted>>);

#[derive(Default)]
struct Noted {
    began: Option<Instant>,
    entries: Vec<RecordEntry>,
}

impl Notes {
    fn put(&self, content: Content) {
        let mut noted = self.0.lock().unwrap();
        let began = *noted.began.get_or_insert_with(Instant::now);
        let log_time = began.elapsed().as_nanos() as u64;
        noted.entries.push(RecordEntry { log_time, content });
    }

    fn entries(&self) -> Vec<RecordEntry> {
        self.0.lock().unwrap().entries.clone()
    }

    /// Starts to record all messages.
    async fn take<const N: usize>(&self, stage: &Stage<N>) {
        let (of_arm, of_registry) = (self.clone(), self.clone());
        let listener = listeners::arm::<N>(move |content| {
            of_arm.put(content);
            true
        });
        stage.arm.send(SetListener(Some(listener))).await.unwrap();
        let tap = listeners::registry(move |content| {
            if let Some(content) = content {
                of_registry.put(content);
            }
        });
        let set_tap = SetTap(Some(tap));
        stage.gateway.registry.send(set_tap).await.unwrap();
    }
}

pub fn file(entries: &[RecordEntry]) -> Vec<u8> {
    let settings = RunSettings { links: 2, seed: 1 };
    let mut writer = McapWriter::new(Vec::new(), &settings).unwrap();
    for (number, entry) in entries.iter().enumerate() {
        writer.write(entry).unwrap();
        if number % 20 == 19 {
            writer.flush().unwrap();
        }
    }
    writer.finish().unwrap()
}

pub fn passages(file: &[u8]) -> (Vec<RecordedMessage>, RecordEnding) {
    let mut recording = Recording::new(file);
    let mut passages = Vec::new();
    while let Some(passage) = recording.next_passage().unwrap() {
        passages.push(passage);
    }
    (passages, recording.ending().unwrap())
}

pub fn replayed(entries: &[RecordEntry]) -> ReplayVerdict {
    replay(&*file(entries)).unwrap()
}

async fn stop<const N: usize>(stage: &Stage<N>) {
    stage.arm.send(SetListener::<N>(None)).await.unwrap();
    stage.gateway.registry.send(SetTap(None)).await.unwrap();
}

/// Sends a path of two points, which takes a third of a second.
async fn follow_path(client: &mut Client, positions: &[f64]) {
    let names: Vec<String> = (1..=positions.len())
        .map(|joint| format!("joint{joint}"))
        .collect();
    let point = |positions: &[f64], time: u32| json!({"positions": positions, "time_from_start": {"sec": 0, "nanosec": time}});
    let halfway: Vec<f64> = positions.iter().map(|position| 0.5 * position).collect();
    let points = [point(&halfway, 150_000_000), point(positions, 350_000_000)];
    let action = "/joint_trajectory_controller/follow_joint_trajectory";
    let trajectory = json!({"joint_names": names, "points": points});
    client
        .send(&json!({"op": "send_action_goal", "id": "path", "action": action, "args": {"trajectory": trajectory}}))
        .await;
}

/// One random action of a client that changes the arm's steps.
async fn do_something<const N: usize>(client: &mut Client, rng: &mut fastrand::Rng) {
    let mut numbers = |low: f64, high: f64| -> Vec<f64> {
        (0..N).map(|_| low + (high - low) * rng.f64()).collect()
    };
    let (poses, weights) = (numbers(-2.0, 2.0), numbers(0.5, 2.0));
    let (service, args) = match rng.u32(..20) {
        0 => ("/pid_controller/enable", json!({"data": rng.bool()})),
        1 => ("/pid_controller/set_gains", json!({"kp": weights})),
        2 => (
            "/arm_sim/set_params",
            json!({"masses": weights, "gravity": 10.0 * rng.f64()}),
        ),
        3 => ("/arm_sim/set_params", json!({"lengths": weights})),
        4 => {
            let timestep = 0.0005 + 0.001 * rng.f64();
            let method = rng.choice(Method::ALL).unwrap().name();
            (
                "/arm_sim/set_integrator",
                json!({"method": method, "timestep": timestep}),
            )
        }
        5 => (
            "/arm_sim/disturb",
            json!({"effort": poses, "duration": 0.2 * rng.f64() + 1e-9}),
        ),
        6 => ("/arm_sim/reset", json!({})),
        7 => ("/arm_sim/pause", json!({"data": rng.bool()})),
        8 => ("/arm_sim/step", json!({"steps": rng.u32(1..50)})),
        9 => ("/ik_trial/start", json!({})),
        10 => ("/pid_controller/set_gains", json!({})),
        11 => (
            "/pid_controller/set_period",
            json!({"period": 0.02 * rng.f64(), "delay": rng.bool()}),
        ),
        12 => ("/arm_sim/set_state", json!({"position": poses})),
        13 => (
            "/arm_sim/step",
            json!({"steps": rng.u32(1..50), "effort": weights}),
        ),
        16 => {
            let forms = ["clamp", "none", "conditional", "back_calculation"];
            let effort = json!(
                weights
                    .iter()
                    .map(|weight| 30.0 * weight)
                    .collect::<Vec<_>>()
            );
            let effort = if rng.bool() { effort } else { json!(null) };
            (
                "/pid_controller/set_limits",
                json!({"effort": effort, "anti_windup": rng.choice(forms).unwrap(), "tracking_time": 0.01 + rng.f64()}),
            )
        }
        18 => (
            "/pid_controller/set_sensors",
            json!({
                "encoder_step": if rng.bool() { weights.iter().map(|one| 1e-3 * one).collect() } else { vec![0.0; N] },
                "velocity": rng.choice(["exact", "difference"]).unwrap(),
                "delay": rng.u32(..4),
            }),
        ),
        17 => ("/arm_sim/set_friction", json!({"viscous": weights})),
        14 => return client.command_effort(json!(weights)).await,
        15 => return follow_path(client, &poses).await,
        _ => return client.publish_trajectory(json!(poses)).await,
    };
    client.call(service, args).await;
}

pub async fn random_run<const N: usize>(seed: u64) -> Vec<RecordEntry> {
    let stage = Stage::<N>::with_seed(seed).await;
    let mut client = stage.connect();
    let mut rng = fastrand::Rng::with_seed(seed);
    // A record may begin during any operation.
    for _ in 0..rng.u32(..8) {
        do_something::<N>(&mut client, &mut rng).await;
        sleep(ms(rng.u64(..90))).await;
    }
    let notes = Notes::default();
    notes.take(&stage).await;
    for _ in 0..40 {
        do_something::<N>(&mut client, &mut rng).await;
        sleep(ms(rng.u64(..90))).await;
    }
    stop(&stage).await;
    notes.entries()
}

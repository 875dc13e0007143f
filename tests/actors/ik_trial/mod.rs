//! Trials from end to end, in virtual time: what is sampled, counted and reported, and what happens when others meddle.
//!
//! Where the arm floats, at rest and weightless, and epsilon is as large as the world, every target is reached at once:
//! after one step that finds the hand there, and `success_hold` more. Then counts and times can be told beforehand.

mod duration;
mod others;
mod stand_ins;
mod starting;
mod status;
mod whole;

use std::sync::atomic::Ordering;

use crate::stage::{
    Client, Published, SilentArm, Stage, connect, counting_wake_ups, in_virtual_time, ms, number,
    pass,
};
use actix::prelude::*;
use pendularm::actors::arm::ik::Ik;
use pendularm::actors::arm::ik_action::IkAction;
use pendularm::actors::arm::ik_trial::{GoalClient, IkTrial, StartTrial};
use pendularm::actors::gateway::registry::{Attach, Nodes, Registry};
use pendularm::actors::node::{Interest, Publish, ask};
use pendularm::math::pid::Gains;
use pendularm::protocol::catalog::Topic;
use serde_json::{Value, json};
use tokio::sync::mpsc::unbounded_channel;

const START: &str = "/ik_trial/start";
const SKIP: &str = "/ik_trial/skip";
const STOP: &str = "/ik_trial/stop";
const STATUS: &str = "/ik_trial/status";
const RESULT: &str = "/ik_action/result";
const SEND: &str = "/ik_action/send_goal";
const CANCEL: &str = "/ik_action/cancel_goal";

/// Differences of simulation times: a few units in the last place of 100 s.
const ROUNDING: f64 = 1e-12;

/// Targets that a floating arm reaches after 1 ms and `success_hold`.
fn easy(duration: f64, success_hold: f64) -> Value {
    json!({"duration": duration, "epsilon": 1e6, "success_hold": success_hold})
}

/// Targets that a floating arm never reaches.
fn hard(duration: f64) -> Value {
    json!({"duration": duration, "epsilon": 1e-9, "success_hold": 0})
}

/// The latest status, once all that is under way has arrived.
async fn status(client: &mut Client) -> Value {
    client.messages_for(ms(101), STATUS).await.pop().unwrap()
}

async fn floating_and_watched() -> (Stage<2>, Client) {
    let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
    client.subscribe(STATUS).await;
    client.subscribe(RESULT).await;
    client.heard.clear();
    (stage, client)
}

/// What is left when nothing is pursued any more.
fn assert_nothing_in_flight(status: &Value) {
    for field in ["target", "error", "desired_positions"] {
        assert_eq!(status[field], Value::Null, "{field}");
    }
    assert_eq!(status["action_status"], "idle");
}

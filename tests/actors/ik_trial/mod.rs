//! Trials from end to end, in virtual time: targets sampled, counted and reported, also when others meddle.
//!
//! The node is asked as another node asks it. A client's calls are here where the order of responses is meant, or what
//! is made of their fields.
//!
//! Where the arm floats, at rest and weightless, and epsilon is as large as the world, every target is reached at once:
//! after one step that finds the end effector there, and `success_hold` more. Then counts and times can be told beforehand.

mod duration;
mod others;
mod stand_ins;
mod status;
mod whole;

use std::sync::atomic::Ordering;

use crate::stage::{Client, Published, SilentArm, Stage, asked, connect, ms, number, pass};
use crate::system::{counting_wake_ups, in_virtual_time};
use actix::prelude::*;
use pendularm::actors::arm::ik::Ik;
use pendularm::actors::arm::ik_action::{CancelGoal, IkAction, Meant, SendGoal};
use pendularm::actors::arm::ik_trial::{GoalClient, IkTrial, SkipTarget, StartTrial, StopTrial};
use pendularm::actors::gateway::registry::{Attach, Nodes, Registry};
use pendularm::actors::node::{Interest, Publish};
use pendularm::math::goal::Criteria;
use pendularm::math::kinematics::Target;
use pendularm::math::pid::Gains;
use pendularm::math::trial::{Changes, Settings};
use pendularm::protocol::catalog::Topic;
use serde_json::{Value, json};
use tokio::sync::mpsc::unbounded_channel;

const START: &str = "/ik_trial/start";
const SKIP: &str = "/ik_trial/skip";
const STOP: &str = "/ik_trial/stop";
const STATUS: &str = "/ik_trial/status";
const RESULT: &str = "/ik_action/result";

/// Differences of simulation times: a few units in the last place of 100 s.
const ROUNDING: f64 = 1e-12;

/// Targets that a floating arm reaches after 1 ms and `success_hold`.
fn easy(duration: f64, success_hold: f64) -> StartTrial {
    start(duration, 1e6, success_hold)
}

/// Targets that a floating arm never reaches.
fn hard(duration: f64) -> StartTrial {
    start(duration, 1e-9, 0.0)
}

fn start(duration: f64, epsilon: f64, success_hold: f64) -> StartTrial {
    changed(Changes {
        duration: Some(duration),
        epsilon: Some(epsilon),
        success_hold: Some(success_hold),
    })
}

fn changed(changes: Changes) -> StartTrial {
    StartTrial {
        changes,
        ..StartTrial::default()
    }
}

/// A goal of somebody else, which a floating arm never reaches.
fn theirs() -> SendGoal<2> {
    SendGoal {
        target: Target {
            position: glam::DVec2::ONE,
            orientation: None,
        },
        criteria: Criteria::default(),
        owner: None,
    }
}

/// Starts a trial that must start, and gives the settings in force.
async fn begin<const N: usize>(trial: &Addr<IkTrial<N>>, question: StartTrial) -> Settings {
    let terms = asked(trial, question).await;
    assert_eq!(terms.outcome, Ok(()));
    terms.settings
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

/// Asserts that nothing is pursued any more.
fn assert_nothing_in_flight(status: &Value) {
    for field in ["target", "error", "desired_positions"] {
        assert_eq!(status[field], Value::Null, "{field}");
    }
    assert_eq!(status["action_status"], "idle");
}

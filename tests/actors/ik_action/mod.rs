//! Goals from end to end, in virtual time: what is accepted, what is said in which order, and when a goal is reached,
//! counted in steps.
//!
//! Many of these tests let the arm float: without gravity, and with the controller off, it stays at q = 0, the hand of
//! two links of 1 m at exactly (2, 0). A goal there has been reached on time if it has been reached to the step.

mod accepting;
mod ending;
mod feedback;
mod reaching;
mod reset;
use std::time::Duration;

use crate::stage::{
    Client, Published, SilentArm, Stage, in_virtual_time, ms, number, numbers, pass,
};
use actix::prelude::*;
use pendularm::actors::arm::ik::Ik;
use pendularm::actors::arm::ik_action::{GoalTracker, IkAction, SendGoal};
use pendularm::actors::arm::sim::{ArmPose, CommandGoal, GoalJudged, TrackGoal, Tracking};
use pendularm::actors::node::{Interest, Publish, ask};
use pendularm::math::goal::{Criteria, Outcome};
use pendularm::math::kinematics::{Target, forward};
use pendularm::protocol::catalog::Topic;
use serde_json::{Value, json};
use tokio::sync::mpsc::{UnboundedSender, unbounded_channel};

const FEEDBACK: &str = "/ik_action/feedback";
const RESULT: &str = "/ik_action/result";
const SEND: &str = "/ik_action/send_goal";
const CANCEL: &str = "/ik_action/cancel_goal";

/// One step of the default timestep \[s\].
const STEP: f64 = 0.001;
/// Simulation times are differences of products of steps and timestep: a few units in the last place of 100 s.
const ROUNDING: f64 = 1e-12;

/// A goal where the floating arm's hand is, held so long \[s\].
fn here(success_hold: f64) -> Value {
    json!({"x": 2, "y": 0, "epsilon": 0.1, "success_hold": success_hold})
}

/// A goal that the floating arm does not come near.
fn elsewhere() -> Value {
    json!({"x": 1, "y": 1})
}

fn call(service: &str, args: &Value) -> Value {
    json!({"op": "call_service", "service": service, "args": args})
}

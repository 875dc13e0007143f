//! Goals from end to end, in virtual time: acceptance, the order of messages, and when a goal is reached, counted in
//! steps.
//!
//! Goals are sent as another node sends them. A client's calls are here where the order of responses and messages is
//! meant, or what is made of their fields.
//!
//! Many of these tests let the arm float: without gravity, and with the controller off, it stays at q = 0, the end
//! effector of two links of 1 m at exactly (2, 0). A goal there has been reached on time if it has been reached to the step.

mod accepting;
mod ending;
mod feedback;
mod reaching;
mod reset;
use std::time::Duration;

use crate::stage::{Published, SilentArm, Stage, asked, ms, number, numbers, pass};
use crate::system::in_virtual_time;
use actix::prelude::*;
use pendularm::actors::arm::ik::Ik;
use pendularm::actors::arm::ik_action::{
    CancelGoal, CancelRejected, GoalTracker, IkAction, Meant, SendGoal,
};
use pendularm::actors::arm::sim::{
    ArmPose, CommandGoal, GoalJudged, SetIntegrator, TrackGoal, Tracking,
};
use pendularm::actors::node::{Interest, Publish, ask};
use pendularm::math::goal::{Criteria, Outcome};
use pendularm::math::integrator::Method;
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

/// A goal with the usual criteria.
fn to<const N: usize>(x: f64, y: f64) -> SendGoal<N> {
    SendGoal {
        target: Target {
            position: glam::dvec2(x, y),
            orientation: None,
        },
        criteria: Criteria::default(),
        owner: None,
    }
}

/// A goal where the floating arm's end effector is, held so long \[s\].
fn here(success_hold: f64) -> SendGoal<2> {
    let criteria = Criteria {
        epsilon: 0.1,
        success_hold,
    };
    SendGoal {
        criteria,
        ..to(2.0, 0.0)
    }
}

/// A goal that the floating arm does not come near.
fn elsewhere() -> SendGoal<2> {
    to(1.0, 1.0)
}

/// The same, as a client has it.
fn elsewhere_as_args() -> Value {
    json!({"x": 1, "y": 1})
}

fn call(service: &str, args: &Value) -> Value {
    json!({"op": "call_service", "service": service, "args": args})
}

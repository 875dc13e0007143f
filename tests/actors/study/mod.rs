//! The node `study`: here a client, an arm with its own settings and the pool of the tests.
//!
//! Most tests ask the node as another node does. Tests of how fields are read and how an answer is written send a
//! client's calls.

mod arm;
mod predictions;
mod rollouts;
mod turns;

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::time::Duration;

use crate::askers::{PATIENCE, PoolBench, ask_as};
use crate::stage::ms;
use crate::system::in_virtual_time;
use crate::virtual_time::{Client, Gateway, WIDE, stand_in};
use actix::prelude::*;
use pendularm::actors::arm::sim::{
    ArmSettings, AttachNodes, HeldLimit, Present, Reset, SetGains, SetIntegrator, SetParams,
};
use pendularm::actors::compute::study::{
    Changed, IntegrationStep, PredictStability, RunOffline, Study,
};
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::gateway::registry::Nodes;
use pendularm::actors::resources::work_clock;
use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::{ControlPeriod, Simulation};
use pendularm::protocol::catalog::{Service, Topic};
use pendularm::study::clocks::{ClockLimits, clock_limits};
use pendularm::study::control_loop::{ControlLoop, no_control};
use pendularm::study::gains::{GainsRequirements, search_gains};
use pendularm::study::motion::Motion;
use pendularm::study::paused::at_once;
use pendularm::study::planner::{Task, plan};
use pendularm::study::stability::{Limits, limits};
use serde_json::{Value, json};
use tokio::sync::mpsc;
use tokio::time::{sleep, timeout};

fn settings<const N: usize>() -> Present<N> {
    Present {
        control: ControlLoop {
            arm: Arm::new([0.8; N], [1.5; N], 3.7).unwrap(),
            gains: Gains {
                kp: [300.0; N],
                ki: [50.0; N],
                kd: [20.0; N],
            },
            setpoint: Setpoint::at([0.4; N]),
            method: Method::Midpoint,
            timestep: 0.002,
            period: ControlPeriod {
                period: 0.0,
                delay: 1,
            },
            ..ControlLoop::free(Arm::default())
        },
        state: State {
            position: [0.3; N],
            velocity: [-0.2; N],
        },
    }
}

/// The same, as a client writes it.
fn settings_as_args<const N: usize>() -> Value {
    json!({
        "integrator": "midpoint",
        "gains": {"kp": vec![300.0; N], "ki": vec![50.0; N], "kd": vec![20.0; N]},
        "params": {"gravity": 3.7, "masses": vec![1.5; N], "lengths": vec![0.8; N]}, "setpoint": vec![0.4; N],
    })
}

/// An arm with settings of its own, none of them the default.
pub fn settled_arm<const N: usize>() -> Recipient<ArmSettings<N>> {
    stand_in(|_| settings())
}

/// The node on a pool with one worker.
pub fn study<const N: usize>() -> PoolBench<Study<N>> {
    PoolBench::new(|pool| Study::new(settled_arm(), pool))
}

/// A client that calls the node.
async fn caller_of<const N: usize>(bench: &PoolBench<Study<N>>) -> Client {
    let mut nodes = Nodes::default();
    Study::attach(&bench.node, &mut nodes);
    Gateway::with(nodes).await.connect(WIDE)
}

fn gravity(gravity: f64) -> SetParams<2> {
    SetParams {
        gravity: Some(gravity),
        ..SetParams::default()
    }
}

//! The questions to the arm: `/arm_sim/*` and `/pid_controller/*`, setpoints and efforts. A file has a question as a
//! whole: the message, its answer, its handler, and how both are read and written in JSON.
//!
//! A request carries what was given and valid, field by field, and what was rejected, by name. What is valid takes
//! effect, and the answer echoes the values as they now are.
//!
//! **Invariant:** a request that changes nothing leaves the arm exactly as it was; a bad field never keeps a good one
//! from the arm, which hears of both.

pub(super) mod command;
pub(super) mod disturb;
pub(super) mod field_by_field;
pub(super) mod gains;
pub(super) mod integrator;
pub(super) mod params;
pub(super) mod period;
pub(super) mod reset;
pub(super) mod setpoint;
pub(super) mod state;
pub(super) mod step;
pub(super) mod switches;

use actix::prelude::*;

use super::node::ArmSim;
use crate::actors::wire::Nodes;
use crate::protocol::catalog::{Direction, Node, Topic};

impl<const N: usize> ArmSim<N> {
    /// Enters this node's services and topics into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        command::attach(address, nodes);
        disturb::attach(address, nodes);
        gains::attach(address, nodes);
        integrator::attach(address, nodes);
        params::attach(address, nodes);
        period::attach(address, nodes);
        reset::attach(address, nodes);
        setpoint::attach(address, nodes);
        state::attach(address, nodes);
        step::attach(address, nodes);
        switches::attach(address, nodes);
        for topic in Topic::ALL {
            let published = topic.direction() == Direction::Published;
            if published && topic.owner() == Node::ArmSim {
                let arm = address.clone().recipient();
                nodes.publishers.insert(topic, arm);
            }
        }
    }
}

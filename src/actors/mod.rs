//! The nodes: one actix actor each, joined by typed messages. They read with `protocol`, ask `math`, answer with
//! `protocol`, and decide only *who hears what*.
//!
//! ```text
//!              accepts                 Request, Disconnect              ServiceCall, TopicMessage, Interest
//!  listener ───────────▶ connection ───────────────────────▶ registry ──────────────────────────────────────▶ nodes
//!                        (one per client)                     (one)                                       arm_sim (own thread)
//!                            ▲     Deliver, Answer, Finish      │ ▲         Publish, Respond             integration, study (worker pool)
//!                            └──────────────────────────────────┘ └─────────────────────────────────────── ik, ik_action, ik_trial, rosapi
//! ```
//!
//! | message | from | to | meaning |
//! | --- | --- | --- | --- |
//! | [`registry::Connect`] / [`registry::Disconnect`] | connection | registry | a client is there, is gone |
//! | [`registry::Retire`] | connection | registry | the client has stopped sending: its registrations go, its answers still come |
//! | [`registry::Request`] | connection | registry | one rosbridge op of that client |
//! | [`registry::Relay`] | connection | registry | messages of that client that need no reading |
//! | [`node::ServiceCall`] | registry | the node that serves it | answered exactly once, through its [`node::Reply`] |
//! | [`node::TopicMessage`] | registry | the node that subscribes | a message on a topic the runtime listens to |
//! | [`follower::ActionRequest`] | registry | `ik_action` | a goal of the action, or its end; the client follows by its [`follower::Follower`] |
//! | [`registry::Progress`] | `ik_action` | registry | feedback of a goal, for the client that sent it |
//! | [`node::Interest`] | registry | the node that publishes | whether anybody subscribes: no encoding without |
//! | [`registry::Publish`] / [`registry::Respond`] | nodes | registry | a topic message; an answer |
//! | [`arm_sim::ArmPose`] | ik, `ik_trial` | `arm_sim` | lengths, positions and time, asked for every time |
//! | [`arm_sim::ArmSettings`] | study | `arm_sim` | method, timestep, arm, gains and setpoint, asked for at every call |
//! | [`arm_sim::HeldLimit`] | `arm_sim` | study | the largest stable timestep of a control loop |
//! | [`arm_sim::Consult`] | runtime | `arm_sim` | whom to ask for it |
//! | [`ik::Solve`] | `ik_action` | ik | joint positions for a target |
//! | [`arm_sim::TrackGoal`] / [`arm_sim::EndGoal`] | `ik_action` | `arm_sim` | a goal to be judged at every step; its end |
//! | [`arm_sim::GoalJudged`] | `arm_sim` | `ik_action` | progress of a goal, or how it ended |
//! | [`ik_action::SendGoal`] / [`ik_action::CancelGoal`] | `ik_trial` | `ik_action` | what clients ask by services |
//! | [`ik_action::GoalNews`] | `ik_action` | `ik_trial` | what clients hear by topics |
//! | [`registry::TakeCensus`] | rosapi | registry | which topics and services clients have |
//! | [`arm_sim::SimulationTime`] | rosapi, rosout | `arm_sim` | the time |
//! | [`connection::Deliver`] / [`connection::Answer`] / [`connection::Finish`] | registry | connection | bytes to send; the end |
//!
//! **Invariant:** everything that a node says to a client passes through the registry's one mailbox, so that a client
//! sees a node's answers and messages in the order in which the node produced them.

pub mod arm_sim;
pub mod awake;
pub mod budget;
pub mod connection;
pub mod files;
pub mod follower;
pub mod gauges;
pub mod ik;
pub mod ik_action;
pub mod ik_trial;
pub mod integration;
pub mod listener;
pub mod node;
pub mod panics;
pub mod registry;
pub mod rosapi;
pub mod rosout;
pub mod runtime;
pub mod study;
pub mod workers;

/// Names one client connection for as long as the process lives; never reused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ConnectionId(pub u64);

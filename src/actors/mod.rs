//! The nodes: one actix actor each, joined by typed messages. They ask `math`, and decide only *who hears what*; what clients
//! write is read, and what they read written, beside them.
//!
//! ```text
//!              accepts                 Request, Disconnect                  Call of a question, SetSetpoint, Interest
//!  listener ───────────▶ connection ───────────────────────▶ registry ─ wire ─────────────────────────────────────▶ nodes
//!                        (one per client)                     (one)                                       arm_sim (own thread)
//!                            ▲     Deliver, Response, Finish    │ ▲         Publish, Respond             integration, study (worker pool)
//!                            └──────────────────────────────────┘ └─────────────────────────────────────── ik, ik_action, ik_trial, rosapi
//! ```
//!
//! A service is a question, [`node::Ask`]. Its [`node::Call`] comes from a client, read by the `wire` beside the node, or from
//! another node; the [`node::Reply`] knows the way back.
//!
//! | message | from | to | meaning |
//! | --- | --- | --- | --- |
//! | [`Connect`](gateway::messages::Connect) / [`Disconnect`](gateway::messages::Disconnect) | connection | registry | a client is there, is gone |
//! | [`Ended`](gateway::messages::Ended) | connection | registry | the client's stream has ended: it only waits now, and may give way to one that comes |
//! | [`Retire`](gateway::messages::Retire) | connection | registry | the client has stopped sending: its registrations go, its answers still come |
//! | [`Request`](gateway::messages::Request) | connection | registry | one rosbridge op of that client |
//! | [`node::Call`] of [`SetIntegrator`](arm::sim::SetIntegrator), [`SetParams`](arm::sim::SetParams), [`SetGains`](arm::sim::SetGains), [`Pause`](arm::sim::Pause), [`Enable`](arm::sim::Enable), [`Reset`](arm::sim::Reset), [`Step`](arm::sim::Step), [`Disturb`](arm::sim::Disturb) | registry, rosapi | `arm_sim` | changes the arm; the answer echoes the values as they are |
//! | [`arm::sim::SetSetpoint`] | registry | `arm_sim` | a client's setpoint |
//! | [`node::Call`] of [`Solve`](arm::ik::Solve) | registry, `ik_action` | ik | joint positions for a target |
//! | [`node::Call`] of [`SendGoal`](arm::ik_action::SendGoal), [`CancelGoal`](arm::ik_action::CancelGoal) | registry, `ik_trial` | `ik_action` | a goal, by service, action or trial, and its end |
//! | [`ik_action::CancelFollowed`](arm::ik_action::CancelFollowed) | registry | `ik_action` | the end of a goal of the action |
//! | [`node::Call`] of [`StartTrial`](arm::ik_trial::StartTrial), [`SkipTarget`](arm::ik_trial::SkipTarget), [`StopTrial`](arm::ik_trial::StopTrial) | registry | `ik_trial` | timed trials |
//! | [`node::Call`] of [`IntegrationStep`](compute::integration::IntegrationStep), [`PredictStability`](compute::study::PredictStability), [`RunOffline`](compute::study::RunOffline), [`SuggestGains`](compute::study::SuggestGains), [`PlanRun`](compute::study::PlanRun) | registry | integration, study | computations, done by the workers |
//! | [`node::Call`] of [`Look`](ros::rosapi::Look), [`GetParam`](ros::rosapi::GetParam), [`SetParam`](ros::rosapi::SetParam), ... | registry | rosapi | what there is |
//! | [`GetParameters`](ros::parameters::GetParameters), ... | registry | parameters | the same as ROS 2 has it |
//! | [`FollowPath`](arm::follow::FollowPath), its [end](arm::follow::StopFollowing) | registry | follow | a path |
//! | [`ArmMotion`](arm::sim::ArmMotion), [`MoveSetpoint`](arm::sim::MoveSetpoint) | follow | `arm_sim` | along it |
//! | [`WishFrames`](ros::tf_web::WishFrames), its [end](ros::tf_web::ForgetFrames) | registry | `tf_web` | frames |
//! | [`node::Feedback`] | `ik_action`, follow, `tf_web` | registry | feedback of a goal, for the client that sent it |
//! | [`node::Interest`] | registry | the node that publishes | whether anybody subscribes: nothing is made without |
//! | [`node::Publish`] / [`node::Respond`] | nodes | registry | a topic message; an answer. What the arm says is written by the registry |
//! | [`arm_sim::ArmPose`](arm::sim::ArmPose) | ik, `ik_trial` | `arm_sim` | lengths, positions and time, asked for every time |
//! | [`arm_sim::ArmSettings`](arm::sim::ArmSettings) | study | `arm_sim` | method, timestep, arm, gains and setpoint, asked for at every call |
//! | [`arm_sim::HeldLimit`](arm::sim::HeldLimit) | `arm_sim` | study | the largest stable timestep of a control loop |
//! | [`arm_sim::Consult`](arm::sim::Consult) | runtime | `arm_sim` | whom to ask for it |
//! | [`arm_sim::RefuseSteps`](arm::sim::RefuseSteps) | runtime | `arm_sim` | the end: steps that are still to be taken are refused |
//! | [`arm_sim::TrackGoal`](arm::sim::TrackGoal) / [`arm_sim::CommandGoal`](arm::sim::CommandGoal) / [`arm_sim::EndGoal`](arm::sim::EndGoal) | `ik_action` | `arm_sim` | a goal; its setpoint, from which on it is judged at every step; its end |
//! | [`arm_sim::GoalJudged`](arm::sim::GoalJudged) | `arm_sim` | `ik_action` | how a goal goes, or how it ended |
//! | [`ik_action::GoalNews`](arm::ik_action::GoalNews) | `ik_action` | `ik_trial` | the same, for the node that sent it |
//! | [`TakeCensus`](gateway::messages::TakeCensus) | rosapi | registry | which topics and services clients have |
//! | [`arm_sim::SimulationTime`](arm::sim::SimulationTime) | rosapi, rosout | `arm_sim` | the time |
//! | [`Deliver`](gateway::messages::Deliver) / [`Response`](gateway::messages::Response) / [`Finish`](gateway::messages::Finish) | registry | connection | bytes to send; the end |
//!
//! **Invariant:** everything that a node says to a client passes through the registry's one mailbox, so that a client
//! sees a node's answers and messages in the order in which the node produced them.

pub mod arm;
pub mod compute;
pub mod gateway;
pub mod node;
pub mod panics;
pub mod ros;
pub mod runtime;
pub mod signals;
pub mod wire;

/// Names one client connection for as long as the process lives; never reused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ConnectionId(pub u64);

//! The nodes: one actix actor each, joined by typed messages. They ask `math`, and decide only *who hears what*.
//! Operations of clients are read, and answers written, beside them.
//!
//! ```text
//!              accepts                 Request, Disconnect              Call of a question, SetSetpoint, Interest
//!  listener ───────────▶ connection ──────────────────▶ registry ─ wire ────────────────────────────────▶ nodes
//!                            ▲   Deliver, Response, Finish  │ ▲            Publish, Respond
//!                            └──────────────────────────────┘ └──────────────────────────────────────── nodes
//! ```
//!
//! There is a connection for each client, and one of everything else. The nodes are `arm_sim` on a thread of its own,
//! `ik`, `ik_action`, `ik_trial`, `follow`, `rosapi`, `parameters`, `rosout`, `tf_web` and `recorder`. The pool of
//! workers does the work of `integration` and `study`.
//!
//! A service is a question, [`node::Ask`]. Its [`node::Call`] comes from a client, read as the question's file says,
//! or from another node; the [`node::Reply`] knows the way back.
//!
//! To the registry, from a connection:
//!
//! - [`Connect`], [`Disconnect`]: a client is there, is gone.
//! - [`CountRefusal`]: no place was free for a client.
//! - [`Retire`]: the client has stopped sending: its registrations go, its answers still come.
//! - [`Request`]: one rosbridge op of that client.
//!
//! To the registry, from nodes:
//!
//! - [`node::Publish`], [`node::Respond`]: a topic message; an answer. The registry writes both as JSON.
//! - [`node::Feedback`], from `ik_action`, `follow` and `tf_web`: feedback of a goal, for the client that sent it.
//! - [`SetTap`], from `recorder`: who hears all that passes, while it is recorded.
//! - [`TakeCensus`], from `rosapi`: which topics and services clients have.
//!
//! To the registry, from the runtime: [`Attach`], which node serves what; [`RefuseCalls`], [`FinishAll`], the end of
//! calls and of connections.
//!
//! To a connection, from the registry: [`Deliver`], [`Response`], [`Finish`], bytes to send and the end; [`Configure`],
//! how a topic is throttled for it.
//!
//! To whoever publishes a topic, from the registry: [`node::Interest`], whether anybody subscribes. Nothing is made
//! without.
//!
//! To `arm_sim`:
//!
//! - [`node::Call`] of [`SetIntegrator`], [`SetParams`], [`SetGains`], [`Pause`], [`Enable`], [`Reset`], [`Step`],
//!   [`Disturb`], from the registry, `rosapi` and `parameters`: changes the arm; the answer echoes the values as they
//!   are.
//! - [`SetSetpoint`], [`CommandEffort`], from the registry: a client's setpoint, and its effort.
//! - [`ArmPose`], from `ik`, `ik_trial` and `tf_web`: lengths, positions and time, asked for every time.
//! - [`ArmSettings`], from `study`: method, timestep, arm, gains and setpoint, asked for at every call.
//! - [`TrackGoal`], [`CommandGoal`], [`EndGoal`], from `ik_action`: a goal; its setpoint, from which on it is judged at
//!   every step; its end.
//! - [`SimulationTime`], from `rosapi` and `rosout`: the time.
//! - [`Tell`], from `recorder`: who hears of everything that the steps depend on, while it is recorded.
//! - [`Consult`], from the runtime: whom to ask for the largest stable timestep.
//! - [`ArmMotion`], [`MoveSetpoint`], from `follow`: how it moves; its setpoint moved on along a path.
//! - [`TakeSnapshot`], from tests: the whole simulation as it is.
//! - [`AddBarrier`], from `ik_action` and `follow` when they start: each is sent a [`Barrier`] before the arm says that
//!   it stands still.
//!
//! To `arm_sim`, `ik_action`, `follow` and `tf_web`, from the runtime: [`node::ShutDown`], the end, at which steps that
//! are still to be taken are refused and goals are aborted.
//!
//! To `follow`: [`FollowPath`], [`StopFollowing`], from the registry: a path, and its end.
//!
//! To `parameters`: [`node::Call`] of [`GetParameters`] and its like, from the registry: the arm's, as ROS 2 has them.
//!
//! To `tf_web`: [`WishFrames`], [`ForgetFrames`], from the registry: frames for a web viewer, and their end.
//!
//! To `ik`: [`node::Call`] of [`Solve`], from the registry and `ik_action`: joint positions for a target.
//!
//! To `ik_action`:
//!
//! - [`node::Call`] of [`SendGoal`], [`CancelGoal`], from the registry and `ik_trial`: a goal, by service, action or
//!   trial, and its end, by the goal's id or as the client knows it that has sent it.
//! - [`GoalJudged`], from `arm_sim`: how a goal goes, or how it ended.
//! - [`Barrier`], from `arm_sim` and `ik_trial`: it is answered when all that came before has been dealt with.
//!
//! To `ik_trial`: [`node::Call`] of [`StartTrial`], [`SkipTarget`], [`StopTrial`], from the registry; [`GoalNews`],
//! from `ik_action`: how a goal goes, or how it ended, for the node that sent it.
//!
//! To `integration` and `study`: [`node::Call`] of [`IntegrationStep`], [`PredictStability`], [`RunOffline`],
//! [`SuggestGains`], [`PlanRun`], from the registry: computations. [`HeldLimit`], from `arm_sim`: the largest stable
//! timestep of a control loop.
//!
//! To `recorder`: [`node::Call`] of `StartRecording` and `StopRecording`, from the registry; `RecordTo` and
//! `EndRecord`, from the runtime: the beginning and the end of a record.
//!
//! To `rosapi`: [`node::Call`] of [`Look`], [`GetParam`], [`SetParam`] and so on, from the registry: the questions
//! of introspection.
//!
//! [`ArmMotion`]: arm::sim::ArmMotion
//! [`MoveSetpoint`]: arm::sim::MoveSetpoint
//! [`FollowPath`]: arm::follow::FollowPath
//! [`StopFollowing`]: arm::follow::StopFollowing
//! [`GetParameters`]: ros::parameters::GetParameters
//! [`WishFrames`]: ros::tf_web::WishFrames
//! [`ForgetFrames`]: ros::tf_web::ForgetFrames
//! [`Connect`]: gateway::messages::Connect
//! [`CountRefusal`]: gateway::messages::CountRefusal
//! [`Disconnect`]: gateway::messages::Disconnect
//! [`Retire`]: gateway::messages::Retire
//! [`Request`]: gateway::messages::Request
//! [`SetTap`]: gateway::messages::SetTap
//! [`TakeCensus`]: gateway::messages::TakeCensus
//! [`Attach`]: gateway::registry::Attach
//! [`RefuseCalls`]: gateway::messages::RefuseCalls
//! [`FinishAll`]: gateway::messages::FinishAll
//! [`Deliver`]: gateway::messages::Deliver
//! [`Response`]: gateway::messages::Response
//! [`Configure`]: gateway::messages::Configure
//! [`Finish`]: gateway::messages::Finish
//! [`SetIntegrator`]: arm::sim::SetIntegrator
//! [`SetParams`]: arm::sim::SetParams
//! [`SetGains`]: arm::sim::SetGains
//! [`Pause`]: arm::sim::Pause
//! [`Enable`]: arm::sim::Enable
//! [`Reset`]: arm::sim::Reset
//! [`Step`]: arm::sim::Step
//! [`Disturb`]: arm::sim::Disturb
//! [`CommandEffort`]: arm::sim::CommandEffort
//! [`SetSetpoint`]: arm::sim::SetSetpoint
//! [`ArmPose`]: arm::sim::ArmPose
//! [`ArmSettings`]: arm::sim::ArmSettings
//! [`TakeSnapshot`]: arm::sim::TakeSnapshot
//! [`TrackGoal`]: arm::sim::TrackGoal
//! [`CommandGoal`]: arm::sim::CommandGoal
//! [`EndGoal`]: arm::sim::EndGoal
//! [`SimulationTime`]: arm::sim::SimulationTime
//! [`Tell`]: arm::sim::Tell
//! [`Consult`]: arm::sim::Consult
//! [`GoalJudged`]: arm::sim::GoalJudged
//! [`Barrier`]: arm::sim::Barrier
//! [`AddBarrier`]: arm::sim::AddBarrier
//! [`HeldLimit`]: arm::sim::HeldLimit
//! [`Solve`]: arm::ik::Solve
//! [`SendGoal`]: arm::ik_action::SendGoal
//! [`CancelGoal`]: arm::ik_action::CancelGoal
//! [`GoalNews`]: arm::ik_action::GoalNews
//! [`StartTrial`]: arm::ik_trial::StartTrial
//! [`SkipTarget`]: arm::ik_trial::SkipTarget
//! [`StopTrial`]: arm::ik_trial::StopTrial
//! [`IntegrationStep`]: compute::integration::IntegrationStep
//! [`PredictStability`]: compute::study::PredictStability
//! [`RunOffline`]: compute::study::RunOffline
//! [`SuggestGains`]: compute::study::SuggestGains
//! [`PlanRun`]: compute::study::PlanRun
//! [`Look`]: ros::rosapi::Look
//! [`GetParam`]: ros::rosapi::GetParam
//! [`SetParam`]: ros::rosapi::SetParam
//!
//! **Invariant:** every message of a node to a client passes through the registry's one mailbox. So a client sees a
//! node's answers and messages in the order in which the node produced them.

pub mod arm;
pub mod compute;
pub mod gateway;
pub mod node;
pub mod panics;
#[cfg(feature = "record")]
pub mod recorder;
pub mod resources;
pub mod ros;
pub mod runtime;
pub mod signals;
pub mod wire;

/// Names one client connection for as long as the process lives; never reused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ConnectionId(pub u64);

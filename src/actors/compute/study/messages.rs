//! The questions to `study`. A value that a question leaves out is as the arm has it.
//!
//! **Invariant:** a question that gets as far as the node has valid fields only.

use std::time::Duration;

use crate::actors::arm::sim::{SetGains, SetParams};
use crate::actors::node::Ask;
use crate::math::arm::ArmError;
use crate::math::integrator::Method;
use crate::study::gains::{GainsError, SuggestedGains};
use crate::study::motion::Motion;
use crate::study::planner::{Candidate, PlanError, Planned};
use crate::study::rollout::{Rollout, RolloutError};
use crate::study::stability::Limits;

/// Predicts the largest stable timesteps of a control loop.
#[derive(Debug, Clone, PartialEq)]
pub struct PredictStability<const N: usize> {
    /// The method that takes the steps.
    pub method: Option<Method>,
    /// Gains that are to be others.
    pub gains: Option<SetGains<N>>,
    /// Parameters of the arm that are to be others.
    pub params: Option<SetParams<N>>,
    /// The setpoint \[rad\], at rest.
    pub setpoint: Option<[f64; N]>,
}

impl<const N: usize> Ask for PredictStability<N> {
    type Answer = Result<Box<Predicted<N>>, ArmError>;
}

/// A prediction.
pub struct Predicted<const N: usize> {
    /// The largest stable timesteps.
    pub limits: Limits<N>,
    /// The motion that is ahead of the arm as it is now, and what timestep it bears.
    pub motion: Motion,
}

/// Runs the arm offline.
#[derive(Debug, Clone, PartialEq)]
pub struct RunOffline<const N: usize> {
    /// Where it starts \[rad\]; 0 if it is not said.
    pub q0: Option<[f64; N]>,
    /// How fast \[rad/s\]; 0 if it is not said.
    pub qdot0: Option<[f64; N]>,
    /// How long \[s\], greater than 0.
    pub duration: Option<f64>,
    /// Length of a step \[s\], greater than 0.
    pub timestep: Option<f64>,
    /// The method that takes the steps.
    pub method: Option<Method>,
    /// Parameters of the arm that are to be others.
    pub params: Option<SetParams<N>>,
    /// The gains; without them nothing controls the arm. A part that is left out is switched off.
    pub gains: Option<SetGains<N>>,
    /// The setpoint \[rad\], at rest.
    pub setpoint: Option<[f64; N]>,
    /// How many samples.
    pub samples: Option<u64>,
    /// Whether to run a reference too.
    pub reference: Option<bool>,
}

impl<const N: usize> Ask for RunOffline<N> {
    type Answer = Result<Box<Ran<N>>, NotRun>;
}

/// A run that has been made.
pub struct Ran<const N: usize> {
    /// The run.
    pub run: Rollout<N>,
    /// The time of a worker that it took, alone.
    pub took: Duration,
}

/// Why nothing was run.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NotRun {
    /// There can't be such an arm.
    #[error("params {0}")]
    Params(#[from] ArmError),
    /// There can't be such a run.
    #[error(transparent)]
    Plan(#[from] RolloutError),
}

/// Looks for gains by which every move settles in time, with a margin of stability.
#[derive(Debug, Clone, PartialEq)]
pub struct SuggestGains<const N: usize> {
    /// Time in which every move is to settle \[s\], greater than 0.
    pub settling_time: Option<f64>,
    /// How many timesteps the smallest stable timestep over all poses is to be, at least 1.
    pub margin: Option<f64>,
    /// Length of a step \[s\], greater than 0.
    pub timestep: Option<f64>,
    /// The method that takes the steps.
    pub method: Option<Method>,
    /// Parameters of the arm that are to be others.
    pub params: Option<SetParams<N>>,
}

impl<const N: usize> Ask for SuggestGains<N> {
    type Answer = Result<Suggested<N>, NotSuggested>;
}

/// Gains that have been tried.
#[derive(Debug, Clone, Copy)]
pub struct Suggested<const N: usize> {
    /// The gains, and how they fared.
    pub found: SuggestedGains<N>,
    /// The timestep that they are for \[s\].
    pub timestep: f64,
}

/// Why no gains are suggested.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NotSuggested {
    /// There can't be such an arm.
    #[error("params {0}")]
    Params(#[from] ArmError),
    /// There are no such gains.
    #[error(transparent)]
    Gains(#[from] GainsError),
}

/// Looks for the cheapest method and timestep that keep a run within an error.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanRun<const N: usize> {
    /// The error of the end effector that may be made \[m\], greater than 0.
    pub error: f64,
    /// How long the run is \[s\], greater than 0.
    pub duration: Option<f64>,
    /// Whether the gains that are set control the arm where the question has none.
    pub servo: bool,
    /// Where it starts \[rad\].
    pub q0: Option<[f64; N]>,
    /// How fast \[rad/s\].
    pub qdot0: Option<[f64; N]>,
    /// Parameters of the arm that are to be others.
    pub params: Option<SetParams<N>>,
    /// Gains that are to be others.
    pub gains: Option<SetGains<N>>,
    /// The setpoint \[rad\], at rest.
    pub setpoint: Option<[f64; N]>,
}

impl<const N: usize> Ask for PlanRun<N> {
    type Answer = Result<PlannedRun, NotPlanned>;
}

/// A plan that has been tried.
#[derive(Debug, Clone)]
pub struct PlannedRun {
    /// The cheapest.
    pub best: Candidate,
    /// All that were tried and good enough.
    pub planned: Planned,
    /// Whether a controller holds the arm: its period is then the timestep.
    pub controlled: bool,
}

/// Why there is no plan.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NotPlanned {
    /// There can't be such an arm.
    #[error("params {0}")]
    Params(#[from] ArmError),
    /// There can't be such a plan.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Nothing was good enough.
    #[error("no plan was found")]
    Nothing,
}

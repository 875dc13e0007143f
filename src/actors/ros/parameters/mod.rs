//! The arm's parameters: `get_param` of rosapi and its like, and `/arm_sim/get_parameters` and its like, which every
//! node of ROS 2 has.
//!
//! All these services are one question, which names parameters to be described, read or changed. They are read and
//! changed by the arm's own questions: the same checks, the same words.
//!
//! **Invariant:** the answer has one entry for each entry of the request, in the same order.

mod wire;

use actix::prelude::*;

use crate::actors::arm::sim::{ArmSim, SetGains, SetIntegrator, SetParams, SetPeriod, joint_names};
use crate::actors::node::{Ask, Call, Unserved, ask};
use crate::protocol::catalog::Node;
use crate::protocol::op::fields::Rejections;
use crate::protocol::ros::parameters::{NO_SUCH, Parameter};
use crate::protocol::ros::urdf;

// ---- messages -------------------------------------------------------------------------------------------------------

/// Asks about parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct AskParameters<const N: usize> {
    /// The parameters that are named, and what each is named for.
    pub entries: Vec<(NamedParameter, ParameterRequest<N>)>,
}

impl<const N: usize> Ask for AskParameters<N> {
    type Answer = Vec<(NamedParameter, ParameterAnswer<N>)>;
}

/// A parameter by its name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedParameter {
    /// The name, as it was given.
    pub name: String,
    /// The parameter; none if there is none of that name.
    pub parameter: Option<Parameter>,
    /// The value, as JSON text, that is wanted where there is none.
    pub default: String,
}

/// What a parameter is named for.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterRequest<const N: usize> {
    /// What there is to know about it without its value.
    Describe,
    /// Its value.
    Read,
    /// A change, or why there can be none.
    Change(Result<ParameterChange<N>, NotSet>),
}

/// A change of one parameter, as a question to the arm.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterChange<const N: usize> {
    /// Gravity, masses or lengths.
    Params(SetParams<N>),
    /// Gains.
    Gains(SetGains<N>),
    /// Method or timestep.
    Integrator(SetIntegrator),
    /// The control period.
    Period(SetPeriod),
}

/// The answer about a parameter.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterAnswer<const N: usize> {
    /// Its name says all that was asked.
    Described,
    /// Its value; none if there is no such parameter.
    Value(Option<ParameterValue<N>>),
    /// Whether it was changed.
    Changed(Result<(), NotSet>),
}

/// The value of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterValue<const N: usize> {
    /// A number.
    Number(f64),
    /// One per joint.
    Numbers([f64; N]),
    /// A name or a description.
    Text(String),
}

/// Why a parameter was not set.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NotSet {
    /// There is none of that name.
    #[error("{NO_SUCH}")]
    Unknown,
    /// It has no value of its own.
    #[error("name: robot_description is made from lengths and masses")]
    Derived,
    /// Its value is of another type.
    #[error("{name} must be a {expected} (type {number}), got type {found}")]
    WrongType {
        /// The parameter's name.
        name: &'static str,
        /// The name of its type.
        expected: &'static str,
        /// The number of its type.
        number: u8,
        /// The number of the type that came.
        found: u8,
    },
    /// The value can't be read.
    #[error("value must be JSON text")]
    NotJson,
    /// The arm does not take it.
    #[error("{0}")]
    Rejected(Rejections),
}

// ---- state ----------------------------------------------------------------------------------------------------------

/// Serves the parameters in the name of the arm.
pub struct Parameters<const N: usize> {
    arm: ArmParameters<N>,
}

/// The arm, as far as its parameters are concerned.
#[derive(Clone)]
struct ArmParameters<const N: usize> {
    /// Gravity, masses and lengths.
    params: Recipient<Call<SetParams<N>>>,
    /// Gains.
    gains: Recipient<Call<SetGains<N>>>,
    /// Method and timestep.
    integrator: Recipient<Call<SetIntegrator>>,
    /// The control period.
    period: Recipient<Call<SetPeriod>>,
}

impl<const N: usize> Parameters<N> {
    /// A node for this arm.
    #[must_use]
    pub fn of(arm: &Addr<ArmSim<N>>) -> Self {
        let arm = ArmParameters {
            params: arm.clone().recipient(),
            gains: arm.clone().recipient(),
            integrator: arm.clone().recipient(),
            period: arm.clone().recipient(),
        };
        Self { arm }
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for Parameters<N> {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<Call<AskParameters<N>>> for Parameters<N> {
    type Result = ();

    fn handle(&mut self, call: Call<AskParameters<N>>, ctx: &mut Context<Self>) {
        let Call { ask, mut reply } = call;
        let answers = self.arm.clone().answer_all(ask).into_actor(self);
        ctx.spawn(answers.map(move |answers, _, _| match answers {
            Ok(answers) => reply.answer(answers),
            Err(_) => reply.refuse(Unserved::NoAnswer(Node::ArmSim.name())),
        }));
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<const N: usize> ArmParameters<N> {
    /// Answers for one parameter after the other.
    async fn answer_all(
        self,
        ask: AskParameters<N>,
    ) -> Result<<AskParameters<N> as Ask>::Answer, Unserved> {
        let mut answers = Vec::with_capacity(ask.entries.len());
        for (named, request) in ask.entries {
            let answer = match (request, named.parameter) {
                (ParameterRequest::Describe, _) => ParameterAnswer::Described,
                (ParameterRequest::Read, None) => ParameterAnswer::Value(None),
                (ParameterRequest::Read, Some(parameter)) => {
                    ParameterAnswer::Value(Some(self.value(parameter).await?))
                }
                (ParameterRequest::Change(Ok(change)), _) => {
                    ParameterAnswer::Changed(match self.change(change).await? {
                        rejected if rejected.is_empty() => Ok(()),
                        rejected => Err(NotSet::Rejected(rejected)),
                    })
                }
                (ParameterRequest::Change(Err(why)), _) => ParameterAnswer::Changed(Err(why)),
            };
            answers.push((named, answer));
        }
        Ok(answers)
    }

    /// The present value of a parameter.
    async fn value(&self, parameter: Parameter) -> Result<ParameterValue<N>, Unserved> {
        use ParameterValue::{Number, Numbers, Text};
        Ok(match parameter {
            Parameter::Gravity
            | Parameter::Masses
            | Parameter::Lengths
            | Parameter::RobotDescription => {
                let arm = ask(&self.params, SetParams::default()).await?.values;
                match parameter {
                    Parameter::Gravity => Number(arm.gravity()),
                    Parameter::Masses => Numbers(*arm.masses()),
                    Parameter::Lengths => Numbers(*arm.lengths()),
                    _ => Text(urdf::describe(
                        &joint_names::<N>(),
                        arm.lengths(),
                        arm.masses(),
                    )),
                }
            }
            Parameter::Kp | Parameter::Ki | Parameter::Kd => {
                let gains = ask(&self.gains, SetGains::default()).await?.values;
                match parameter {
                    Parameter::Kp => Numbers(gains.kp),
                    Parameter::Ki => Numbers(gains.ki),
                    _ => Numbers(gains.kd),
                }
            }
            Parameter::Integrator | Parameter::Timestep => {
                let integrator = ask(&self.integrator, SetIntegrator::default())
                    .await?
                    .values;
                match parameter {
                    Parameter::Integrator => Text(integrator.method.name().to_owned()),
                    _ => Number(integrator.timestep),
                }
            }
            Parameter::ControlPeriod => {
                let sampling = ask(&self.period, SetPeriod::default()).await?.values;
                Number(sampling.period.period)
            }
        })
    }

    /// Has the arm change a parameter. Returns what was not taken.
    async fn change(&self, change: ParameterChange<N>) -> Result<Rejections, Unserved> {
        Ok(match change {
            ParameterChange::Params(params) => ask(&self.params, params).await?.rejected,
            ParameterChange::Gains(gains) => ask(&self.gains, gains).await?.rejected,
            ParameterChange::Integrator(change) => ask(&self.integrator, change).await?.rejected,
            ParameterChange::Period(period) => ask(&self.period, period).await?.rejected,
        })
    }
}

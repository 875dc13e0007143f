//! The arm's parameters: `get_param` of rosapi and similar services, and `/arm_sim/get_parameters` and similar
//! services, which every node of ROS 2 has.
//!
//! All these services are one question, which names parameters. The arm's own services read and change them, so checks
//! and texts are the same.
//!
//! **Invariant:** the answer has one entry for each entry of the request, in the same order.

mod wire;

use actix::prelude::*;

use crate::actors::arm::sim::{
    ArmSim, Echo, SetGains, SetIntegrator, SetParams, SetPeriod, joint_names,
};
use crate::actors::node::{Ask, Call, Unserved, ask};
use crate::protocol::catalog::Node;
use crate::protocol::op::fields::Rejections;
use crate::protocol::ros::parameters::{NO_SUCH, Parameter};
use crate::protocol::ros::urdf;

// ---- messages -------------------------------------------------------------------------------------------------------

/// Asks about parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct AskParameters<const N: usize> {
    /// The named parameters, and the request to the arm about each. A description needs none.
    pub entries: Vec<(NamedParameter, Option<ParameterRequest<N>>)>,
}

impl<const N: usize> Ask for AskParameters<N> {
    /// The values after the requests. There is none for a description, and for a parameter that does not exist.
    type Answer = Vec<(NamedParameter, Result<Option<ParameterValue<N>>, NotSet>)>;
}

/// A parameter by its name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedParameter {
    /// The name as the client spells it.
    pub name: String,
    /// The parameter, if there is one of that name.
    pub parameter: Option<Parameter>,
    /// The value, as JSON text, for a parameter that does not exist.
    pub default: String,
}

/// A request to the arm, or why there is none.
pub type ParameterRequest<const N: usize> = Result<ArmQuestion<N>, NotSet>;

/// A request to the service that has a parameter as a field: to change that field, or none.
#[derive(Debug, Clone, PartialEq)]
pub enum ArmQuestion<const N: usize> {
    /// Gravity, masses and lengths.
    Params(SetParams<N>),
    /// Gains.
    Gains(SetGains<N>),
    /// Method and timestep.
    Integrator(SetIntegrator),
    /// The control period.
    Period(SetPeriod),
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
#[derive(Clone)]
pub struct Parameters<const N: usize> {
    params: Recipient<Call<SetParams<N>>>,
    gains: Recipient<Call<SetGains<N>>>,
    integrator: Recipient<Call<SetIntegrator>>,
    period: Recipient<Call<SetPeriod>>,
}

impl<const N: usize> Parameters<N> {
    /// A node for this arm.
    #[must_use]
    pub fn of(arm: &Addr<ArmSim<N>>) -> Self {
        Self {
            params: arm.clone().recipient(),
            gains: arm.clone().recipient(),
            integrator: arm.clone().recipient(),
            period: arm.clone().recipient(),
        }
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
        let answers = self.clone().answer_all(ask).into_actor(self);
        ctx.spawn(answers.map(move |answers, _, _| match answers {
            Ok(answers) => reply.answer(answers),
            Err(_) => reply.refuse(Unserved::NoAnswer(Node::ArmSim.name())),
        }));
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<const N: usize> Parameters<N> {
    /// Answers for one parameter after the other.
    async fn answer_all(
        self,
        ask: AskParameters<N>,
    ) -> Result<<AskParameters<N> as Ask>::Answer, Unserved> {
        let mut answers = Vec::with_capacity(ask.entries.len());
        for (named, request) in ask.entries {
            let answer = match request {
                None => Ok(None),
                Some(Err(why)) => Err(why),
                Some(Ok(question)) => match self.ask_arm(question).await? {
                    (values, rejected) if rejected.is_empty() => {
                        let mut values = values.into_iter();
                        let own = values.find(|(one, _)| Some(*one) == named.parameter);
                        Ok(own.map(|(_, value)| value))
                    }
                    (_, rejected) => Err(NotSet::Rejected(rejected)),
                },
            };
            answers.push((named, answer));
        }
        Ok(answers)
    }

    /// Sends a request to the arm. Returns all values of that service after it, and the rejected fields.
    async fn ask_arm(
        &self,
        question: ArmQuestion<N>,
    ) -> Result<(Vec<(Parameter, ParameterValue<N>)>, Rejections), Unserved> {
        use ParameterValue::{Number, Numbers, Text};
        Ok(match question {
            ArmQuestion::Params(params) => {
                let Echo { values, rejected } = ask(&self.params, params).await?;
                let (lengths, masses) = (values.lengths(), values.masses());
                let description = urdf::describe(&joint_names::<N>(), lengths, masses);
                let values = vec![
                    (Parameter::Gravity, Number(values.gravity())),
                    (Parameter::Masses, Numbers(*masses)),
                    (Parameter::Lengths, Numbers(*lengths)),
                    (Parameter::RobotDescription, Text(description)),
                ];
                (values, rejected)
            }
            ArmQuestion::Gains(gains) => {
                let Echo { values, rejected } = ask(&self.gains, gains).await?;
                let values = vec![
                    (Parameter::Kp, Numbers(values.kp)),
                    (Parameter::Ki, Numbers(values.ki)),
                    (Parameter::Kd, Numbers(values.kd)),
                ];
                (values, rejected)
            }
            ArmQuestion::Integrator(change) => {
                let Echo { values, rejected } = ask(&self.integrator, change).await?;
                let values = vec![
                    (Parameter::Integrator, Text(values.method.name().to_owned())),
                    (Parameter::Timestep, Number(values.timestep)),
                ];
                (values, rejected)
            }
            ArmQuestion::Period(change) => {
                let Echo { values, rejected } = ask(&self.period, change).await?;
                let period = Number(values.period.period);
                (vec![(Parameter::ControlPeriod, period)], rejected)
            }
        })
    }
}

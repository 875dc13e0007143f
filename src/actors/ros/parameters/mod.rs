//! The arm's parameters in the form of a ROS 2 node: `/arm_sim/get_parameters` and the four other services.
//!
//! They are read and set by the arm's own requests, as in rosapi, with the same checks and the same messages.
//!
//! **Invariant:** the answer has one entry for each entry of the request, in the same order.

mod wire;

use actix::prelude::*;

use super::rosapi::{
    ArmParameters, NotSet, ParamChange, ParameterValue, change_parameter, give, value,
};
use crate::actors::node::{Ask, Call, Unserved};
use crate::protocol::ros::parameters::Parameter;

// ---- messages -------------------------------------------------------------------------------------------------------

/// Lists the parameters. The answer has the selected ones.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ListParameters {
    /// Names, or their prefixes up to a full stop; empty for all.
    pub prefixes: Vec<String>,
}

impl Ask for ListParameters {
    type Answer = Vec<Parameter>;
}

/// The values of parameters.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GetParameters<const N: usize> {
    /// The parameters; `None` for an unknown name.
    pub parameters: Vec<Option<Parameter>>,
}

impl<const N: usize> Ask for GetParameters<N> {
    type Answer = Vec<Option<ParameterValue<N>>>;
}

/// The types of parameters. The answer is the request, because it needs no value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GetParameterTypes {
    /// The parameters; `None` for an unknown name.
    pub parameters: Vec<Option<Parameter>>,
}

impl Ask for GetParameterTypes {
    type Answer = Vec<Option<Parameter>>;
}

/// Descriptions of parameters, answered like their types.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DescribeParameters {
    /// The parameters, each with its name in the request.
    pub parameters: Vec<(String, Option<Parameter>)>,
}

impl Ask for DescribeParameters {
    type Answer = Vec<(String, Option<Parameter>)>;
}

/// Sets parameters, one after the other.
#[derive(Debug, Clone, PartialEq)]
pub struct SetParameters<const N: usize> {
    /// The changes, or why one is not possible.
    pub changes: Vec<Result<ParamChange<N>, NotSet>>,
}

impl<const N: usize> Ask for SetParameters<N> {
    type Answer = Vec<Result<(), NotSet>>;
}

// ---- state ----------------------------------------------------------------------------------------------------------

/// Serves the parameter services of the arm.
pub struct Parameters<const N: usize> {
    arm: ArmParameters<N>,
}

impl<const N: usize> Parameters<N> {
    /// A node for this arm.
    #[must_use]
    pub const fn new(arm: ArmParameters<N>) -> Self {
        Self { arm }
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for Parameters<N> {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<Call<ListParameters>> for Parameters<N> {
    type Result = ();

    fn handle(&mut self, mut call: Call<ListParameters>, _: &mut Context<Self>) {
        let prefixes = call.ask.prefixes;
        let is_meant = |one: &Parameter| {
            // No parameter's name has a full stop, so a prefix can only be the whole name.
            prefixes.is_empty() || prefixes.iter().any(|prefix| prefix == one.name())
        };
        let meant = Parameter::ALL.into_iter().filter(is_meant);
        call.reply.answer(meant.collect());
    }
}

impl<const N: usize> Handler<Call<GetParameters<N>>> for Parameters<N> {
    type Result = ();

    fn handle(&mut self, call: Call<GetParameters<N>>, ctx: &mut Context<Self>) {
        let Call { ask, reply } = call;
        let values = values(ask.parameters, self.arm.clone()).into_actor(self);
        ctx.spawn(values.map(|values, _, _| give(reply, values)));
    }
}

impl<const N: usize> Handler<Call<GetParameterTypes>> for Parameters<N> {
    type Result = ();

    fn handle(&mut self, mut call: Call<GetParameterTypes>, _: &mut Context<Self>) {
        call.reply.answer(call.ask.parameters);
    }
}

impl<const N: usize> Handler<Call<DescribeParameters>> for Parameters<N> {
    type Result = ();

    fn handle(&mut self, mut call: Call<DescribeParameters>, _: &mut Context<Self>) {
        call.reply.answer(call.ask.parameters);
    }
}

impl<const N: usize> Handler<Call<SetParameters<N>>> for Parameters<N> {
    type Result = ();

    fn handle(&mut self, call: Call<SetParameters<N>>, ctx: &mut Context<Self>) {
        let Call { ask, reply } = call;
        let results = set(ask.changes, self.arm.clone()).into_actor(self);
        ctx.spawn(results.map(|results, _, _| give(reply, results)));
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

async fn values<const N: usize>(
    parameters: Vec<Option<Parameter>>,
    arm: ArmParameters<N>,
) -> Result<Vec<Option<ParameterValue<N>>>, Unserved> {
    let mut values = Vec::with_capacity(parameters.len());
    for parameter in parameters {
        values.push(match parameter {
            Some(parameter) => Some(value(parameter, arm.clone()).await?),
            None => None,
        });
    }
    Ok(values)
}

async fn set<const N: usize>(
    changes: Vec<Result<ParamChange<N>, NotSet>>,
    arm: ArmParameters<N>,
) -> Result<Vec<Result<(), NotSet>>, Unserved> {
    let mut results = Vec::with_capacity(changes.len());
    for change in changes {
        results.push(match change {
            Ok(change) => NotSet::unless_empty(change_parameter(change, arm.clone()).await?),
            Err(why) => Err(why),
        });
    }
    Ok(results)
}

//! Reads goals, and the operations of clients that serve a service or an action. A frame with a fault may be an answer
//! too.
//!
//! **Invariant:** an answer has the `id` of its call or goal. A bad answer names its call or goal, if it
//! has an `id` or the name.

use std::borrow::Cow;

use serde_json::value::RawValue;

use super::members::{A_NAME, Members};
use super::types::{ActionGoal, GoalStatus, ProviderOp, Served};
use super::{Op, OpError, Problem};
use crate::protocol::wire::json::{self, Payload};

pub(super) fn goal(members: &Members<'_>) -> Result<ActionGoal, Problem> {
    members.short("id", members.get("id").map_or("", RawValue::get))?;
    Ok(ActionGoal {
        type_name: members.optional_text("action_type")?,
        args: members.args(),
        feedback: match members.get("feedback") {
            Some(_) => members.boolean("feedback")?,
            None => false,
        },
        action: members.name("action")?,
    })
}

/// The kind of the call or goal that the frame answers, if it is an answer.
fn answered(members: &Members<'_>) -> Option<Served> {
    match members.op {
        "service_response" => Some(Served::Service),
        "action_result" => Some(Served::Action),
        _ => None,
    }
}

/// An operation of a client that serves.
pub(super) fn serve(members: &Members<'_>, kind: Served) -> Result<Op, Problem> {
    if answered(members).is_some() || members.op == "action_feedback" {
        members.required("id")?;
    }
    let name = members.name(kind.noun())?;
    let op = match members.op {
        "advertise_service" | "advertise_action" => ProviderOp::Advertise {
            type_name: members.optional_text("type")?,
        },
        "unadvertise_service" | "unadvertise_action" => ProviderOp::Unadvertise,
        "service_response" => {
            let result = members.boolean("result")?;
            ProviderOp::Respond {
                // The values of a failure may be a text with the reason.
                values: match members.given("values") {
                    Some(_) if result => members.object("values")?,
                    Some(reason) => reason.into(),
                    None => Payload::empty_object(),
                },
                result,
                status: members
                    .optional("status", "a string", json::text)?
                    .map(Cow::into_owned),
            }
        }
        "action_feedback" => ProviderOp::Feedback {
            values: members.object("values")?,
        },
        _ => {
            let is_good = members.boolean("result")?;
            ProviderOp::End {
                // Here they may be missing: a result without fields, or a failure without a reason.
                values: match members.get("values") {
                    Some(_) if is_good => members.object("values")?,
                    None if is_good => Payload::empty_object(),
                    values => Payload::from(values.unwrap_or(RawValue::NULL)),
                },
                status: goal_status(members, is_good)?,
                result: is_good,
            }
        }
    };
    Ok(Op::Serve { kind, name, op })
}

fn goal_status(members: &Members<'_>, is_good: bool) -> Result<u8, Problem> {
    let status = members.optional("status", "an integer from 0 to 6", |raw| {
        let status = u8::try_from(json::integer(raw)?).ok();
        status.filter(|status| *status <= GoalStatus::Aborted as u8)
    })?;
    let usual = if is_good {
        GoalStatus::Succeeded
    } else {
        GoalStatus::Aborted
    };
    Ok(status.unwrap_or(usual as u8))
}

/// Converts a fault in the answer to a call or goal to an op that ends this call or goal.
pub(super) fn or_bad_answer(
    members: &Members<'_>,
    read: Result<Op, Problem>,
) -> Result<Op, OpError> {
    let Some(kind) = answered(members) else {
        return read.map_err(OpError::Status);
    };
    Ok(read.unwrap_or_else(|problem| Op::BadAnswer {
        kind,
        name: members.name(kind.noun()).ok(),
        problem,
    }))
}

/// A fault of a call or a goal. The answer needs the name of the service or action, even an empty or too long one.
/// If the name is not a text, this is reported instead.
pub(super) fn fault(members: &Members<'_>, kind: Served, problem: Problem) -> OpError {
    let name = match members.typed(kind.noun(), A_NAME, json::text) {
        Ok(name) => name.into_owned(),
        Err(no_text) => return OpError::Status(no_text),
    };
    match kind {
        Served::Service => OpError::Call {
            service: name,
            problem,
        },
        Served::Action => OpError::Goal {
            action: name,
            problem,
        },
    }
}

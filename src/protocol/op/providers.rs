//! Reads goals, and the operations of clients that serve a service or an action.
//!
//! **Invariant:** an answer has the `id` of its call or goal. A bad answer names its call or goal, if it
//! has an `id` or the name.

use std::borrow::Cow;

use serde_json::value::RawValue;

use super::types::{ActionGoal, GoalStatus, ProviderOp, Served};
use super::{Members, OpError, Problem};
use crate::protocol::wire::json::{self, Payload};

impl Members<'_> {
    /// A goal. If its action is a text, every fault gets an `action_result`.
    pub(super) fn goal(&self) -> Result<ActionGoal, OpError> {
        self.valid_goal().map_err(|problem| {
            let answer = |action, problem| OpError::Goal { action, problem };
            self.fault("action", problem, answer)
        })
    }

    fn valid_goal(&self) -> Result<ActionGoal, Problem> {
        if let Some(id) = self.get("id") {
            self.short("id", id.get())?;
        }
        Ok(ActionGoal {
            type_name: self.optional_text("action_type")?,
            args: self.args(),
            feedback: match self.get("feedback") {
                Some(_) => self.boolean("feedback")?,
                None => false,
            },
            action: self.name("action")?,
        })
    }

    /// The kind of the call or goal that the frame answers, if it is an answer.
    pub(super) fn answered(&self) -> Option<Served> {
        match self.op {
            "service_response" => Some(Served::Service),
            "action_result" => Some(Served::Action),
            _ => None,
        }
    }

    /// The name that the sender serves, and the operation.
    pub(super) fn provider_op(&self, kind: Served) -> Result<(String, ProviderOp), Problem> {
        if self.answered().is_some() || self.op == "action_feedback" {
            self.required("id")?;
        }
        let name = self.name(kind.noun())?;
        let op = match self.op {
            "advertise_service" | "advertise_action" => ProviderOp::Advertise {
                type_name: self.optional_text("type")?,
            },
            "unadvertise_service" | "unadvertise_action" => ProviderOp::Unadvertise,
            "service_response" => {
                let result = self.boolean("result")?;
                ProviderOp::Respond {
                    // The values of a failure may be a text with the reason.
                    values: match result {
                        true => self.object("values")?,
                        false => self.required("values")?.into(),
                    },
                    result,
                    status: self
                        .optional("status", "a string", json::text)?
                        .map(Cow::into_owned),
                }
            }
            "action_feedback" => ProviderOp::Feedback {
                values: self.object("values")?,
            },
            _ => {
                let is_good = self.boolean("result")?;
                ProviderOp::End {
                    // Here they may be missing: a result without fields, or a failure without a reason.
                    values: match self.get("values") {
                        Some(_) if is_good => self.object("values")?,
                        None if is_good => Payload::empty_object(),
                        values => Payload::from(values.unwrap_or(RawValue::NULL)),
                    },
                    status: self.goal_status(is_good)?,
                    result: is_good,
                }
            }
        };
        Ok((name, op))
    }

    fn goal_status(&self, is_good: bool) -> Result<u8, Problem> {
        let status = self.optional("status", "an integer from 0 to 6", |raw| {
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
}

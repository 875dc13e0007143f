//! Reads goals, and the operations of clients that serve a service or an action. Also reads frames with a fault,
//! because such a frame may be an answer.
//!
//! **Invariant:** an answer has the `id` of its call or goal. A bad answer names its call or goal, if it
//! has an `id` or the name.

use std::borrow::Cow;

use serde_json::value::RawValue;

use super::types::{ActionGoal, GoalStatus, ProviderOp, Served};
use super::{A_NAME, Incoming, Members, Op, OpError, Problem};
use crate::protocol::wire::json::{self, Payload};

impl Incoming {
    /// Reads the start of a frame that is refused for the reason `why`. It may be the answer to a call, which then
    /// fails.
    #[must_use]
    pub fn of_start(start: &[u8], why: &impl ToString) -> Self {
        let text = start.utf8_chunks().next();
        // The members before its end or its fault count.
        let (members, _) = Members::of(text.map_or("", |one| one.valid()));
        members.refused(Problem::NotAFrame(why.to_string()))
    }
}

impl Members<'_> {
    pub(super) fn goal(&self) -> Result<ActionGoal, Problem> {
        self.short("id", self.get("id").map_or("", RawValue::get))?;
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
    fn answered(&self) -> Option<Served> {
        match self.op {
            "service_response" => Some(Served::Service),
            "action_result" => Some(Served::Action),
            _ => None,
        }
    }

    /// An operation of a client that serves.
    pub(super) fn serve(&self, kind: Served) -> Result<Op, Problem> {
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
                    values: match self.given("values") {
                        Some(_) if result => self.object("values")?,
                        Some(reason) => reason.into(),
                        None => Payload::empty_object(),
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
        Ok(Op::Serve { kind, name, op })
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

    /// A frame that cannot be read to its end. Members before the fault count only for an answer.
    pub(super) fn refused(mut self, problem: Problem) -> Incoming {
        self.op = self.known_op().unwrap_or_default();
        let op = self.or_bad_answer(Err(problem));
        let id = self.get("id").filter(|_| op.is_ok()).map(Payload::from);
        Incoming { id, op }
    }

    /// Converts a fault in the answer to a call or goal to an op that ends this call or goal.
    pub(super) fn or_bad_answer(&self, read: Result<Op, Problem>) -> Result<Op, OpError> {
        let Some(kind) = self.answered() else {
            return read.map_err(OpError::Status);
        };
        Ok(read.unwrap_or_else(|problem| Op::BadAnswer {
            kind,
            name: self.name(kind.noun()).ok(),
            problem,
        }))
    }

    /// A fault of a call or a goal. The answer needs the name of the service or action, even an empty or too long one.
    /// If the name is not a text, this is reported instead.
    pub(super) fn fault(&self, kind: Served, problem: Problem) -> OpError {
        let name = match self.typed(kind.noun(), A_NAME, json::text) {
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
}

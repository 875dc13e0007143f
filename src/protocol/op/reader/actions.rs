//! The operations of actions: goals and cancellations from those who send them, the rest from action servers.
//!
//! **Invariant:** an end has a status of `action_msgs/msg/GoalStatus`, also where its sender leaves that out.

use serde_json::value::RawValue;

use super::OpReader;
use crate::protocol::catalog::Action;
use crate::protocol::op::{ActionGoal, ActionServerOp, GoalStatus, Op, OpError, Problem};
use crate::protocol::wire::json;
use crate::protocol::wire::payload::Payload;

impl OpReader<'_> {
    /// A goal. As soon as its action is known it can be answered as a goal, whatever else is wrong.
    pub(super) fn goal(&self) -> Result<Op, OpError> {
        let action = self.name("action").map_err(OpError::Status)?;
        match self.goal_for(&action) {
            Ok(goal) => Ok(Op::SendActionGoal(goal)),
            Err(problem) => Err(OpError::Goal { action, problem }),
        }
    }

    fn goal_for(&self, action: &str) -> Result<ActionGoal, Problem> {
        if let Some(id) = self.get("id") {
            self.short("id", id.get())?;
        }
        let fields = Action::from_name(action)
            .filter(|action| !action.takes_long_goals())
            .map(Action::goal_fields);
        Ok(ActionGoal {
            type_name: self.optional_text("action_type")?,
            args: self.args(fields)?,
            feedback: match self.get("feedback") {
                Some(_) => self.boolean("feedback")?,
                None => false,
            },
            action: action.to_owned(),
        })
    }

    /// An operation of an action server.
    pub(super) fn serve_action(&self) -> Result<Op, Problem> {
        let action = self.name("action")?;
        let op = match self.op {
            "advertise_action" => ActionServerOp::Advertise {
                type_name: self.optional_text("type")?,
            },
            "unadvertise_action" => ActionServerOp::Unadvertise,
            "action_feedback" => {
                self.required("id")?;
                let values = self.object("values")?;
                ActionServerOp::Feedback { values }
            }
            _ => {
                self.required("id")?;
                let is_good = self.boolean("result")?;
                let values = self.get("values").filter(|raw| raw.get() != "null");
                ActionServerOp::End {
                    // The values of a failure may be a text that says why.
                    values: match values {
                        Some(_) if is_good => self.object("values")?,
                        values => Payload::from(values.unwrap_or(RawValue::NULL)),
                    },
                    status: self.goal_status(is_good)?,
                    result: is_good,
                }
            }
        };
        Ok(Op::ServeAction { action, op })
    }

    fn goal_status(&self, is_good: bool) -> Result<u8, Problem> {
        let Some(raw) = self.get("status") else {
            return Ok(if is_good {
                GoalStatus::Succeeded
            } else {
                GoalStatus::Aborted
            } as u8);
        };
        let status = json::integer(raw).and_then(|status| u8::try_from(status).ok());
        status
            .filter(|status| *status <= GoalStatus::Aborted as u8)
            .ok_or_else(|| self.mistyped("status", "an integer from 0 to 6", raw))
    }
}

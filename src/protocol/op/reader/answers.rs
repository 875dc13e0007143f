//! The answers of providers and action servers, good and bad.
//!
//! **Invariant:** whatever is wrong with an answer, the op says which call or goal it is for, if the frame does before
//! the fault.

use std::borrow::Cow;

use super::{KEYS, OpReader};
use crate::protocol::op::{Incoming, Op, OpError, Problem};
use crate::protocol::wire::json;
use crate::protocol::wire::payload::Payload;

/// Reads the start of a frame that is refused for the reason `why`: it may be the answer to a call, which then fails.
#[must_use]
pub fn read_start(start: &[u8], why: &impl ToString) -> Incoming {
    let text = start.utf8_chunks().next();
    let mut members = [None; KEYS.len()];
    // The members before its end or its fault count.
    let _ = json::members_into(text.map_or("", |one| one.valid()), &KEYS, &mut members);
    OpReader { op: "", members }.refused(Problem::NotAFrame(why.to_string()))
}

impl OpReader<'_> {
    /// A frame that cannot be read to its end. Members before the fault count for an answer only.
    pub(super) fn refused(self, problem: Problem) -> Incoming {
        let op = self.known_op().unwrap_or_default();
        let reader = OpReader { op, ..self };
        let op = reader.or_bad_answer(Err(problem));
        let id = reader.get("id").filter(|_| op.is_ok()).map(Payload::from);
        Incoming { id, op }
    }

    /// Makes an op of a fault in the answer to a call or goal: that call or goal ends.
    pub(super) fn or_bad_answer(&self, read: Result<Op, Problem>) -> Result<Op, OpError> {
        let (of_goal, name) = match self.op {
            "service_response" => (false, "service"),
            "action_result" => (true, "action"),
            _ => return read.map_err(OpError::Status),
        };
        Ok(read.unwrap_or_else(|problem| Op::BadAnswer {
            of_goal,
            name: self.name(name).ok(),
            problem,
        }))
    }

    pub(super) fn response(&self) -> Result<Op, Problem> {
        self.required("id")?;
        let (service, result) = (self.name("service")?, self.boolean("result")?);
        Ok(Op::ServiceResponse {
            service,
            // The values of a failure may be a text that says why.
            values: if result {
                self.object("values")?
            } else {
                self.required("values")?.into()
            },
            result,
            status: self.get("status").and_then(json::text).map(Cow::into_owned),
        })
    }
}

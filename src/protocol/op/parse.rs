//! Reads the operation of a frame. `control.rs` and `providers.rs` have most of the operations.
//!
//! **Invariant:** every frame gives exactly one operation or one error.

use std::time::Duration;

use super::members::Members;
use super::types::duration;
use super::{CallService, Incoming, MAX_TIMEOUT, Op, OpError, Problem, Served, control, providers};
use crate::protocol::wire::frame::RawFrame;
use crate::protocol::wire::json::{self, Payload};

/// Decodes a frame, and reads its op or its error. `None` for a message that has only white space.
#[must_use]
pub fn read_raw(frame: RawFrame) -> Option<Incoming> {
    Some(match frame.decode()? {
        Ok(text) => read(&text),
        Err((error, start)) => read_start(&start, &error),
    })
}

/// Reads a frame. Unknown members are ignored. Of a repeated member the last one counts.
#[must_use]
pub fn read(frame: &str) -> Incoming {
    let (mut members, read) = Members::of(frame);
    if let Err(error) = read {
        return refused(members, Problem::not_json(&error));
    }
    let id = members.get("id").map(Payload::from);
    let op = match members.known_op() {
        Ok(op) => {
            members.op = op;
            operation(&members)
        }
        Err(problem) => Err(OpError::Status(problem)),
    };
    Incoming { id, op }
}

/// Reads the start of a frame that is refused for the reason `why`. It may be the answer to a call, which then
/// fails.
#[must_use]
pub fn read_start(start: &[u8], why: &impl ToString) -> Incoming {
    let text = start.utf8_chunks().next();
    // The members before its end or its fault count.
    let (members, _) = Members::of(text.map_or("", |one| one.valid()));
    refused(members, Problem::NotAFrame(why.to_string()))
}

/// A frame that cannot be read to its end. Members before the fault count only for an answer.
fn refused(mut members: Members<'_>, problem: Problem) -> Incoming {
    members.op = members.known_op().unwrap_or_default();
    let op = providers::or_bad_answer(&members, Err(problem));
    let id = members.get("id").filter(|_| op.is_ok()).map(Payload::from);
    Incoming { id, op }
}

fn operation(members: &Members<'_>) -> Result<Op, OpError> {
    let (kind, read) = match members.op {
        "publish" => {
            return Ok(Op::Publish {
                topic: members.name("topic")?,
                msg: members.object("msg")?,
            });
        }
        "call_service" => (Served::Service, call(members).map(Op::CallService)),
        "send_action_goal" => (
            Served::Action,
            providers::goal(members).map(Op::SendActionGoal),
        ),
        _ => return providers::or_bad_answer(members, control::other(members)),
    };
    read.map_err(|problem| providers::fault(members, kind, problem))
}

fn call(members: &Members<'_>) -> Result<CallService, Problem> {
    Ok(CallService {
        service: members.name("service")?,
        timeout: timeout(members)?,
        args: members.args(),
    })
}

/// As in rosbridge, 0 or less means no timeout, which here is the longest one.
fn timeout(members: &Members<'_>) -> Result<Option<Duration>, Problem> {
    let timeout = members.optional("timeout", "a finite number of seconds", |raw| {
        json::number(raw).filter(|timeout| timeout.is_finite())
    })?;
    Ok(timeout.map(|timeout| match timeout {
        0.0 => MAX_TIMEOUT,
        _ => duration(timeout, MAX_TIMEOUT),
    }))
}

//! The question to `ik` in JSON, and the response; targets, in requests and in messages.
//!
//! **Invariant:** a target that is read has finite coordinates.

use actix::prelude::*;
use bytes::Bytes;

use super::{Ik, Solve, SolveError};
use crate::actors::wire::{Address, Answered, Callable, Nodes};
use crate::math::kinematics::Target;
use crate::protocol::catalog::Service;
use crate::protocol::messages::goal::{SolutionValues, TargetMessage};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};

impl<const N: usize> Ik<N> {
    /// Enters this node's service into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes.serve::<Solve<N>>(Service::Solve, address.clone());
    }
}

impl<const N: usize> Callable for Solve<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let target = read_target::<N>(&mut fields);
        let rejected = fields.finish();
        target.map(Self).ok_or(rejected)
    }
}

impl<const N: usize> Answered for Solve<N> {
    fn write(answer: Result<[f64; N], SolveError>, to: &Address) -> Bytes {
        let values = answer
            .as_ref()
            .map(|positions| SolutionValues { positions });
        to.outcome(values)
    }
}

/// Reads `x`, `y` and `phi`; none if one of them, or a field read before, is rejected.
///
/// Two links leave no orientation to choose: what stands there under `phi` is not looked at.
pub(in crate::actors::arm) fn read_target<const N: usize>(
    fields: &mut Fields<'_>,
) -> Option<Target> {
    let x = fields.number("x", Bound::Finite);
    let y = fields.number("y", Bound::Finite);
    let orientation = if N > 2 {
        fields.number("phi", Bound::Finite)
    } else {
        None
    };
    let position = glam::DVec2::new(x?, y?);
    fields.accepted().then_some(Target {
        position,
        orientation,
    })
}

/// A target as messages show it.
pub(in crate::actors::arm) fn target_message(target: &Target) -> TargetMessage {
    TargetMessage {
        x: target.position.x,
        y: target.position.y,
        phi: target.orientation,
    }
}

//! The questions to `ik_trial` in JSON, and the responses.
//!
//! **Invariant:** a start that is refused still echoes the settings in force.

use actix::prelude::*;
use bytes::Bytes;

use super::{IkTrial, SkipTarget, StartTrial, StopTrial, Terms};
use crate::actors::wire::{Address, Answered, Callable, Nodes};
use crate::math::trial::{Changes, Rejection, Settings};
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::Empty;
use crate::protocol::messages::goal::TrialValues;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};

impl<const N: usize> IkTrial<N> {
    /// Enters this node's services and its topic into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes.serve::<StartTrial>(Service::TrialStart, address.clone());
        nodes.serve::<SkipTarget>(Service::TrialSkip, address.clone());
        nodes.serve::<StopTrial>(Service::TrialStop, address.clone());
        let node = address.clone().recipient();
        nodes.publishers.insert(Topic::TrialStatus, node);
    }
}

impl Callable for StartTrial {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read_or_none(arguments, service);
        Ok(Self {
            changes: Changes {
                duration: fields.number("duration", Bound::Positive),
                epsilon: fields.number("epsilon", Bound::Positive),
                success_hold: fields.number("success_hold", Bound::NonNegative),
            },
            rejected: fields.finish(),
        })
    }
}

impl Answered for StartTrial {
    fn write(Terms { settings, outcome }: Terms, to: &Address) -> Bytes {
        let Settings { duration, criteria } = settings;
        let values = TrialValues {
            duration,
            epsilon: criteria.epsilon,
            success_hold: criteria.success_hold,
        };
        let status = outcome.map_or_else(|why| why.to_string(), |()| String::new());
        to.response(&values, &status)
    }
}

impl Callable for SkipTarget {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        Fields::read(arguments, service)?;
        Ok(Self)
    }
}

impl Answered for SkipTarget {
    fn write(answer: Result<(), Rejection>, to: &Address) -> Bytes {
        to.outcome(answer.map(|()| Empty {}))
    }
}

impl Callable for StopTrial {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        Fields::read(arguments, service)?;
        Ok(Self)
    }
}

impl Answered for StopTrial {
    fn write(answer: Result<(), Rejection>, to: &Address) -> Bytes {
        to.outcome(answer.map(|()| Empty {}))
    }
}

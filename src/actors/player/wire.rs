//! The player's questions in JSON, and its place in the registry's table.
//!
//! **Invariant:** of the runtime's own services those are listed that are served here.

use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use bytes::Bytes;
use serde_json::json;

use super::{DriveRecord, MAX_RATE, Player, PlayerState};
use crate::actors::arm::sim::{Enable, Pause, SetGains, SetIntegrator, SetParams};
use crate::actors::ros::rosapi::ArmParameters;
use crate::actors::wire::{Address, Answered, Callable, Nodes};
use crate::protocol::catalog::{Playback, Service, Topic};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::protocol::op::follow::seconds;
use crate::record::ReadError;

/// Longest time that can be asked for \[s\]: a record of ten thousand years ends earlier.
const MAX_TIME: f64 = 1e11;

impl<const N: usize> Player<N> {
    /// Enters this node's services and topics into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        for service in Playback::ALL {
            nodes.serve::<DriveRecord>(Service::Playback(service), address.clone());
        }
        nodes.serve::<SetParams<N>>(Service::SetParams, address.clone());
        nodes.serve::<SetGains<N>>(Service::SetGains, address.clone());
        nodes.serve::<SetIntegrator>(Service::SetIntegrator, address.clone());
        nodes.serve::<Enable>(Service::Enable, address.clone());
        nodes.serve::<Pause>(Service::Pause, address.clone());
        for topic in Topic::ALL {
            nodes.publishers.insert(topic, address.clone().recipient());
        }
    }

    /// The recorded arm, as far as its parameters and its time are concerned.
    #[must_use]
    pub fn parameters(address: &Addr<Self>) -> ArmParameters<N> {
        ArmParameters {
            params: address.clone().recipient(),
            gains: address.clone().recipient(),
            integrator: address.clone().recipient(),
            time: address.clone().recipient(),
        }
    }
}

/// All that `nodes` serve by now is what there is: a live arm's other services are not listed.
pub fn list_only_what_is_served(nodes: &mut Nodes) {
    let served = nodes.services.keys().copied().collect();
    nodes.replayed = Some(Arc::new(served));
}

impl Callable for DriveRecord {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let drive = match service {
            Service::Playback(Playback::Pause) => Some(Self::Pause(true)),
            Service::Playback(Playback::Resume) => Some(Self::Pause(false)),
            Service::Playback(Playback::TogglePaused) => Some(Self::Toggle),
            Service::Playback(Playback::SetRate) => read_rate(&mut fields).map(Self::Rate),
            Service::Playback(Playback::Seek) => read_time(&mut fields).map(Self::Seek),
            _ => Some(Self::Look),
        };
        drive.ok_or_else(|| fields.finish())
    }
}

fn read_rate(fields: &mut Fields<'_>) -> Option<f64> {
    let rate = fields.number("rate", Bound::Finite)?;
    if rate == 0.0 || rate.abs() > MAX_RATE {
        let why = format!("must be from -{MAX_RATE} to {MAX_RATE} and not 0, got {rate}");
        fields.refuse("rate", &why);
        return None;
    }
    Some(rate)
}

fn read_time(fields: &mut Fields<'_>) -> Option<Duration> {
    match seconds(fields.raw("time")?, "time") {
        Ok(time) => Some(Duration::from_secs_f64(time.min(MAX_TIME))),
        Err(why) => {
            fields.refuse(&why.field, &why.reason);
            None
        }
    }
}

impl Answered for DriveRecord {
    fn write(driven: Result<PlayerState, ReadError>, to: &Address) -> Bytes {
        let state = match driven {
            Ok(state) => state,
            Err(why) => return to.failure(&format!("the record cannot be read there: {why}")),
        };
        let service = Service::from_name(to.name());
        let values = match service {
            Some(Service::Playback(Playback::IsPaused)) => json!({"paused": state.is_paused}),
            Some(Service::Playback(Playback::GetRate)) => json!({"rate": state.rate}),
            Some(Service::Playback(Playback::SetRate | Playback::Seek)) => json!({"success": true}),
            Some(Service::Playback(Playback::GetPosition)) => json!({
                "position": state.position.as_secs_f64(),
                "duration": state.duration.as_secs_f64(),
            }),
            _ => json!({}),
        };
        to.response(&values, "")
    }
}

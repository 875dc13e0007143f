//! Converts events of the arm and the registry to entries of the record.
//!
//! **Invariant:** a listener copies and never blocks.

use bytes::Bytes;

use super::limits::MAX_RECORDED_FRAME;
use crate::actors::arm::sim::{ArmEvent, ArmListener, StepEvent};
use crate::actors::node::{Tap, Tapped};
use crate::record::{Content, write_note};

/// The arm's inputs and states. `put` returns whether it has accepted an entry.
#[must_use]
pub fn arm<const N: usize>(
    mut put: impl FnMut(Content) -> bool + Send + 'static,
) -> ArmListener<N> {
    Box::new(move |StepEvent { step, event }| {
        put(match event {
            ArmEvent::Noted(note) => Content::Input {
                step,
                note: write_note(&note),
            },
            ArmEvent::State { state, effort } => Content::State {
                step,
                position: state.position.to_vec(),
                velocity: state.velocity.to_vec(),
                effort: effort.to_vec(),
            },
        })
    })
}

/// Topics, calls and answers; `None` for one longer than [`MAX_RECORDED_FRAME`].
#[must_use]
pub fn registry(mut put: impl FnMut(Option<Content>) + Send + 'static) -> Tap {
    Box::new(move |what| {
        let length = match &what {
            Tapped::Published(_, frame) | Tapped::Answered { frame, .. } => frame.len(),
            Tapped::Called { id, args, .. } => {
                args.line().len() + id.map_or(0, |id| id.line().len())
            }
        };
        if length > MAX_RECORDED_FRAME {
            return put(None);
        }
        put(Some(match what {
            Tapped::Published(topic, frame) => Content::Published {
                topic,
                frame: copied(frame),
            },
            Tapped::Called {
                from,
                service,
                id,
                args,
            } => Content::Called {
                client: from.0,
                service,
                id: id.map_or("", |id| id.line()).into(),
                args: args.line().into(),
            },
            Tapped::Answered { to, service, frame } => Content::Answered {
                client: to.0,
                service,
                frame: copied(frame),
            },
        }));
    })
}

/// The frame is copied, because a shared frame would count for its client while a slow file holds it.
fn copied(frame: &Bytes) -> Bytes {
    Bytes::copy_from_slice(frame)
}

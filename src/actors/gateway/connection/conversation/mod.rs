//! The conversation with a client: one task reads what it sends, and the writer sends what is for it.
//!
//! **Invariant:** where one of the two ends, the other has a bounded time.

mod perform;
mod reader;
mod writer;

use std::rc::Rc;

use bytes::BytesMut;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tokio::time::timeout;

use self::reader::Reader;
use super::session::ClientSession;
use super::transport::{Inbound, Outbound};
use crate::actors::ConnectionId;
use crate::actors::gateway::limits::LINGER;
use crate::actors::gateway::messages::Disconnect;
use crate::actors::panics::contained;
use crate::protocol::wire::frame::FrameReader;

impl ClientSession {
    /// The reading half for client `id`.
    pub(super) fn reader(&self, id: ConnectionId, frames: FrameReader) -> Reader {
        let shared = Rc::clone(&self.shared);
        Reader::new(id, shared, self.finish.clone(), frames)
    }

    /// Reads and writes until the client is gone or has all that is for it.
    pub(super) async fn talk<I, O>(&self, reader: Reader, input: I, output: O, first: BytesMut)
    where
        I: Inbound + 'static,
        O: Outbound + 'static,
    {
        let shared = Rc::clone(&self.shared);
        let mut reading = Spawned(actix_rt::spawn(async move {
            if let Err(panic) = contained(reader.run(input, first)).await {
                tracing::error!(%panic, "a client's reader failed; its connection ends");
                shared.abandon_computations();
                if let Some(id) = shared.id.get() {
                    let _ = shared.registry.send(Disconnect(id)).await;
                }
                shared.finish();
            }
        }));
        let (end, ended) = oneshot::channel();
        let shared = Rc::clone(&self.shared);
        let _writing = self.shared.outgoing.begin_writing(async move {
            let _ = end.send(writer::run(output, &shared).await);
        });
        let all_written = ended.await.unwrap_or(false);
        // If something still reads after this, it ends here.
        if all_written && self.shared.is_refused() {
            let _ = (&mut reading.0).await;
        } else if all_written && O::END_IS_ANSWERED {
            let _ = timeout(LINGER, &mut reading.0).await;
        }
    }
}

/// A task that is aborted when this is dropped.
struct Spawned<T>(JoinHandle<T>);

impl<T> Drop for Spawned<T> {
    fn drop(&mut self) {
        self.0.abort();
    }
}

//! The conversation with a client: one task reads what it sends, and the writer sends what is for it.
//!
//! **Invariant:** where one of the two ends, the other has a bounded time.

mod perform;
mod reader;
mod writer;

use std::rc::Rc;
use std::time::Duration;

use bytes::BytesMut;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tokio::time::timeout;

use self::reader::Reader;
use super::session::ClientSession;
use super::shared::{Ending, HELD_MOST};
use super::transport::{Inbound, Outbound};
use super::unfinished::Unfinished;
use crate::actors::ConnectionId;
use crate::actors::gateway::limits::LINGER;
use crate::actors::gateway::messages::{Disconnect, Finish, Respond};
use crate::actors::panics::contained;
use crate::actors::resources::budget::MODEST;
use crate::protocol::messages::{self, Level};
use crate::protocol::wire::frame::FrameReader;

/// Why a client that has stopped sending is not waited for any more.
const DISPLACED: &str =
    "connections: this one had stopped sending, and another client needed its place";
/// How long a client that held the most, or lost its place, may take to read that.
const LAST_STATUS_TIME: Duration = Duration::from_secs(1);

impl ClientSession {
    /// The reading half for client `id`; what has been read of it so far is counted in `unfinished`.
    pub(super) fn reader(
        &self,
        id: ConnectionId,
        frames: FrameReader,
        unfinished: Unfinished,
    ) -> Reader {
        let shared = Rc::clone(&self.shared);
        Reader::new(id, shared, self.finish.clone(), frames, unfinished)
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
        let (end, mut ended) = oneshot::channel();
        let shared = Rc::clone(&self.shared);
        let _writing = self.shared.outgoing.begin_writing(async move {
            let _ = end.send(writer::run(output, &shared).await);
        });
        let all_written = tokio::select! {
            biased;
            all_written = &mut ended => all_written.unwrap_or(false),
            held = self.shared.outgoing.gives_way() => {
                drop(reading);
                return self.cut_off(held, ended).await;
            }
            () = self.shared.displaced.notified() => {
                drop(reading);
                return self.make_way(ended).await;
            }
        };
        // If something still reads after this, it ends here.
        if all_written && self.shared.is_refused() {
            let _ = (&mut reading.0).await;
        } else if all_written && O::END_IS_ANSWERED {
            let _ = timeout(LINGER, &mut reading.0).await;
        }
    }

    /// Ends the connection of a client that held the most when all clients together held too much: what it had goes
    /// at once, and it is told why if it takes that within [`LAST_STATUS_TIME`].
    async fn cut_off(&self, held: usize, ended: oneshot::Receiver<bool>) {
        let shared = &self.shared;
        let id = shared.id.get();
        let why = format!("{HELD_MOST} ({} MB)", held.div_ceil(1_000_000));
        tracing::warn!(
            connection = id.map(|id| id.0),
            why,
            "a client is disconnected"
        );
        shared.ending.set(Ending::CutOff);
        shared.abandon_computations();
        shared.outgoing.empty();
        let Some(connection) = id else {
            return;
        };
        let status = Respond::error(connection, &why, None);
        let _ = self.shared.registry.send(status).await;
        // Once this is answered, all that was on its way to the client has come.
        let _ = self.shared.registry.send(Disconnect(connection)).await;
        let _ = self.finish.send(Finish).await;
        // The client may have stopped in the middle of a long frame, which would have to be kept until it goes on.
        if shared.account.held() <= MODEST {
            let _ = timeout(LAST_STATUS_TIME, ended).await;
        }
    }
}

impl ClientSession {
    /// Ends the connection of a client that has lost its place: the registry knows it no longer, and another is served.
    async fn make_way(&self, ended: oneshot::Receiver<bool>) {
        let shared = &self.shared;
        shared.abandon_computations();
        let why = messages::status(Level::Error, DISPLACED, None);
        shared
            .outgoing
            .push_response(shared.account.count(why), &[]);
        shared.finish();
        let _ = timeout(LAST_STATUS_TIME, ended).await;
    }
}

/// A task that is aborted when this is dropped.
struct Spawned<T>(JoinHandle<T>);

impl<T> Drop for Spawned<T> {
    fn drop(&mut self) {
        self.0.abort();
    }
}

//! Admission: the conditions under which a client is served, for every protocol, and its way to a place.
//!
//! **Invariant:** with a token set, bytes after a first frame without the token are not read. Any number of clients
//! without the token cannot block a client with the token.

use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use bytes::{Bytes, BytesMut};
use tokio::time::{Instant, sleep};

use super::transport::Transport;
use crate::actors::gateway::limits::{LOOK_AGAIN, OPENING_TIME};
use crate::actors::gateway::registry::{Connect, CountRefusal, HeldPlace, Outlets, Registry};
use crate::actors::resources::places::{HeldSlot, Refused, Slots};
use crate::actors::resources::unread::Ends;
use crate::protocol::op::token::Token;
#[cfg(feature = "web")]
use crate::web::Site;

/// Bytes that a client may send before it has shown its token.
pub const MAX_AUTH_BYTES: usize = 16 * 1024;
/// Delay of the answer to a wrong token. In this time at most
/// [`MAX_NEWCOMERS`](crate::actors::resources::places::MAX_NEWCOMERS) wrong tokens are answered. The
/// [length](crate::protocol::op::token::MIN_TOKEN) of a token makes guessing hopeless.
pub const WRONG_TOKEN_TIME: Duration = Duration::from_millis(500);

/// The conditions under which a listener admits clients.
#[derive(Debug, Default)]
pub struct Admission {
    /// If it is set, every client must send it.
    pub token: Option<Token>,
    /// Selects the clients that are served over HTTP, and the files for them.
    #[cfg(feature = "web")]
    pub site: Site,
    /// Slots of newcomers.
    pub newcomers: Slots,
}

/// A client whose protocol is being detected.
pub(super) struct ClientSession {
    pub(super) registry: Addr<Registry>,
    pub(super) admission: Arc<Admission>,
    pub(super) ends: Ends,
    pub(super) outlets: Outlets,
}

/// A client that exchanges frames from now on.
pub(super) struct Opened<S> {
    /// Its place, or the status with the reason why it gets none.
    pub(super) place: Result<HeldPlace, Bytes>,
    pub(super) transport: Transport<S>,
    /// Bytes that were already read.
    pub(super) first: BytesMut,
}

impl ClientSession {
    /// Registers the client.
    pub(super) async fn connect(&self, may_use_kept: bool) -> Result<HeldPlace, Refused> {
        let connect = Connect {
            outlets: self.outlets.clone(),
            from: self.ends.peer.ip().to_canonical(),
            may_use_kept,
        };
        let answer = self.registry.send(connect).await;
        answer.unwrap_or(Err(Refused::Closed))
    }

    /// Takes a place, possibly a kept one. If none is free, waits up to [`OPENING_TIME`] for one.
    pub(super) async fn wait_for_place(&self, slot: &mut HeldSlot) -> Result<HeldPlace, Refused> {
        let due = Instant::now() + OPENING_TIME;
        loop {
            let place = self.connect(true).await;
            if !matches!(place, Err(Refused::Full { .. })) || Instant::now() >= due {
                return place;
            }
            tokio::select! {
                _ = &mut *slot => return place,
                () = sleep(LOOK_AGAIN) => {}
            }
        }
    }

    /// Counts a client that gets no place. Returns the reason.
    pub(super) fn turn_away(&self, why: Refused) -> String {
        if matches!(why, Refused::Full { .. }) {
            self.registry.do_send(CountRefusal);
        }
        why.to_string()
    }

    /// Delays the answer to a wrong token. A correct token is admitted at once.
    pub(super) async fn delay_wrong_token(&self) {
        let from = self.ends.peer.ip();
        tracing::warn!(%from, "a client sent a wrong token");
        sleep(WRONG_TOKEN_TIME).await;
    }
}

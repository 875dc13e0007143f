//! HTTP clients: requests are answered until the client ends or opens a WebSocket. After that it is served like others.
//!
//! **Invariant:** over WebSocket, no status is sent before the client requests statuses.

use std::cell::Cell;
use std::future::pending;

use bytes::BytesMut;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::time::Instant;

use super::admission::HeldSlot;
use super::session::{ClientSession, HeldPlace, Opened};
use super::transport::Transport;
use crate::actors::gateway::registry::{Refused, Request};
use crate::protocol::messages::ErrorForm;
use crate::protocol::op::{Incoming, Op, Verbosity};
use crate::web::serve::{self, Gate};

/// A client without a place: its slot, and the reason. `None` means that the token is missing.
pub(super) type Newcomer<'a> = (HeldSlot<'a>, Option<Refused>);

/// Admits or refuses the requests of one client.
struct HttpGate<'a> {
    session: &'a ClientSession,
    /// Set until the first request is admitted, if the client came without a place.
    newcomer: Cell<Option<Newcomer<'a>>>,
    place: Cell<Option<HeldPlace>>,
}

impl Gate for HttpGate<'_> {
    async fn admit(&self) -> Result<(), String> {
        let Some((slot, _)) = self.newcomer.take() else {
            return Ok(());
        };
        let place = self.session.wait_for_place(&slot).await;
        let place = place.map_err(|why| self.session.turn_away(Some(why)))?;
        self.place.set(Some(place));
        Ok(())
    }

    async fn delay(&self) {
        self.session.delay_wrong_token().await;
    }
}

impl ClientSession {
    /// Answers the requests of a client. Returns the client if it opens a WebSocket. A newcomer gets a place when its
    /// first request is admitted.
    pub(super) async fn serve_http<S>(
        &self,
        stream: S,
        first: BytesMut,
        due: Instant,
        client: Result<HeldPlace, Newcomer<'_>>,
    ) -> Option<Opened<S>>
    where
        S: AsyncRead + AsyncWrite + Unpin + 'static,
    {
        let (place, newcomer) = match client {
            Ok(place) => (Some(place), None),
            Err(newcomer) => (None, Some(newcomer)),
        };
        let evicted = newcomer.as_ref().map(|(slot, _)| slot.evicted());
        let gate = HttpGate {
            session: self,
            newcomer: Cell::new(newcomer),
            place: Cell::new(place),
        };
        // The reason for an evicted client. After its request is admitted, the response has the reason instead.
        let crowded = async {
            if let Some(evicted) = evicted {
                evicted.await;
                if let Some((_, why)) = gate.newcomer.take() {
                    return self.turn_away(why);
                }
            }
            pending().await
        };
        let cut_off = async {
            tokio::select! {
                () = self.finish.notified() => None,
                why = crowded => Some(why),
            }
        };
        let site = (&self.admission.site, self.ends.local);
        let (stream, behind) = serve::serve(stream, first, due, site, &gate, cut_off).await?;
        let place = gate.place.take()?;
        let quiet = Request {
            from: place.id(),
            incoming: Incoming {
                id: None,
                op: Ok(Op::SetLevel {
                    verbosity: Verbosity::NONE,
                    errors: Some(ErrorForm::Text),
                }),
            },
            permit: None,
        };
        let _ = self.registry.send(quiet).await;
        Some(Opened {
            place: Ok(place),
            transport: Transport::socket(stream),
            first: behind.into(),
        })
    }
}

//! HTTP clients: requests are answered, until the client ends or opens a WebSocket. Then it is served like any other.
//!
//! **Invariant:** over WebSocket no status is sent before the client has asked for such.

use std::cell::Cell;
use std::future::pending;

use bytes::BytesMut;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::time::Instant;

use super::admission::authentication::AuthError;
use super::admission::slots::HeldSlot;
use super::session::{ClientSession, HeldPlace, Opened};
use super::transport::Transport;
use super::websocket::WebSocket;
use crate::actors::gateway::limits::OPENING_TIME;
use crate::actors::gateway::messages::{Outlets, Refused, Request};
use crate::protocol::messages::ErrorForm;
use crate::protocol::op::{Op, Verbosity};
use crate::web::serve::{self, Gate};

/// Decides about the requests of one client.
struct HttpGate<'a> {
    session: &'a ClientSession,
    /// The way to a client that has no place yet.
    outlets: Cell<Option<Outlets>>,
    place: Cell<Option<HeldPlace>>,
    /// The slot of a client that has no place yet, and why it is turned away without: `None` for the missing token.
    slot: Option<(HeldSlot<'a>, Option<Refused>)>,
}

impl Gate for HttpGate<'_> {
    async fn admit(&self) -> Result<(), String> {
        let Some(outlets) = self.outlets.take() else {
            return Ok(());
        };
        if let Some((slot, _)) = &self.slot {
            slot.give_back();
        }
        let slot = self.session.admission.waiting.take();
        let due = Instant::now() + OPENING_TIME;
        let place = self.session.wait_for_place(&outlets, &slot, due).await;
        let place = place.map_err(|why| {
            self.session.count_refusal(why);
            why.to_string()
        })?;
        self.place.set(Some(place));
        Ok(())
    }

    async fn delay(&self) {
        self.session.delay_wrong_token().await;
    }
}

impl HttpGate<'_> {
    /// Ends when the connection has to: with a sentence, if its slot is another client's.
    async fn cut_off(&self) -> Option<String> {
        let evicted = async {
            let Some((slot, refused)) = &self.slot else {
                return pending().await;
            };
            slot.evicted().await;
            let Some(why) = *refused else {
                return AuthError::Crowded.to_string();
            };
            self.session.count_refusal(why);
            why.to_string()
        };
        tokio::select! {
            () = self.session.finish.notified() => None,
            why = evicted => Some(why),
        }
    }
}

impl ClientSession {
    /// Answers the requests of a client. Returns it once it has opened a WebSocket. A client with a slot gets a place
    /// once its first request is admitted.
    pub(super) async fn serve_http<S>(
        &self,
        stream: S,
        first: BytesMut,
        due: Instant,
        client: Result<HeldPlace, (Outlets, HeldSlot<'_>, Option<Refused>)>,
    ) -> Option<Opened<S>>
    where
        S: AsyncRead + AsyncWrite + Unpin + 'static,
    {
        let (place, outlets, slot) = match client {
            Ok(place) => (Some(place), None, None),
            Err((outlets, slot, refused)) => (None, Some(outlets), Some((slot, refused))),
        };
        let gate = HttpGate {
            session: self,
            outlets: Cell::new(outlets),
            place: Cell::new(place),
            slot,
        };
        let site = (&self.admission.site, self.ends.local);
        let cut_off = gate.cut_off();
        let (stream, behind) = serve::serve(stream, first, due, site, &gate, cut_off).await?;
        let place = gate.place.take()?;
        let quiet = Request {
            from: place.id(),
            id: None,
            op: Op::SetLevel {
                verbosity: Verbosity::NONE,
                errors: Some(ErrorForm::Text),
            },
            permit: None,
        };
        let _ = self.registry.send(quiet).await;
        let socket = WebSocket::open(stream, behind, self.memory.clone()).await;
        Some(Opened {
            place: Ok(place),
            transport: Transport::WebSocket(Box::new(socket)),
            first: BytesMut::new(),
        })
    }
}

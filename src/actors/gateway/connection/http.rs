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
use super::session::{ClientSession, HeldPlace, Newcomer, Opened};
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
    /// The ways to a client that has no place yet.
    outlets: Cell<Option<Outlets>>,
    place: Cell<Option<HeldPlace>>,
    /// Its slot, and why it is turned away without.
    newcomer: Option<(HeldSlot<'a>, Option<Refused>)>,
}

impl Gate for HttpGate<'_> {
    async fn admit(&self) -> Result<(), String> {
        let Some(outlets) = self.outlets.take() else {
            return Ok(());
        };
        if let Some((slot, _)) = &self.newcomer {
            slot.give_back();
        }
        let slot = self.session.admission.newcomers.waiting.take();
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
            let Some((slot, refused)) = &self.newcomer else {
                return pending().await;
            };
            slot.evicted().await;
            match *refused {
                None => AuthError::Crowded.to_string(),
                Some(why) => {
                    self.session.count_refusal(why);
                    why.to_string()
                }
            }
        };
        tokio::select! {
            () = self.session.finish.notified() => None,
            why = evicted => Some(why),
        }
    }
}

impl ClientSession {
    /// Answers the requests of a client. Returns it once it has opened a WebSocket. A newcomer has no place before its
    /// first request is admitted.
    pub(super) async fn serve_http<S>(
        &self,
        stream: S,
        first: BytesMut,
        due: Instant,
        client: Result<Newcomer<'_>, HeldPlace>,
    ) -> Option<Opened<S>>
    where
        S: AsyncRead + AsyncWrite + Unpin + 'static,
    {
        let (newcomer, place) = match client {
            Ok(newcomer) => (Some(newcomer), None),
            Err(place) => (None, Some(place)),
        };
        let (outlets, newcomer) = newcomer
            .map(|newcomer| (newcomer.outlets, (newcomer.slot, newcomer.refused)))
            .unzip();
        let gate = HttpGate {
            session: self,
            outlets: Cell::new(outlets),
            place: Cell::new(place),
            newcomer,
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
            place,
            transport: Transport::WebSocket(Box::new(socket)),
            first: BytesMut::new(),
        })
    }
}

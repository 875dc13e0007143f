//! HTTP clients: requests are answered until the client ends or opens a WebSocket. After that it is served like others.
//!
//! **Invariant:** over WebSocket, no status is sent before the client requests statuses.

use std::cell::RefCell;
use std::future::poll_fn;
use std::pin::Pin;
use std::task::{Poll, ready};

use bytes::BytesMut;
use tokio::time::Instant;

use super::admission::HeldSlot;
use super::session::{ClientSession, HeldPlace, Opened};
use super::transport::{ClientStream, Transport};
use crate::actors::gateway::registry::{Refused, Request};
use crate::protocol::messages::ErrorForm;
use crate::protocol::op::{Incoming, Op, Verbosity};
use crate::web::serve::{self, Gate};

/// A client without a place: its slot, and the reason.
pub(super) type Newcomer = (HeldSlot, Refused);

/// Admits a client. A newcomer gets a place, or the reason why there is none, with its first request.
struct HttpGate<'a> {
    session: &'a ClientSession,
    newcomer: RefCell<Option<Newcomer>>,
    place: RefCell<Option<HeldPlace>>,
}

impl HttpGate<'_> {
    /// Returns the reason when a newcomer is evicted before its first request. After that the response has the reason.
    async fn evicted(&self) -> String {
        let why = poll_fn(|cx| {
            let mut newcomer = self.newcomer.borrow_mut();
            let Some((slot, why)) = &mut *newcomer else {
                return Poll::Pending;
            };
            let _ = ready!(Pin::new(slot).poll(cx));
            Poll::Ready(*why)
        });
        self.session.turn_away(why.await)
    }
}

impl Gate for HttpGate<'_> {
    async fn admit(&self) -> Result<(), String> {
        let newcomer = self.newcomer.take();
        if let Some((mut slot, _)) = newcomer {
            let place = self.session.wait_for_place(&mut slot).await;
            let place = place.map_err(|why| self.session.turn_away(why))?;
            self.place.replace(Some(place));
        }
        Ok(())
    }

    async fn delay(&self) {
        self.session.delay_wrong_token().await;
    }
}

impl ClientSession {
    /// Answers the requests of a client. Returns the client if it opens a WebSocket. A newcomer gets a place when its
    /// first request is admitted.
    pub(super) async fn serve_http<S: ClientStream>(
        &self,
        stream: S,
        first: BytesMut,
        due: Instant,
        client: Result<HeldPlace, Newcomer>,
    ) -> Option<Opened<S>> {
        let (place, newcomer) = match client {
            Ok(place) => (Some(place), None),
            Err(newcomer) => (None, Some(newcomer)),
        };
        let gate = HttpGate {
            session: self,
            newcomer: RefCell::new(newcomer),
            place: RefCell::new(place),
        };
        let site = (&self.admission.site, self.ends.local);
        let served = serve::serve(stream, first, due, site, &gate, gate.evicted());
        let (stream, behind) = served.await?;
        let place = gate.place.into_inner()?;
        let quiet = Request {
            from: place.id,
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

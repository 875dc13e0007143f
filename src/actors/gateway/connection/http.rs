//! HTTP clients: requests are answered until the client ends or opens a WebSocket. After that it is served like others.
//!
//! **Invariant:** over WebSocket, no status is sent before the client requests statuses.

use std::cell::RefCell;
use std::future::poll_fn;
use std::pin::Pin;
use std::task::{Poll, ready};

use bytes::BytesMut;
use tokio::time::Instant;

use super::admission::{ClientSession, Opened};
use super::transport::{ClientStream, Transport};
use crate::actors::gateway::registry::{HeldPlace, Request};
use crate::actors::resources::places::{HeldSlot, Refused};
use crate::protocol::messages::ErrorForm;
use crate::protocol::op::{Incoming, Op, Verbosity};
use crate::web::serve::{self as requests, Gate};

/// A client without a place: its slot, and the reason.
pub(super) type Newcomer = (HeldSlot, Refused);

/// Admits a client. A newcomer gets a place, or the reason why there is none, with its first request.
struct HttpGate<'a> {
    session: &'a ClientSession,
    /// The client. `None` while a newcomer waits for its place, and if it got none.
    client: RefCell<Option<Result<HeldPlace, Newcomer>>>,
}

impl HttpGate<'_> {
    /// Returns the reason when a newcomer is evicted before its first request. After that the response has the reason.
    async fn evicted(&self) -> String {
        let why = poll_fn(|cx| {
            let mut client = self.client.borrow_mut();
            let Some(Err((slot, why))) = &mut *client else {
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
        let mut client = self.client.take();
        if let Some(Err((slot, _))) = &mut client {
            let place = self.session.wait_for_place(slot).await;
            let place = place.map_err(|why| self.session.turn_away(why))?;
            client = Some(Ok(place));
        }
        self.client.replace(client);
        Ok(())
    }

    async fn delay(&self) {
        self.session.delay_wrong_token().await;
    }
}

/// Answers the requests of a client. Returns the client if it opens a WebSocket. A newcomer gets a place when its
/// first request is admitted.
pub(super) async fn serve<S: ClientStream>(
    session: &ClientSession,
    stream: S,
    first: BytesMut,
    due: Instant,
    client: Result<HeldPlace, Newcomer>,
) -> Option<Opened<S>> {
    let gate = HttpGate {
        session,
        client: RefCell::new(Some(client)),
    };
    let (site, local) = (&session.admission.site, session.ends.local);
    let served = requests::serve(stream, first, due, site, local, &gate, gate.evicted());
    let (stream, behind) = served.await?;
    let place = gate.client.into_inner()?.ok()?;
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
    let _ = session.registry.send(quiet).await;
    Some(Opened {
        place: Ok(place),
        transport: Transport::socket(stream),
        first: behind.into(),
    })
}

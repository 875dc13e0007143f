//! HTTP clients: requests are answered until the client ends or opens a WebSocket. After that it is served like others.
//!
//! **Invariant:** over WebSocket, no status is sent before the client requests statuses.

use std::future::pending;

use bytes::BytesMut;
use tokio::sync::mpsc::{self, Sender};
use tokio::sync::oneshot;
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

/// Asks the session whether a client is admitted. The session takes only the first request of a client without a place.
struct HttpGate<'a> {
    session: &'a ClientSession,
    requests: Sender<oneshot::Sender<Result<(), String>>>,
}

impl Gate for HttpGate<'_> {
    async fn admit(&self) -> Result<(), String> {
        let (reply, answer) = oneshot::channel();
        let _ = self.requests.send(reply).await;
        answer.await.unwrap_or(Ok(()))
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
        let (mut place, newcomer) = match client {
            Ok(place) => (Some(place), None),
            Err(newcomer) => (None, Some(newcomer)),
        };
        let (requests, mut asked) = mpsc::channel(1);
        let gate = HttpGate {
            session: self,
            requests,
        };
        // Returns the reason for an evicted client. After its request, the response has the reason instead.
        let admitting = async {
            if let Some((mut slot, why)) = newcomer {
                let request = tokio::select! {
                    biased;
                    request = asked.recv() => request,
                    _ = &mut slot => return self.turn_away(why),
                };
                let answer = match self.wait_for_place(&mut slot).await {
                    Ok(held) => {
                        place = Some(held);
                        Ok(())
                    }
                    Err(why) => Err(self.turn_away(why)),
                };
                let _ = request.map(|reply| reply.send(answer));
            }
            drop(asked);
            pending().await
        };
        let cut_off = async {
            tokio::select! {
                () = self.finish.notified() => None,
                why = admitting => Some(why),
            }
        };
        let site = (&self.admission.site, self.ends.local);
        let (stream, behind) = serve::serve(stream, first, due, site, &gate, cut_off).await?;
        let place = place?;
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

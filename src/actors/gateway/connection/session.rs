//! The session of one client: by its first bytes it is refused, served over HTTP, or spoken with.
//!
//! **Invariant:** nothing of what a client sends is read as JSON before its opening is decided, and what has been
//! read by then is not lost.

use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use bytes::BytesMut;
#[cfg(feature = "web")]
use hyper::StatusCode;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::sync::Notify;
use tokio::time::{Instant, sleep, sleep_until, timeout};

use super::admission::authentication::{AuthError, authenticate, first_op, is_command};
use super::admission::slots::HeldSlot;
use super::admission::{Admission, WRONG_TOKEN_TIME};
use super::plain::CHUNK;
use super::transport::Transport;
use crate::actors::ConnectionId;
use crate::actors::gateway::ends::Ends;
use crate::actors::gateway::limits::{FRAME_TIME, HEAD_TIME, LINGER, LOOK_AGAIN, OPENING_TIME};
use crate::actors::gateway::messages::{Connect, CountRefusal, Disconnect, Outlets, Refused};
use crate::actors::gateway::registry::Registry;
#[cfg(feature = "web")]
use crate::actors::resources::memory::Memory;
use crate::protocol::messages::{self, Level};
use crate::protocol::op::token::Token;
#[cfg(feature = "web")]
use crate::protocol::wire::frame::Foreign;
use crate::protocol::wire::frame::{Opening, opening};
#[cfg(feature = "web")]
use crate::web::response::refusal;

/// A client whose first bytes are judged.
pub(super) struct ClientSession {
    pub(super) registry: Addr<Registry>,
    /// Where long messages find their room.
    #[cfg(feature = "web")]
    pub(super) memory: Memory,
    /// Notified when the runtime ends the connection first.
    pub(super) finish: Arc<Notify>,
    pub(super) admission: Arc<Admission>,
    pub(super) ends: Ends,
}

/// A client that is spoken with from now on.
pub(super) struct Opened<S> {
    /// Its place, or why it gets none.
    pub(super) place: Result<HeldPlace, String>,
    pub(super) transport: Transport<S>,
    /// Bytes that have been read.
    pub(super) first: BytesMut,
}

impl<S> Opened<S> {
    const fn new(stream: S, first: BytesMut, place: Result<HeldPlace, String>) -> Self {
        let transport = Transport::Plain(stream);
        Self {
            place,
            transport,
            first,
        }
    }
}

/// The place of a client that the registry knows. Dropping it gives it back.
pub(super) struct HeldPlace {
    id: ConnectionId,
    registry: Addr<Registry>,
}

impl HeldPlace {
    pub(super) const fn id(&self) -> ConnectionId {
        self.id
    }
}

impl Drop for HeldPlace {
    fn drop(&mut self) {
        self.registry.do_send(Disconnect(self.id));
    }
}

/// How a client is served, by its first bytes.
enum HowServed {
    /// Frames are exchanged with it.
    Json,
    /// The same with a command of this program.
    Command,
    /// Its opening decides, once it has a place.
    Undecided,
    /// Its requests are answered. The head of the first has to be complete by this time.
    #[cfg(feature = "web")]
    Http(Instant),
    /// It is refused, and gets this reason.
    Refused(String),
    /// There is nobody left to serve.
    Gone,
}

/// Decides when the opening of a client is examined.
#[derive(Clone, Copy)]
enum Examination<'a> {
    /// It has a place.
    Served,
    /// It has to show the token in time.
    Token(&'a Token, Instant),
    /// It has to show in time that it may use a kept place.
    Kept(Instant),
}

impl Examination<'_> {
    const fn due(self) -> Option<Instant> {
        match self {
            Self::Served => None,
            Self::Token(_, due) | Self::Kept(due) => Some(due),
        }
    }
}

impl ClientSession {
    /// Judges a client. Returns it if frames are exchanged with it, or if it is to be told why not.
    pub(super) async fn run<S>(self, mut stream: S, outlets: Outlets) -> Option<Opened<S>>
    where
        S: AsyncRead + AsyncWrite + Unpin + 'static,
    {
        let mut first = BytesMut::with_capacity(CHUNK);
        let mut how = HowServed::Undecided;
        // Nothing is asked of the registry for a client that has not shown the token.
        if let Some(token) = &self.admission.token {
            let slot = self.admission.unauthenticated.take();
            how = self.admit(token, &slot, &mut stream, &mut first).await;
            match how {
                #[cfg(feature = "web")]
                HowServed::Http(due) => {
                    let newcomer = Err((outlets, slot, None));
                    return self.serve_http(stream, first, due, newcomer).await;
                }
                HowServed::Refused(why) => return Some(Opened::new(stream, first, Err(why))),
                HowServed::Gone => return None,
                _ => {}
            }
        }
        let is_command = matches!(how, HowServed::Command);
        let mut place = self.connect(&outlets, is_command).await;
        if matches!(place, Err(Refused::Full { .. })) {
            let slot = self.admission.waiting.take();
            let due = Instant::now() + OPENING_TIME;
            if matches!(how, HowServed::Undecided) {
                let kept = Examination::Kept(due);
                how = tokio::select! {
                    biased;
                    how = self.examine(&mut stream, &mut first, kept) => how,
                    () = slot.evicted() => HowServed::Undecided,
                };
            }
            place = match how {
                #[cfg(feature = "web")]
                HowServed::Http(due) => {
                    let newcomer = Err((outlets, slot, place.err()));
                    return self.serve_http(stream, first, due, newcomer).await;
                }
                HowServed::Command => self.wait_for_place(&outlets, &slot, due).await,
                _ => self.connect(&outlets, false).await,
            };
        }
        drop(outlets);
        match place {
            Ok(_) if matches!(how, HowServed::Undecided) => {
                let served = Examination::Served;
                how = self.examine(&mut stream, &mut first, served).await;
            }
            Ok(_) => {}
            Err(why) => self.count_refusal(why),
        }
        let place = match (how, place) {
            (HowServed::Gone, _) => return None,
            (HowServed::Refused(why), _) => Err(why),
            (_, Err(why)) => Err(why.to_string()),
            #[cfg(feature = "web")]
            (HowServed::Http(due), Ok(place)) => {
                return self.serve_http(stream, first, due, Ok(place)).await;
            }
            (_, Ok(place)) => Ok(place),
        };
        Some(Opened::new(stream, first, place))
    }

    /// Has the client show the token. Closes a client that misses the deadline, and the oldest one when too many are
    /// unauthenticated.
    async fn admit<S>(
        &self,
        token: &Token,
        slot: &HeldSlot<'_>,
        stream: &mut S,
        first: &mut BytesMut,
    ) -> HowServed
    where
        S: AsyncRead + AsyncWrite + Unpin,
    {
        let shown = Examination::Token(token, Instant::now() + HEAD_TIME);
        // A client that has sent the token gets in, also where its slot is lost in the same moment.
        tokio::select! {
            biased;
            how = self.examine(stream, first, shown) => how,
            () = slot.evicted() => {
                refuse_evicted(stream, first).await;
                HowServed::Gone
            }
        }
    }

    /// Takes a place, a kept one too. Where those are taken, it has until `due` for one to become free.
    pub(super) async fn wait_for_place(
        &self,
        outlets: &Outlets,
        slot: &HeldSlot<'_>,
        due: Instant,
    ) -> Result<HeldPlace, Refused> {
        loop {
            let place = self.connect(outlets, true).await;
            if !matches!(place, Err(Refused::Full { .. })) || Instant::now() >= due {
                return place;
            }
            tokio::select! {
                () = slot.evicted() => return place,
                () = sleep(LOOK_AGAIN) => {}
            }
        }
    }

    /// Counts a client that is turned away, if no place was free.
    pub(super) fn count_refusal(&self, why: Refused) {
        if matches!(why, Refused::Full { .. }) {
            self.registry.do_send(CountRefusal);
        }
    }

    /// Waits before a wrong token is answered. The right one is admitted at once.
    pub(super) async fn delay_wrong_token(&self) {
        let from = self.ends.peer.ip();
        tracing::warn!(%from, "a wrong token was shown");
        sleep(WRONG_TOKEN_TIME).await;
    }

    /// Makes the client known.
    async fn connect(&self, outlets: &Outlets, may_use_kept: bool) -> Result<HeldPlace, Refused> {
        let connect = Connect {
            outlets: outlets.clone(),
            from: self.ends.peer.ip().to_canonical(),
            may_use_kept,
        };
        let answer = self.registry.send(connect).await;
        let id = answer.unwrap_or(Err(Refused::Closed))?;
        let registry = self.registry.clone();
        Ok(HeldPlace { id, registry })
    }

    /// Reads until the opening of the client is decided.
    async fn examine<S>(
        &self,
        stream: &mut S,
        first: &mut BytesMut,
        examination: Examination<'_>,
    ) -> HowServed
    where
        S: AsyncRead + AsyncWrite + Unpin,
    {
        match (self.detect(stream, first, examination).await, examination) {
            (HowServed::Json, Examination::Kept(due)) => match first_op(stream, first, due).await {
                Ok(op) if is_command(&op) => HowServed::Command,
                _ => HowServed::Undecided,
            },
            (HowServed::Json, Examination::Token(token, due)) => {
                let op = first_op(stream, first, due).await;
                match op.and_then(|op| authenticate(token, op)) {
                    Ok(op) if is_command(&op) => HowServed::Command,
                    Ok(_) => HowServed::Json,
                    Err(why) => {
                        if why == AuthError::Wrong {
                            self.delay_wrong_token().await;
                        }
                        HowServed::Refused(why.to_string())
                    }
                }
            }
            (HowServed::Gone, _) => {
                let _ = timeout(LINGER, stream.shutdown()).await;
                HowServed::Gone
            }
            (how, _) => how,
        }
    }

    /// Reads until the first bytes tell the client's protocol. A client that ends before that counts as one that
    /// speaks JSON. A silent client may stay silent, unless it has something to show until `due`; a client that has
    /// begun what may become a request has to go on.
    async fn detect<S: AsyncRead + Unpin>(
        &self,
        stream: &mut S,
        first: &mut BytesMut,
        examination: Examination<'_>,
    ) -> HowServed {
        let foreign = |why: &str| HowServed::Refused(why.to_owned());
        let mut deadline = examination.due();
        loop {
            match opening(first) {
                Opening::Undecided => {
                    let may_be_foreign = !first.trim_ascii_start().starts_with(b"{");
                    let time = if may_be_foreign {
                        HEAD_TIME
                    } else {
                        FRAME_TIME
                    };
                    if !first.trim_ascii().is_empty() {
                        deadline.get_or_insert_with(|| Instant::now() + time);
                    }
                }
                Opening::Json => return HowServed::Json,
                #[cfg(feature = "web")]
                Opening::Foreign(Foreign::Http)
                    if first.starts_with(b"GET ") || first.starts_with(b"HEAD ") =>
                {
                    let due = examination.due();
                    return HowServed::Http(due.unwrap_or_else(|| Instant::now() + HEAD_TIME));
                }
                Opening::Foreign(protocol) => return foreign(protocol.explanation()),
            }
            let read = tokio::select! {
                biased;
                () = self.finish.notified() => return HowServed::Gone,
                // A few bytes decide, and there is room for them.
                read = stream.read_buf(first) => read,
                () = sleep_until(deadline.unwrap_or_else(Instant::now)), if deadline.is_some() => {
                    return match examination {
                        Examination::Token(..) => foreign(&AuthError::TooLate.to_string()),
                        Examination::Served => {
                            foreign("what this connection began with did not go on")
                        }
                        // It is refused like any other client without a place.
                        Examination::Kept(_) => HowServed::Json,
                    };
                }
            };
            if read.unwrap_or(0) == 0 {
                return HowServed::Json;
            }
        }
    }
}

/// Closes a client that has waited longest of too many to show its token, and tells it why if it takes that at once.
async fn refuse_evicted<S: AsyncWrite + Unpin>(stream: &mut S, first: &[u8]) {
    let why = AuthError::Crowded.to_string();
    let message = match opening(first) {
        #[cfg(feature = "web")]
        Opening::Foreign(Foreign::Http) => refusal(StatusCode::SERVICE_UNAVAILABLE, &why).into(),
        _ => messages::status(Level::Error, &why, None),
    };
    let tell = async {
        stream.write_all(&message).await?;
        stream.shutdown().await
    };
    let _ = timeout(Duration::ZERO, tell).await;
}

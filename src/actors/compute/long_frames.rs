//! The frames of a client that are long or come in pieces. A long frame, of more than [`SHORT_WORK`] bytes, is parsed
//! on a worker thread.
//!
//! **Invariant:** a client has at most one memory permit for its frames. It keeps the permit while its pieces take more
//! than [`SHORT`] bytes.

use tokio::time::Instant;

use crate::actors::resources::long_work::{SHORT_WORK, WorkKind, run_long_work};
use crate::actors::resources::memory::{LONG_FRAME_TIME, Memory, Permit, SHORT};
use crate::protocol::limits::MEDIUM;
use crate::protocol::op::{self, Incoming, Op, OpError, Problem};
use crate::protocol::wire::fragments::Fragments;
use crate::protocol::wire::frame::RawFrame;

const _: () = assert!(SHORT_WORK <= SHORT, "a short frame needs no permit");

const NESTED_FRAGMENT: &str = "fragment: the joined pieces must not be a fragment";

/// A frame that cannot be performed at once.
pub enum LongFrame {
    /// It has more than [`SHORT_WORK`] bytes.
    Unread(RawFrame),
    /// A piece of a message, from a frame of this length.
    Piece(Incoming, usize),
}

/// The op of a frame, or the frame's error, and the length of the frame. A piece of a message and white space have
/// none.
pub type Parsed = Result<Option<(Incoming, usize)>, &'static str>;

/// The input that a client keeps in memory between its frames.
#[derive(Default)]
pub struct LongFrames {
    /// Frames that come in pieces.
    pub fragments: Fragments,
    /// The memory permit of the client's long frame. It is held until the frame was performed and its answers written,
    /// and while pieces of a frame are kept.
    pub permit: Option<Permit>,
    /// Deadline of the frame that holds the permit.
    pub due: Option<Instant>,
}

impl LongFrames {
    /// Releases the memory permit, unless a long frame `is_coming` or pieces of one are kept.
    pub fn give_back(&mut self, is_coming: bool) {
        if !is_coming && self.fragments.allocated() <= SHORT {
            (self.permit, self.due) = (None, None);
        }
    }

    /// Keeps a memory permit for a frame that is still to come.
    pub fn hold(&mut self, permit: Permit) {
        self.permit = Some(permit);
        self.due = Some(Instant::now() + LONG_FRAME_TIME);
    }

    /// Reads a frame. A piece of a message is kept, and the last one gives the op of the message.
    ///
    /// # Errors
    /// The reason why the client is refused.
    pub async fn read(&mut self, memory: &Memory, frame: LongFrame) -> Parsed {
        let (incoming, length) = match frame {
            LongFrame::Piece(incoming, length) => (Some(incoming), length),
            LongFrame::Unread(frame) => {
                let length = frame.len();
                if length > MEDIUM {
                    self.take_memory(memory).await;
                }
                (parse(length, move || frame).await?, length)
            }
        };
        let Some(Incoming { id, op }) = incoming else {
            return Ok(None);
        };
        let is_published = matches!(op, Ok(Op::Publish { .. } | Op::Fragment(_)));
        if length > SHORT && !is_published {
            self.take_memory(memory).await;
        }
        let Ok(Op::Fragment(piece)) = op else {
            return Ok(Some((Incoming { id, op }, length)));
        };
        if self.fragments.allocated() + length > SHORT {
            self.take_memory(memory).await;
        }
        let whole = match self.fragments.take(piece, Instant::now().into_std()) {
            Ok(Some(whole)) => whole,
            Ok(None) => return Ok(None),
            Err((why, start)) => {
                return Ok(Some((op::read_start(&start, &why).under_id(id), 0)));
            }
        };
        let length = whole.bytes();
        let join = move || RawFrame::of_message(whole.text().into_bytes());
        Ok(parse(length, join).await?.map(|whole| match whole.op {
            Ok(Op::Fragment(_)) => {
                let op = Err(Problem::NotAFrame(NESTED_FRAGMENT.to_owned()).into());
                (Incoming { id, op }, length)
            }
            Err(OpError::Status(Problem::NotAFrame(_))) => (whole.under_id(id), length),
            _ => (whole, length),
        }))
    }

    /// Takes the memory permit, unless the client has it.
    async fn take_memory(&mut self, memory: &Memory) {
        if self.permit.is_none() {
            self.hold(memory.long_frame().await);
        }
    }
}

/// Parses a frame of `length` bytes, or returns its error. Parses a long one on a worker thread.
async fn parse(
    length: usize,
    frame: impl FnOnce() -> RawFrame + Send + 'static,
) -> Result<Option<Incoming>, &'static str> {
    let parse = move || op::read_raw(frame());
    if length <= SHORT_WORK {
        return Ok(parse());
    }
    let parsed = run_long_work(WorkKind::of(length), parse).await;
    parsed.ok_or("a frame could not be read")
}

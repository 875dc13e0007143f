//! A client that waits for an answer.
//!
//! **Invariant:** the thread that writes the answer also reports errors.

use bytes::Bytes;

use super::caller::Caller;
use crate::actors::ConnectionId;
use crate::actors::node::{Asker, Done, Pieces, Unserved};
use crate::actors::resources::memory::NoRoom;
use crate::services::{Address, ResponseWriter};

/// A client that waits for a `T`.
pub(super) struct ClientAsker<T> {
    pub(super) caller: Caller,
    pub(super) form: AnswerForm<T>,
}

/// The writer of an answer.
pub(super) enum AnswerForm<T> {
    /// At once, by the registry.
    Short(fn(T, &Address) -> Bytes),
    /// In pieces.
    Long(fn(T, &Address) -> Box<dyn ResponseWriter>),
}

impl<T> AnswerForm<T> {
    fn begin(&self, answer: T, to: &Address) -> Box<dyn ResponseWriter> {
        match self {
            Self::Short(write) => Box::new(Some(write(answer, to))),
            Self::Long(begin) => begin(answer, to),
        }
    }
}

impl<T: Send + 'static> Asker<T> for ClientAsker<T> {
    fn answer(self: Box<Self>, answer: Result<T, Unserved>, done: Option<Done>) {
        let Self { caller, form } = *self;
        caller.conclude(done, move |address| match answer {
            Ok(answer) => {
                let mut writer = form.begin(answer, address);
                loop {
                    if let Some(frame) = writer.advance() {
                        return frame;
                    }
                }
            }
            Err(why) => address.failure(&why.to_string()),
        });
    }

    fn answer_in_pieces(self: Box<Self>, answer: T) -> Box<dyn Pieces> {
        let Self { caller, form } = *self;
        let writer = caller.address.as_ref().map(|to| form.begin(answer, to));
        Box::new(Writing { caller, writer })
    }

    fn client(&self) -> Option<ConnectionId> {
        Some(self.caller.connection())
    }

    fn is_gone(&self) -> bool {
        self.caller.is_gone()
    }

    fn warn(&self, why: &str) {
        self.caller.warn(why);
    }

    fn reserve(&mut self, bytes: usize) -> Result<(), NoRoom> {
        self.caller.reserve(bytes)
    }
}

/// A response that is being written.
struct Writing {
    caller: Caller,
    /// `None` once the response has been sent.
    writer: Option<Box<dyn ResponseWriter>>,
}

impl Pieces for Writing {
    fn advance(&mut self) -> bool {
        if let Some(writer) = &mut self.writer {
            let Some(frame) = writer.advance() else {
                return false;
            };
            self.writer = None;
            self.caller.answer_at_once(|_| frame);
        }
        true
    }

    fn refuse(&mut self, why: Unserved) {
        self.writer = None;
        self.caller
            .answer_at_once(|address| address.failure(&why.to_string()));
    }

    fn is_gone(&self) -> bool {
        self.caller.is_gone()
    }
}

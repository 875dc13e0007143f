//! Clients that have asked: each waits for an answer, which is written for it.
//!
//! **Invariant:** errors are reported by the thread that would have written the answer.

use std::marker::PhantomData;

use bytes::Bytes;

use super::caller::Caller;
use crate::actors::ConnectionId;
use crate::actors::node::{Asker, Done, Pieces, Unserved};
use crate::actors::resources::memory::NoRoom;
use crate::services::{Address, Answered, Streamed};

/// A client that has asked `A`.
pub(super) struct ClientAsker<A> {
    caller: Caller,
    question: PhantomData<fn(A)>,
}

impl<A> ClientAsker<A> {
    pub(super) fn new(caller: Caller) -> Self {
        let question = PhantomData;
        Self { caller, question }
    }

    fn answer<T: Send + 'static>(
        self,
        answer: Result<T, Unserved>,
        done: Option<Done>,
        write: impl FnOnce(T, &Address) -> Bytes + Send + 'static,
    ) {
        self.caller.conclude(done, move |address| match answer {
            Ok(answer) => write(answer, address),
            Err(why) => address.failure(&why.to_string()),
        });
    }
}

impl<A: Answered> Asker<A::Answer> for ClientAsker<A> {
    fn answer(self: Box<Self>, answer: Result<A::Answer, Unserved>, done: Option<Done>) {
        ClientAsker::answer(*self, answer, done, A::write);
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

/// The same where the answer may be long.
pub(super) struct PatientAsker<A>(ClientAsker<A>);

impl<A> PatientAsker<A> {
    pub(super) fn new(caller: Caller) -> Self {
        Self(ClientAsker::new(caller))
    }
}

impl<A: Streamed> Asker<A::Answer> for PatientAsker<A> {
    fn answer(self: Box<Self>, answer: Result<A::Answer, Unserved>, done: Option<Done>) {
        self.0.answer(answer, done, |answer, to| {
            let mut writer = A::begin(answer, to);
            loop {
                if let Some(frame) = A::advance(&mut writer) {
                    return frame;
                }
            }
        });
    }

    fn answer_in_pieces(self: Box<Self>, answer: A::Answer) -> Box<dyn Pieces> {
        let caller = self.0.caller;
        let writer = caller.address.as_ref().map(|to| A::begin(answer, to));
        Box::new(Writing::<A> { caller, writer })
    }

    fn client(&self) -> Option<ConnectionId> {
        Some(self.0.caller.connection())
    }

    fn is_gone(&self) -> bool {
        self.0.caller.is_gone()
    }

    fn reserve(&mut self, bytes: usize) -> Result<(), NoRoom> {
        self.0.caller.reserve(bytes)
    }
}

/// A response that is being written.
struct Writing<A: Streamed> {
    caller: Caller,
    /// None once the response is on its way.
    writer: Option<A::Writer>,
}

impl<A: Streamed> Pieces for Writing<A> {
    fn advance(&mut self) -> bool {
        if let Some(writer) = &mut self.writer {
            let Some(frame) = A::advance(writer) else {
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

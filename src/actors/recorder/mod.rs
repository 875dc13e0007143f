//! `/recorder/*` and `--record`: receives events of the registry and the arm. A thread writes them.
//!
//! **Invariant:** there is one record at a time. Without one, arm and registry send no events.

pub mod limits;
pub mod listeners;
mod requests;
mod tape;

use std::fs;
use std::path::{Path, PathBuf};

use actix::prelude::*;
use tokio::sync::oneshot;

use self::limits::MAX_RECORD_BYTES;
pub use self::requests::{NotRecorded, RecordTo, Recorded, StartRecording, StopRecording};
use self::tape::{Begun, TapeClock, TapeTarget};
use crate::actors::arm::sim::SetListener;
use crate::actors::node::SetTap;
use crate::actors::node::{Call, Nodes};
use crate::protocol::catalog::Service;
use crate::record::RunSettings;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `recorder` beside an arm of `N` links.
pub struct Recorder<const N: usize> {
    arm: Recipient<SetListener<N>>,
    registry: Recipient<SetTap>,
    /// Folder for clients' records.
    folder: Option<PathBuf>,
    settings: RunSettings,
    current: Option<Current>,
    /// The number of records so far. The end of a record does not concern the next one.
    begun: u64,
}

/// The record that is being written.
struct Current {
    file: String,
    number: u64,
    /// Whether a client has started it. Only then may a client end it.
    by_client: bool,
    end: oneshot::Receiver<Recorded>,
}

impl<const N: usize> Recorder<N> {
    /// A recorder without a record. Clients may record into `folder`, if there is one.
    #[must_use]
    pub fn new(
        arm: Recipient<SetListener<N>>,
        registry: Recipient<SetTap>,
        folder: Option<PathBuf>,
        seed: u64,
    ) -> Self {
        Self {
            arm,
            registry,
            folder,
            settings: RunSettings { links: N, seed },
            current: None,
            begun: 0,
        }
    }

    /// Adds this node's services to the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes.serve::<StartRecording>(Service::RecorderStart, address.clone());
        nodes.serve::<StopRecording>(Service::RecorderStop, address.clone());
    }

    /// Starts a record, unless there is one.
    fn begin(
        &mut self,
        target: TapeTarget,
        ctx: &mut Context<Self>,
    ) -> impl ActorFuture<Self, Output = Result<(), NotRecorded>> + use<N> {
        self.begun += 1;
        let number = self.begun;
        let file = tape::file_name(&target.path);
        let by_client = target.limit.is_some();
        let already = self.current.as_ref().map(|current| current.file.clone());
        let begun = already.is_none().then(|| {
            let address = ctx.address();
            let ended = move || address.do_send(RecordEnded(number));
            tape::begin(target, self.settings.clone(), ended)
        });
        let (arm, registry) = (self.arm.clone(), self.registry.clone());
        let name = file.clone();
        let begins = async move {
            let Some(begun) = begun else {
                return Err(NotRecorded::Already(already.unwrap_or_default()));
            };
            let no_thread = |_| NotRecorded::File {
                file: name,
                why: "there is no thread to write it".to_owned(),
            };
            let Begun { tape, end } = begun.await.map_err(no_thread)??;
            // Both exist as long as the program.
            let of_arm = tape.clone();
            let listener = listeners::arm(move |content| of_arm.put(content));
            let _ = arm.send(SetListener(Some(listener))).await;
            let tap = listeners::registry(move |content| {
                // A replay needs none of these messages.
                let _ = tape.put_or_count(content);
            });
            let _ = registry.send(SetTap(Some(tap))).await;
            Ok(end)
        };
        begins.into_actor(self).map(move |begun, recorder, _| {
            let end = begun?;
            tracing::info!(file, "recording");
            recorder.current = Some(Current {
                file,
                number,
                by_client,
                end,
            });
            Ok(())
        })
    }

    /// Ends the record, and waits until its file is complete; `None` if there is no record.
    fn end(&mut self) -> impl ActorFuture<Self, Output = Option<Recorded>> + use<N> {
        let current = self.current.take();
        let (arm, registry) = (self.arm.clone(), self.registry.clone());
        let ends = async move {
            let current = current?;
            // Each drops its tape. After the last one the thread ends the file.
            let _ = arm.send(SetListener(None)).await;
            let _ = registry.send(SetTap(None)).await;
            let recorded = current.end.await.ok()?;
            tracing::info!(
                file = recorded.file,
                messages = recorded.messages,
                dropped = recorded.dropped,
                "recorded"
            );
            Some(recorded)
        };
        ends.into_actor(self)
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// A record has ended by itself. From its thread.
#[derive(Message)]
#[rtype(result = "()")]
struct RecordEnded(u64);

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for Recorder<N> {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<Call<StartRecording>> for Recorder<N> {
    type Result = ();

    fn handle(&mut self, call: Call<StartRecording>, ctx: &mut Context<Self>) {
        let Call { ask, mut reply } = call;
        let Some(folder) = &self.folder else {
            return reply.answer(Err(NotRecorded::NoFolder));
        };
        let (name, target) = destination(folder, ask.name);
        let begun = self.begin(target, ctx);
        ctx.wait(begun.map(move |begun, _, _| reply.answer(begun.map(|()| name))));
    }
}

impl<const N: usize> Handler<Call<StopRecording>> for Recorder<N> {
    type Result = ();

    fn handle(&mut self, call: Call<StopRecording>, ctx: &mut Context<Self>) {
        let mut reply = call.reply;
        if self.folder.is_none() {
            return reply.answer(Err(NotRecorded::NoFolder));
        }
        if let Some(current) = self.current.as_ref().filter(|one| !one.by_client) {
            return reply.answer(Err(NotRecorded::Operators(current.file.clone())));
        }
        let ended = self.end();
        ctx.wait(ended.map(move |ended, _, _| reply.answer(ended.ok_or(NotRecorded::Nothing))));
    }
}

impl<const N: usize> Handler<RecordTo> for Recorder<N> {
    type Result = ResponseActFuture<Self, Result<(), NotRecorded>>;

    fn handle(&mut self, RecordTo(path): RecordTo, ctx: &mut Context<Self>) -> Self::Result {
        let limit = None;
        match path {
            Some(path) => Box::pin(self.begin(TapeTarget { path, limit }, ctx)),
            None => Box::pin(self.end().map(|_, _, _| Ok(()))),
        }
    }
}

impl<const N: usize> Handler<RecordEnded> for Recorder<N> {
    type Result = ();

    fn handle(&mut self, RecordEnded(number): RecordEnded, ctx: &mut Context<Self>) {
        let current = self.current.as_ref();
        if current.is_some_and(|one| one.number == number) {
            ctx.wait(self.end().map(|_, _, _| ()));
        }
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

/// Checks the folder for clients' records, as before each record.
///
/// # Errors
/// The system's error, if it is not a folder.
pub fn check_folder(folder: &Path) -> Result<(), NotRecorded> {
    fs::read_dir(folder)
        .map(drop)
        .map_err(|why| NotRecorded::File {
            file: folder.display().to_string(),
            why: why.to_string(),
        })
}

/// The destination of a client's record with its file's name.
fn destination(folder: &Path, name: Option<String>) -> (String, TapeTarget) {
    let made_up = || format!("run-{}", TapeClock::start().now());
    let mut name = name.unwrap_or_else(made_up);
    if !name.ends_with(".mcap") {
        name.push_str(".mcap");
    }
    let target = TapeTarget {
        path: folder.join(&name),
        limit: Some(MAX_RECORD_BYTES),
    };
    (name, target)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clients_record_lies_in_the_folder_and_is_bounded() {
        for name in ["a", "a.mcap"] {
            let (name, target) = destination(Path::new("runs"), Some(name.to_owned()));
            assert_eq!(name, "a.mcap");
            assert_eq!(target.path, Path::new("runs/a.mcap"));
            assert_eq!(target.limit, Some(MAX_RECORD_BYTES));
        }
        let (name, _) = destination(Path::new("runs"), None);
        assert!(
            name.starts_with("run-") && name.ends_with(".mcap"),
            "{name}"
        );
    }
}

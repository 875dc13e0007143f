//! Takes the recorded steps again and compares every recorded state, bit for bit.
//!
//! **Invariant:** where inputs were lost the record begins again with the whole simulation. Nothing is compared across
//! such a gap, and gaps are counted. A record can't have more steps than the time that it covers has room for.

use std::fmt;
use std::io::Read;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::journal::{Note, NoteError, links, read_note};
use super::reader::{ReadError, RecordEnding, RecordedMessage, Recording};
use super::schema::{INPUTS, STATES};
use super::writer::VERSION;
use crate::math::simulation::Simulation;
use crate::protocol::wire::text::excerpt;

/// Steps between two messages of a record, at most. A tick has a tenth of that on the fastest machine, so that a record
/// whose file was slow for a while is not refused.
pub const MAX_LEAP: u64 = 10_000_000;
/// The least time that a step takes, in nanoseconds: no machine was seen to take one in less than three times that.
const SHORTEST_STEP: u64 = 10;
/// Steps for which a record needs no time, so that a coarse clock does no harm.
pub const AT_ONCE: u64 = 100_000;

/// Longest version that is told, in characters.
const MAX_VERSION: usize = 64;

/// The outcome of a replay.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReplayVerdict {
    /// How many links the arm has.
    pub links: usize,
    /// Steps that were taken again.
    pub steps: u64,
    /// States that were compared.
    pub states: u64,
    /// Inputs that took effect again.
    pub inputs: u64,
    /// Gaps in the inputs, because the queue was full. The record began again after each.
    pub losses: u64,
    /// The last step whose state was the same, or at which the record began.
    pub agreed_to: u64,
    /// The first difference; the replay ends there.
    pub difference: Option<Difference>,
    /// How the file ended, if it was read to its end.
    pub ending: Option<RecordEnding>,
    /// The version that wrote the record, if it is not this one.
    pub other_version: Option<String>,
}

/// The first place at which the steps differ from the record.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// Steps since the record's first; resets do not set it back.
    pub step: u64,
    /// Simulation time there \[s\].
    pub time: f64,
    /// The values that differ.
    pub what: String,
}

/// Why there is nothing to compare.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A text that is no input.
    #[error("input before step {step}: {why}")]
    Input {
        /// Steps before it.
        step: u64,
        /// The fault.
        why: NoteError,
    },
    /// A message that lacks a field.
    #[error("{}: a message is not as this version writes it", excerpt(.0))]
    Shape(
        /// The channel's topic.
        String,
    ),
    /// The file ends before a state of the arm.
    #[error("the record was cut before its first state")]
    FramePart,
    /// There is no input, or no state behind one.
    #[error("nothing to compare: it has no states of an arm")]
    NoStates,
    /// More steps than the arm can have taken.
    #[error(
        "{}, message {sequence}: step {step} is {due} steps after the one before, \
         and no arm takes more than {most} there",
        excerpt(topic)
    )]
    Leap {
        /// The channel's topic.
        topic: String,
        /// The message's number on it, from 1.
        sequence: u32,
        /// The step.
        step: u64,
        /// Steps since the message before.
        due: u64,
        /// The most steps that there was time for.
        most: u64,
    },
    /// Steps that run backwards.
    #[error("step {step} comes after step {after}")]
    Order {
        /// The step.
        step: u64,
        /// The step of the message before.
        after: u64,
    },
}

impl fmt::Display for ReplayVerdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (links, steps) = (self.links, self.steps);
        let (inputs, states) = (self.inputs, self.states);
        write!(
            f,
            "{links} links, {steps} steps, {inputs} inputs, {states} states"
        )?;
        match &self.difference {
            None => write!(f, ": the same, bit for bit")?,
            Some(Difference { step, time, what }) => {
                let same = self.agreed_to;
                write!(
                    f,
                    ": the same up to step {same}, and at step {step} (t = {time:?} s) not: {what}"
                )?;
            }
        }
        if self.losses > 0 {
            let gaps = self.losses;
            write!(f, "; {gaps} gaps in the record were left out")?;
        }
        if self.ending == Some(RecordEnding::FramePart) {
            write!(f, "; the file ends early, and was read up to there")?;
        }
        if let Some(version) = &self.other_version {
            write!(
                f,
                "; note: recorded by version {version:?}, and this is {VERSION:?}"
            )?;
        }
        Ok(())
    }
}

/// Replays a record.
///
/// # Errors
/// If the file can't be read, or holds nothing to compare.
pub fn replay(file: impl Read) -> Result<ReplayVerdict, ReplayError> {
    let mut recording = Recording::new(file);
    let first = first_input(&mut recording)?;
    match links(&fields::<InputMessage>(&first)?.input) {
        Some(2) => play::<2>(recording, first),
        Some(3) => play::<3>(recording, first),
        _ => Err(ReplayError::NoStates),
    }
}

/// Why there is no state in a record that ends so.
fn no_states(ending: Option<RecordEnding>) -> ReplayError {
    match ending {
        Some(RecordEnding::FramePart) => ReplayError::FramePart,
        _ => ReplayError::NoStates,
    }
}

fn first_input(recording: &mut Recording<impl Read>) -> Result<RecordedMessage, ReplayError> {
    loop {
        match recording.next_passage()? {
            Some(passage) if passage.topic == INPUTS => return Ok(passage),
            Some(_) => {}
            None => return Err(no_states(recording.ending())),
        }
    }
}

fn play<const N: usize>(
    mut recording: Recording<impl Read>,
    first: RecordedMessage,
) -> Result<ReplayVerdict, ReplayError> {
    let mut run = Replay::<N> {
        arm: None,
        began: 0,
        taken: 0,
        verdict: ReplayVerdict {
            links: N,
            other_version: recording
                .version()
                .filter(|version| *version != VERSION)
                .map(|version| version.chars().take(MAX_VERSION).collect()),
            ..ReplayVerdict::default()
        },
    };
    let mut next = Some(first);
    while let Some(passage) = next {
        run.take(&passage)?;
        if run.verdict.difference.is_some() {
            return Ok(run.verdict);
        }
        next = recording.next_passage()?;
    }
    run.verdict.ending = recording.ending();
    if run.verdict.states == 0 {
        return Err(no_states(run.verdict.ending));
    }
    Ok(run.verdict)
}

struct Replay<const N: usize> {
    /// The simulation, and the steps it has taken as the record counts them; none before the record begins.
    arm: Option<(Simulation<N>, u64)>,
    /// When the simulation was recorded as a whole, in nanoseconds since 1970.
    began: u64,
    /// Steps taken again since then.
    taken: u64,
    verdict: ReplayVerdict,
}

impl<const N: usize> Replay<N> {
    fn take(&mut self, passage: &RecordedMessage) -> Result<(), ReplayError> {
        match passage.topic.as_str() {
            INPUTS => self.input(passage),
            STATES => self.state(passage),
            _ => Ok(()),
        }
    }

    fn input(&mut self, passage: &RecordedMessage) -> Result<(), ReplayError> {
        let InputMessage { step, input } = fields(passage)?;
        let note = read_note(&input).map_err(|why| ReplayError::Input { step, why })?;
        if let Note::Begin(checkpoint) = note {
            self.verdict.losses += u64::from(self.arm.is_some());
            self.verdict.agreed_to = step;
            self.arm = Some((Simulation::continued(&checkpoint), step));
            self.began = passage.log_time;
            self.taken = 0;
            return Ok(());
        }
        if !self.advance(step, passage)? {
            return Ok(());
        }
        let Some((simulation, _)) = &mut self.arm else {
            return Ok(());
        };
        self.verdict.inputs += 1;
        match note {
            Note::Input(input) => simulation.apply(input),
            Note::Diverged if simulation.step() => {
                self.differs(step, "the step from here on was not finite, and is");
            }
            Note::Diverged | Note::Begin(_) => {}
        }
        Ok(())
    }

    fn state(&mut self, passage: &RecordedMessage) -> Result<(), ReplayError> {
        let recorded: StateMessage = fields(passage)?;
        let step = recorded.step;
        if !self.advance(step, passage)? {
            return Ok(());
        }
        let Some((simulation, _)) = &self.arm else {
            return Ok(());
        };
        let state = simulation.state();
        let mut unlike = Vec::new();
        for (name, recorded, ours) in [
            ("position", &recorded.position, &state.position),
            ("velocity", &recorded.velocity, &state.velocity),
            ("effort", &recorded.effort, simulation.effort()),
        ] {
            if recorded.len() != N {
                return Err(ReplayError::Shape(passage.topic.clone()));
            }
            for (joint, (recorded, ours)) in recorded.iter().zip(ours).enumerate() {
                // A number that is not finite is `null`.
                let recorded = recorded.unwrap_or(f64::NAN);
                if recorded.to_bits() != ours.to_bits() {
                    unlike.push(format!("{name}[{joint}] was {recorded:?} and is {ours:?}"));
                }
            }
        }
        self.verdict.states += 1;
        if unlike.is_empty() {
            self.verdict.agreed_to = step;
        } else {
            self.differs(step, &unlike.join(", "));
        }
        Ok(())
    }

    /// Takes the steps up to that one; false if there is nothing to compare there.
    fn advance(&mut self, step: u64, passage: &RecordedMessage) -> Result<bool, ReplayError> {
        let Some((simulation, at)) = &mut self.arm else {
            return Ok(false);
        };
        let due = step.checked_sub(*at);
        let due = due.ok_or(ReplayError::Order { step, after: *at })?;
        let since = passage.log_time.saturating_sub(self.began);
        let by_time = (since / SHORTEST_STEP).saturating_add(AT_ONCE);
        let most = MAX_LEAP.min(by_time.saturating_sub(self.taken));
        if due > most {
            return Err(ReplayError::Leap {
                topic: passage.topic.clone(),
                sequence: passage.sequence,
                step,
                due,
                most,
            });
        }
        let taken = simulation.advance(due);
        *at += taken;
        self.taken += taken;
        self.verdict.steps += taken;
        if taken < due {
            let at = *at;
            self.differs(at, "the step from here on was finite, and is not");
            return Ok(false);
        }
        Ok(true)
    }

    fn differs(&mut self, step: u64, what: &str) {
        let what = what.to_owned();
        let time = self.arm.as_ref().map_or(f64::NAN, |(arm, _)| arm.time());
        self.verdict.difference = Some(Difference { step, time, what });
    }
}

/// The fields of a message on the channel of inputs, and of one on that of states.
#[derive(Deserialize)]
struct InputMessage {
    step: u64,
    input: String,
}

#[derive(Deserialize)]
struct StateMessage {
    step: u64,
    position: Vec<Option<f64>>,
    velocity: Vec<Option<f64>>,
    effort: Vec<Option<f64>>,
}

fn fields<T: DeserializeOwned>(passage: &RecordedMessage) -> Result<T, ReplayError> {
    let fields = passage
        .msg
        .as_ref()
        .and_then(|msg| T::deserialize(msg).ok());
    fields.ok_or_else(|| ReplayError::Shape(passage.topic.clone()))
}

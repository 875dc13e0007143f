//! Repeats the recorded steps and compares every recorded state, bit for bit.
//!
//! **Invariant:** after a gap in the inputs the record has the whole simulation again. No comparison crosses a gap,
//! and gaps are counted. The number of steps is bounded by the recorded time.

use std::fmt;
use std::io::Read;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::journal::{NoteError, links_and_version, read_note};
use super::reader::{ReadError, RecordEnding, RecordedMessage, Recording};
use super::schema::{INPUTS, STATES};
use super::writer::VERSION;
use crate::math::simulation::{Simulation, StepNote};
use crate::protocol::wire::text::excerpt;

/// Most steps between two messages of a record. On the fastest machine a tick has a tenth of that, so a record with a
/// slow file is not refused.
pub const MAX_STEPS_BETWEEN_MESSAGES: u64 = 10_000_000;
/// Lower bound on the time of a step, in nanoseconds. On every measured machine a step takes at least three times that.
const SHORTEST_STEP: u64 = 10;
/// Steps that are always allowed, so a coarse clock has no effect.
pub const AT_ONCE: u64 = 100_000;

/// Longest reported version, in characters.
const MAX_VERSION: usize = 64;

/// The outcome of a replay.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReplayVerdict {
    /// The number of links.
    pub links: usize,
    /// Repeated steps.
    pub steps: u64,
    /// Compared states.
    pub states: u64,
    /// Applied inputs.
    pub inputs: u64,
    /// Gaps in the inputs, because the queue was full. The record restarts after each.
    pub losses: u64,
    /// The last step with an equal state, or the first step of the record.
    pub agreed_to: u64,
    /// The first difference, at which the replay ends.
    pub difference: Option<Difference>,
    /// How the file ended, if it was read to its end.
    pub ending: Option<RecordEnding>,
    /// Why the file could not be read to its end. The rest was not compared.
    pub fault: Option<String>,
    /// The version that wrote the record, if it is another one.
    pub other_version: Option<String>,
}

/// The first step that differs from the record.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// Steps since the record's first. A reset does not restart the count.
    pub step: u64,
    /// Its simulation time \[s\].
    pub time: f64,
    /// The different values.
    pub what: String,
}

/// Why a record cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A text that is not a valid input.
    #[error("input before step {step}: {why}")]
    Input {
        /// Steps before it.
        step: u64,
        /// The fault.
        why: NoteError,
    },
    /// A message with a missing field.
    #[error("{}: a message has other fields than in this version", excerpt(.0))]
    Shape(
        /// The channel's topic.
        String,
    ),
    /// The file ends before a state of the arm.
    #[error("the record was cut before its first state")]
    Truncated,
    /// There is no input, or no state after one.
    #[error("nothing to compare: it has no states of an arm")]
    NoStates,
    /// More steps than possible in the recorded time.
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
        /// Steps since the previous message.
        due: u64,
        /// The most steps possible in this time.
        most: u64,
    },
    /// A step number smaller than the one before.
    #[error("step {step} comes after step {after}")]
    Order {
        /// The step.
        step: u64,
        /// The step of the previous message.
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
        if self.ending == Some(RecordEnding::Truncated) {
            write!(f, "; the file ends early, and was read up to there")?;
        }
        if let Some(why) = &self.fault {
            write!(f, "; the file was read up to a fault: {why}")?;
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
/// If the file cannot be read, or has nothing to compare.
pub fn replay(file: impl Read) -> Result<ReplayVerdict, ReplayError> {
    let mut recording = Recording::new(file);
    let first = first_input(&mut recording)?;
    let begun = links_and_version(&fields::<InputMessage>(&first)?.input);
    let mut verdict = match begun {
        Some((2, _)) => play::<2>(recording, first)?,
        Some((3, _)) => play::<3>(recording, first)?,
        _ => return Err(ReplayError::NoStates),
    };
    let version = begun.map(|(_, version)| version);
    let other = version.filter(|version| version != VERSION);
    verdict.other_version = other.map(|version| version.chars().take(MAX_VERSION).collect());
    Ok(verdict)
}

/// The error for a record without states, by its end.
fn no_states(ending: Option<RecordEnding>) -> ReplayError {
    match ending {
        Some(RecordEnding::Truncated) => ReplayError::Truncated,
        _ => ReplayError::NoStates,
    }
}

fn first_input(recording: &mut Recording<impl Read>) -> Result<RecordedMessage, ReplayError> {
    while let Some(passage) = recording.next_passage()? {
        if passage.topic == INPUTS {
            return Ok(passage);
        }
    }
    Err(no_states(recording.ending()))
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
            ..ReplayVerdict::default()
        },
    };
    let mut next = Some(first);
    while let Some(passage) = next {
        run.take(&passage)?;
        if run.verdict.difference.is_some() {
            return Ok(run.verdict);
        }
        next = match recording.next_passage() {
            Err(why) if run.verdict.states > 0 => {
                run.verdict.fault = Some(why.to_string());
                None
            }
            passage => passage?,
        };
    }
    run.verdict.ending = recording.ending();
    if run.verdict.states == 0 {
        return Err(no_states(run.verdict.ending));
    }
    Ok(run.verdict)
}

struct Replay<const N: usize> {
    /// The simulation and its number of steps in the record's count; `None` before the record begins.
    arm: Option<(Simulation<N>, u64)>,
    /// The time of the last whole simulation, in nanoseconds since 1970.
    began: u64,
    /// Repeated steps since then.
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
        if let StepNote::Begin(checkpoint) = note {
            self.verdict.losses += u64::from(self.arm.is_some());
            self.verdict.agreed_to = step;
            self.arm = Some((Simulation::continued(&checkpoint), step));
            self.began = passage.log_time;
            self.taken = 0;
            return Ok(());
        }
        let Some(simulation) = self.advance(step, passage)? else {
            return Ok(());
        };
        match note {
            StepNote::Input(input) => simulation.apply(input),
            StepNote::Diverged if simulation.step() => {
                self.differs(
                    step,
                    "the next step was not finite in the record, but is finite now",
                );
            }
            StepNote::Diverged | StepNote::Begin(_) => {}
        }
        self.verdict.inputs += 1;
        Ok(())
    }

    fn state(&mut self, passage: &RecordedMessage) -> Result<(), ReplayError> {
        let recorded: StateMessage = fields(passage)?;
        let step = recorded.step;
        let Some(simulation) = self.advance(step, passage)? else {
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

    /// Takes the steps up to that one. Returns the simulation, unless nothing can be compared there.
    fn advance(
        &mut self,
        step: u64,
        passage: &RecordedMessage,
    ) -> Result<Option<&mut Simulation<N>>, ReplayError> {
        let Some((simulation, at)) = &mut self.arm else {
            return Ok(None);
        };
        let due = step.checked_sub(*at);
        let due = due.ok_or(ReplayError::Order { step, after: *at })?;
        let since = passage.log_time.saturating_sub(self.began);
        let by_time = (since / SHORTEST_STEP).saturating_add(AT_ONCE);
        let most = MAX_STEPS_BETWEEN_MESSAGES.min(by_time.saturating_sub(self.taken));
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
            self.differs(
                at,
                "the next step was finite in the record, but is not finite now",
            );
            return Ok(None);
        }
        Ok(self.arm.as_mut().map(|(simulation, _)| simulation))
    }

    fn differs(&mut self, step: u64, what: &str) {
        let what = what.to_owned();
        let time = self.arm.as_ref().map_or(f64::NAN, |(arm, _)| arm.time());
        self.verdict.difference = Some(Difference { step, time, what });
    }
}

/// The fields of a message of inputs, and of a message of states.
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

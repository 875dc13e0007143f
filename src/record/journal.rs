//! Inputs to the arm as text: one JSON value each. Its numbers are read back bit for bit.
//!
//! **Invariant:** finite numbers are read back unchanged. A note that does not fit the arm is refused.

use serde::{Deserialize, Serialize};

use crate::math::arm::{Arm, ArmError, State};
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};
use crate::math::simulation::{ArmInput, Checkpoint, ControlPeriod, Held};
use crate::protocol::wire::text::{excerpt, shortened};

/// Longest message of the parser \[characters\]. It may quote the file.
const MAX_WORDS: usize = 200;

/// An input of the arm's steps.
#[derive(Debug, Clone, PartialEq)]
pub enum Note<const N: usize> {
    /// The whole simulation, at the start of the record and after a gap.
    Begin(Box<Checkpoint<N>>),
    /// An external change.
    Input(ArmInput<N>),
    /// The next step was not finite and was not taken.
    Diverged,
}

/// Why a text is not a note.
#[derive(Debug, thiserror::Error)]
pub enum NoteError {
    /// Not the JSON of a note.
    #[error("not an input: {}", shortened(&.0.to_string(), MAX_WORDS))]
    Text(#[from] serde_json::Error),
    /// A field, and the rule for it.
    #[error("{0} must {1}")]
    Field(&'static str, &'static str),
    /// No method of that name.
    #[error("unknown method {:?}", excerpt(.0))]
    Method(
        /// The name.
        String,
    ),
    /// The arm is not valid.
    #[error(transparent)]
    Arm(#[from] ArmError),
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Written {
    Begin(Box<WrittenCheckpoint>),
    Method(String),
    Timestep(f64),
    Params(WrittenArm),
    Gains(WrittenGains),
    Enable(bool),
    Setpoint(WrittenState),
    Disturb { effort: Vec<f64>, duration: f64 },
    Period(WrittenPeriod),
    State(WrittenState),
    Command(Vec<f64>),
    Drive(Option<Vec<f64>>),
    Reset,
    Diverged,
}

#[derive(Serialize, Deserialize)]
struct WrittenArm {
    gravity: f64,
    masses: Vec<f64>,
    lengths: Vec<f64>,
}

#[derive(Serialize, Deserialize)]
struct WrittenGains {
    kp: Vec<f64>,
    ki: Vec<f64>,
    kd: Vec<f64>,
}

#[derive(Serialize, Deserialize)]
struct WrittenState {
    position: Vec<f64>,
    velocity: Vec<f64>,
}

#[derive(Serialize, Deserialize, Clone, Copy)]
struct WrittenPeriod {
    period: f64,
    delay: bool,
}

#[derive(Serialize, Deserialize)]
struct WrittenHeld {
    period: WrittenPeriod,
    due: u64,
    effort: Vec<f64>,
    computed: Vec<f64>,
    command: Vec<f64>,
    driven: Option<Vec<f64>>,
}

#[derive(Serialize, Deserialize)]
struct WrittenCheckpoint {
    links: usize,
    params: WrittenArm,
    gains: WrittenGains,
    setpoint: WrittenState,
    integral: Vec<f64>,
    enabled: bool,
    #[serde(default)]
    held: Option<WrittenHeld>,
    method: String,
    timestep: f64,
    state: WrittenState,
    carry: WrittenState,
    effort: Vec<f64>,
    disturbance: Option<(Vec<f64>, f64)>,
    base: f64,
    steps_since_base: u64,
    steps: u64,
    divergence: Option<(u64, f64)>,
}

/// The note as text.
#[must_use]
pub fn write_note<const N: usize>(note: &Note<N>) -> String {
    let written = match note {
        Note::Begin(checkpoint) => Written::Begin(Box::new(checkpoint.as_ref().into())),
        Note::Diverged => Written::Diverged,
        Note::Input(input) => match input {
            ArmInput::Method(method) => Written::Method(method.name().to_owned()),
            ArmInput::Timestep(timestep) => Written::Timestep(*timestep),
            ArmInput::Arm(arm) => Written::Params(arm.into()),
            ArmInput::Gains(gains) => Written::Gains(gains.into()),
            ArmInput::Enabled(on) => Written::Enable(*on),
            ArmInput::Setpoint(setpoint) => Written::Setpoint(setpoint.into()),
            ArmInput::Disturbance { effort, duration } => Written::Disturb {
                effort: effort.to_vec(),
                duration: *duration,
            },
            ArmInput::Period(period) => Written::Period((*period).into()),
            ArmInput::State(state) => Written::State(state.into()),
            ArmInput::Command(effort) => Written::Command(effort.to_vec()),
            ArmInput::Drive(effort) => Written::Drive(effort.map(|effort| effort.to_vec())),
            ArmInput::Reset => Written::Reset,
        },
    };
    serde_json::to_string(&written).unwrap_or_default()
}

/// The number of links in a note with the whole simulation; `None` for any other note.
#[must_use]
pub fn links(note: &str) -> Option<usize> {
    match serde_json::from_str(note) {
        Ok(Written::Begin(checkpoint)) => Some(checkpoint.links),
        _ => None,
    }
}

/// Reads a note.
///
/// # Errors
/// If it is not a note, or not for an arm of `N` links.
pub fn read_note<const N: usize>(note: &str) -> Result<Note<N>, NoteError> {
    let input = match serde_json::from_str(note)? {
        Written::Begin(checkpoint) => return Ok(Note::Begin(Box::new(checkpoint.read()?))),
        Written::Diverged => return Ok(Note::Diverged),
        Written::Method(name) => ArmInput::Method(method(name)?),
        Written::Timestep(timestep) => ArmInput::Timestep(checked(timestep)?),
        Written::Params(arm) => ArmInput::Arm(arm.read()?),
        Written::Gains(gains) => ArmInput::Gains(gains.read()?),
        Written::Enable(on) => ArmInput::Enabled(on),
        Written::Setpoint(setpoint) => ArmInput::Setpoint(setpoint.setpoint()?),
        Written::Disturb { effort, duration } => ArmInput::Disturbance {
            effort: array("effort", &effort)?,
            duration,
        },
        Written::Period(period) => ArmInput::Period(period.read()?),
        Written::State(state) => ArmInput::State(state.state()?),
        Written::Command(effort) => ArmInput::Command(array("command", &effort)?),
        Written::Drive(effort) => {
            ArmInput::Drive(effort.map(|one| array("drive", &one)).transpose()?)
        }
        Written::Reset => ArmInput::Reset,
    };
    Ok(Note::Input(input))
}

fn array<const N: usize>(field: &'static str, values: &[f64]) -> Result<[f64; N], NoteError> {
    let why = NoteError::Field(field, "have one number per joint");
    values.try_into().map_err(|_| why)
}

fn method(name: String) -> Result<Method, NoteError> {
    let found = Method::ALL.into_iter().find(|one| one.name() == name);
    found.ok_or(NoteError::Method(name))
}

/// A number of steps, which must be exact as a `float64`. A run takes years to exceed that.
fn counted(field: &'static str, steps: u64) -> Result<u64, NoteError> {
    const MOST: u64 = 1 << 53;
    let why = NoteError::Field(field, "be at most 2^53");
    (steps <= MOST).then_some(steps).ok_or(why)
}

fn checked(timestep: f64) -> Result<f64, NoteError> {
    let valid = timestep.is_finite() && timestep > 0.0;
    let why = NoteError::Field("the timestep", "be greater than 0");
    valid.then_some(timestep).ok_or(why)
}

impl From<ControlPeriod> for WrittenPeriod {
    fn from(ControlPeriod { period, delay }: ControlPeriod) -> Self {
        Self { period, delay }
    }
}

impl WrittenPeriod {
    fn read(self) -> Result<ControlPeriod, NoteError> {
        let Self { period, delay } = self;
        let valid = period.is_finite() && period >= 0.0;
        let why = NoteError::Field("the control period", "not be negative");
        valid.then_some(ControlPeriod { period, delay }).ok_or(why)
    }
}

impl<const N: usize> From<&Held<N>> for WrittenHeld {
    fn from(held: &Held<N>) -> Self {
        Self {
            period: held.period.into(),
            due: held.due,
            effort: held.effort.to_vec(),
            computed: held.computed.to_vec(),
            command: held.command.to_vec(),
            driven: held.driven.map(|effort| effort.to_vec()),
        }
    }
}

impl WrittenHeld {
    fn read<const N: usize>(&self) -> Result<Held<N>, NoteError> {
        let driven = self.driven.as_ref().map(|one| array("driven", one));
        Ok(Held {
            period: self.period.read()?,
            due: counted("due", self.due)?,
            effort: array("effort", &self.effort)?,
            computed: array("computed", &self.computed)?,
            command: array("command", &self.command)?,
            driven: driven.transpose()?,
        })
    }
}

impl WrittenArm {
    fn read<const N: usize>(&self) -> Result<Arm<N>, NoteError> {
        let (lengths, masses) = (
            array("lengths", &self.lengths)?,
            array("masses", &self.masses)?,
        );
        Ok(Arm::new(lengths, masses, self.gravity)?)
    }
}

impl<const N: usize> From<&Arm<N>> for WrittenArm {
    fn from(arm: &Arm<N>) -> Self {
        Self {
            gravity: arm.gravity(),
            masses: arm.masses().to_vec(),
            lengths: arm.lengths().to_vec(),
        }
    }
}

impl WrittenGains {
    fn read<const N: usize>(&self) -> Result<Gains<N>, NoteError> {
        Ok(Gains {
            kp: array("kp", &self.kp)?,
            ki: array("ki", &self.ki)?,
            kd: array("kd", &self.kd)?,
        })
    }
}

impl<const N: usize> From<&Gains<N>> for WrittenGains {
    fn from(gains: &Gains<N>) -> Self {
        Self {
            kp: gains.kp.to_vec(),
            ki: gains.ki.to_vec(),
            kd: gains.kd.to_vec(),
        }
    }
}

impl WrittenState {
    fn state<const N: usize>(&self) -> Result<State<N>, NoteError> {
        Ok(State {
            position: array("position", &self.position)?,
            velocity: array("velocity", &self.velocity)?,
        })
    }

    fn setpoint<const N: usize>(&self) -> Result<Setpoint<N>, NoteError> {
        let State { position, velocity } = self.state()?;
        Ok(Setpoint { position, velocity })
    }
}

impl<const N: usize> From<&Setpoint<N>> for WrittenState {
    fn from(Setpoint { position, velocity }: &Setpoint<N>) -> Self {
        let (position, velocity) = (position.to_vec(), velocity.to_vec());
        Self { position, velocity }
    }
}

impl<const N: usize> From<&State<N>> for WrittenState {
    fn from(state: &State<N>) -> Self {
        Self {
            position: state.position.to_vec(),
            velocity: state.velocity.to_vec(),
        }
    }
}

impl<const N: usize> From<&Checkpoint<N>> for WrittenCheckpoint {
    fn from(from: &Checkpoint<N>) -> Self {
        let disturbance = from.disturbance.as_ref();
        Self {
            links: N,
            params: (&from.arm).into(),
            gains: (&from.gains).into(),
            setpoint: (&from.setpoint).into(),
            integral: from.integral.to_vec(),
            enabled: from.enabled,
            held: Some((&from.held).into()),
            method: from.method.name().to_owned(),
            timestep: from.timestep,
            state: (&from.state).into(),
            carry: (&from.carry).into(),
            effort: from.effort.to_vec(),
            disturbance: disturbance.map(|(effort, ends)| (effort.to_vec(), *ends)),
            base: from.base,
            steps_since_base: from.steps_since_base,
            steps: from.steps,
            divergence: from.divergence,
        }
    }
}

impl WrittenCheckpoint {
    fn read<const N: usize>(self) -> Result<Checkpoint<N>, NoteError> {
        let disturbance = match &self.disturbance {
            Some((effort, ends)) => Some((array("disturbance", effort)?, *ends)),
            None => None,
        };
        let held = match &self.held {
            Some(held) => held.read()?,
            None => Held::default(),
        };
        Ok(Checkpoint {
            arm: self.params.read()?,
            gains: self.gains.read()?,
            setpoint: self.setpoint.setpoint()?,
            integral: array("integral", &self.integral)?,
            enabled: self.enabled,
            held,
            method: method(self.method)?,
            timestep: checked(self.timestep)?,
            state: self.state.state()?,
            carry: self.carry.state()?,
            effort: array("effort", &self.effort)?,
            disturbance,
            base: self.base,
            steps_since_base: counted("steps_since_base", self.steps_since_base)?,
            steps: counted("steps", self.steps)?,
            divergence: self.divergence,
        })
    }
}

//! Inputs to the arm as text: one JSON value each. Its numbers are read back bit for bit.
//!
//! **Invariant:** finite numbers are read back unchanged. A note that does not fit the arm is refused.

use serde_json::{Value, json};

use crate::math::arm::{Arm, ArmError, State};
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};
use crate::math::simulation::{ArmInput, Checkpoint, ControlPeriod, Held};
use crate::protocol::wire::text::{excerpt, shortened};

/// Longest message of the parser \[characters\]. It may quote the file.
const MAX_WORDS: usize = 200;
/// Most steps of a record: all numbers up to this are exact as a `float64`. A run takes years to exceed it.
const MAX_STEPS: u64 = 1 << 53;

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
    /// Not JSON.
    #[error("not an input: {}", shortened(&.0.to_string(), MAX_WORDS))]
    Text(#[from] serde_json::Error),
    /// No input of that name.
    #[error("not an input: {:?}", excerpt(.0))]
    Kind(
        /// The name.
        String,
    ),
    /// A field, and the rule for it.
    #[error("{0} must {1}")]
    Field(&'static str, &'static str),
    /// The arm is not valid.
    #[error(transparent)]
    Arm(#[from] ArmError),
}

// ---- writing --------------------------------------------------------------------------------------------------------

/// The note as text.
#[must_use]
pub fn write_note<const N: usize>(note: &Note<N>) -> String {
    let written = match note {
        Note::Begin(checkpoint) => json!({"begin": write_checkpoint(checkpoint)}),
        Note::Diverged => json!("diverged"),
        Note::Input(input) => match input {
            ArmInput::Method(method) => json!({"method": method.name()}),
            ArmInput::Timestep(timestep) => json!({"timestep": timestep}),
            ArmInput::Arm(arm) => json!({"params": write_arm(arm)}),
            ArmInput::Gains(gains) => json!({"gains": write_gains(gains)}),
            ArmInput::Enabled(on) => json!({"enable": on}),
            ArmInput::Setpoint(Setpoint { position, velocity }) => {
                json!({"setpoint": write_motion(position, velocity)})
            }
            ArmInput::Disturbance { effort, duration } => {
                json!({"disturb": {"effort": effort.as_slice(), "duration": duration}})
            }
            ArmInput::Period(period) => json!({"period": write_period(period)}),
            ArmInput::State(state) => json!({"state": write_state(state)}),
            ArmInput::Command(effort) => json!({"command": effort.as_slice()}),
            ArmInput::Drive(effort) => json!({"drive": effort.as_ref().map(<[f64; N]>::as_slice)}),
            ArmInput::Reset => json!("reset"),
        },
    };
    written.to_string()
}

fn write_checkpoint<const N: usize>(from: &Checkpoint<N>) -> Value {
    let held = &from.held;
    let disturbance = from.disturbance.as_ref();
    json!({
        "links": N,
        "params": write_arm(&from.arm),
        "gains": write_gains(&from.gains),
        "setpoint": write_motion(&from.setpoint.position, &from.setpoint.velocity),
        "integral": from.integral.as_slice(),
        "enabled": from.enabled,
        "held": {
            "period": write_period(&held.period),
            "due": held.due,
            "effort": held.effort.as_slice(),
            "computed": held.computed.as_slice(),
            "command": held.command.as_slice(),
            "driven": held.driven.as_ref().map(<[f64; N]>::as_slice),
        },
        "method": from.method.name(),
        "timestep": from.timestep,
        "state": write_state(&from.state),
        "carry": write_state(&from.carry),
        "effort": from.effort.as_slice(),
        "disturbance": disturbance.map(|(effort, ends)| (effort.as_slice(), ends)),
        "base": from.base,
        "steps_since_base": from.steps_since_base,
        "steps": from.steps,
        "divergence": from.divergence,
    })
}

fn write_arm<const N: usize>(arm: &Arm<N>) -> Value {
    let (masses, lengths) = (arm.masses().as_slice(), arm.lengths().as_slice());
    json!({"gravity": arm.gravity(), "masses": masses, "lengths": lengths})
}

fn write_gains<const N: usize>(gains: &Gains<N>) -> Value {
    let [kp, ki, kd] = [&gains.kp, &gains.ki, &gains.kd].map(<[f64; N]>::as_slice);
    json!({"kp": kp, "ki": ki, "kd": kd})
}

fn write_period(ControlPeriod { period, delay }: &ControlPeriod) -> Value {
    json!({"period": period, "delay": delay})
}

fn write_state<const N: usize>(state: &State<N>) -> Value {
    write_motion(&state.position, &state.velocity)
}

fn write_motion(position: &[f64], velocity: &[f64]) -> Value {
    json!({"position": position, "velocity": velocity})
}

// ---- reading --------------------------------------------------------------------------------------------------------

/// The number of links in a note with the whole simulation; `None` for any other note.
#[must_use]
pub fn links(note: &str) -> Option<u64> {
    let note: Value = serde_json::from_str(note).ok()?;
    note.pointer("/begin/links")?.as_u64()
}

/// Reads a note.
///
/// # Errors
/// If it is not a note, or not for an arm of `N` links.
pub fn read_note<const N: usize>(note: &str) -> Result<Note<N>, NoteError> {
    let note: Value = serde_json::from_str(note)?;
    let members = note.as_object().filter(|members| members.len() == 1);
    let (kind, value) = match members.and_then(|members| members.iter().next()) {
        Some((kind, value)) => (kind.as_str(), value),
        None => (note.as_str().unwrap_or_default(), &Value::Null),
    };
    Ok(Note::Input(match kind {
        "begin" => return Ok(Note::Begin(Box::new(read_checkpoint(value)?))),
        "diverged" => return Ok(Note::Diverged),
        "method" => ArmInput::Method(read_method(value)?),
        "timestep" => ArmInput::Timestep(timestep(value)?),
        "params" => ArmInput::Arm(read_arm(value)?),
        "gains" => ArmInput::Gains(read_gains(value)?),
        "enable" => ArmInput::Enabled(flag("enable", value)?),
        "setpoint" => ArmInput::Setpoint(read_setpoint(value)?),
        "disturb" => ArmInput::Disturbance {
            effort: array("effort", &value["effort"])?,
            duration: number("duration", &value["duration"])?,
        },
        "period" => ArmInput::Period(read_period(value)?),
        "state" => ArmInput::State(read_state(value)?),
        "command" => ArmInput::Command(array("command", value)?),
        "drive" => ArmInput::Drive(optional(value, |value| array("drive", value))?),
        "reset" => ArmInput::Reset,
        other => return Err(NoteError::Kind(other.to_owned())),
    }))
}

fn read_checkpoint<const N: usize>(from: &Value) -> Result<Checkpoint<N>, NoteError> {
    let held = optional(&from["held"], read_held)?;
    Ok(Checkpoint {
        arm: read_arm(&from["params"])?,
        gains: read_gains(&from["gains"])?,
        setpoint: read_setpoint(&from["setpoint"])?,
        integral: array("integral", &from["integral"])?,
        enabled: flag("enabled", &from["enabled"])?,
        held: held.unwrap_or_default(),
        method: read_method(&from["method"])?,
        timestep: timestep(&from["timestep"])?,
        state: read_state(&from["state"])?,
        carry: read_state(&from["carry"])?,
        effort: array("effort", &from["effort"])?,
        disturbance: optional(&from["disturbance"], |one| {
            Ok((
                array("disturbance", &one[0])?,
                number("disturbance", &one[1])?,
            ))
        })?,
        base: number("base", &from["base"])?,
        steps_since_base: steps("steps_since_base", &from["steps_since_base"])?,
        steps: steps("steps", &from["steps"])?,
        divergence: optional(&from["divergence"], |one| {
            Ok((
                steps("divergence", &one[0])?,
                number("divergence", &one[1])?,
            ))
        })?,
    })
}

fn read_held<const N: usize>(from: &Value) -> Result<Held<N>, NoteError> {
    Ok(Held {
        period: read_period(&from["period"])?,
        due: steps("due", &from["due"])?,
        effort: array("effort", &from["effort"])?,
        computed: array("computed", &from["computed"])?,
        command: array("command", &from["command"])?,
        driven: optional(&from["driven"], |value| array("driven", value))?,
    })
}

fn read_arm<const N: usize>(from: &Value) -> Result<Arm<N>, NoteError> {
    let lengths = array("lengths", &from["lengths"])?;
    let masses = array("masses", &from["masses"])?;
    Ok(Arm::new(
        lengths,
        masses,
        number("gravity", &from["gravity"])?,
    )?)
}

fn read_gains<const N: usize>(from: &Value) -> Result<Gains<N>, NoteError> {
    Ok(Gains {
        kp: array("kp", &from["kp"])?,
        ki: array("ki", &from["ki"])?,
        kd: array("kd", &from["kd"])?,
    })
}

fn read_period(from: &Value) -> Result<ControlPeriod, NoteError> {
    let period = number("period", &from["period"])?;
    let delay = flag("delay", &from["delay"])?;
    let why = NoteError::Field("the control period", "not be negative");
    (period >= 0.0)
        .then_some(ControlPeriod { period, delay })
        .ok_or(why)
}

fn read_state<const N: usize>(from: &Value) -> Result<State<N>, NoteError> {
    Ok(State {
        position: array("position", &from["position"])?,
        velocity: array("velocity", &from["velocity"])?,
    })
}

fn read_setpoint<const N: usize>(from: &Value) -> Result<Setpoint<N>, NoteError> {
    let State { position, velocity } = read_state(from)?;
    Ok(Setpoint { position, velocity })
}

fn read_method(from: &Value) -> Result<Method, NoteError> {
    let found = Method::ALL.into_iter().find(|one| *from == one.name());
    found.ok_or(NoteError::Field("method", "be the name of a method"))
}

/// The value, if it is not `null`.
fn optional<T>(
    value: &Value,
    read: impl FnOnce(&Value) -> Result<T, NoteError>,
) -> Result<Option<T>, NoteError> {
    Some(value)
        .filter(|value| !value.is_null())
        .map(read)
        .transpose()
}

fn array<const N: usize>(name: &'static str, values: &Value) -> Result<[f64; N], NoteError> {
    let values = values.as_array().and_then(|values| {
        let numbers = values.iter().map(Value::as_f64);
        numbers.collect::<Option<Vec<_>>>()?.try_into().ok()
    });
    values.ok_or(NoteError::Field(name, "have one number per joint"))
}

fn number(name: &'static str, value: &Value) -> Result<f64, NoteError> {
    value.as_f64().ok_or(NoteError::Field(name, "be a number"))
}

fn flag(name: &'static str, value: &Value) -> Result<bool, NoteError> {
    value
        .as_bool()
        .ok_or(NoteError::Field(name, "be true or false"))
}

fn timestep(value: &Value) -> Result<f64, NoteError> {
    let timestep = value.as_f64().filter(|timestep| *timestep > 0.0);
    timestep.ok_or(NoteError::Field("the timestep", "be greater than 0"))
}

fn steps(name: &'static str, value: &Value) -> Result<u64, NoteError> {
    let steps = value.as_u64().filter(|steps| *steps <= MAX_STEPS);
    steps.ok_or(NoteError::Field(name, "be at most 2^53"))
}

//! Inputs to the arm as text: one JSON object each, with one member. Its numbers are read back bit for bit.
//!
//! **Invariant:** finite numbers are read back unchanged. A note that does not fit the arm is refused.

use serde_json::{Value, json};

use crate::math::arm::{Arm, ArmError, State};
use crate::math::integrator::Method;
use crate::math::limits::{AntiWindup, Limits};
use crate::math::pid::{Gains, Setpoint};
use crate::math::sensors::{MAX_DELAY, Sensors, VelocitySource};
use crate::math::simulation::{ArmInput, Checkpoint, ControlPeriod, Held, Memory, StepNote};
use crate::protocol::wire::text::{excerpt, shortened};

use super::writer::VERSION;

/// Longest message of the parser \[characters\]. It may quote the file.
const MAX_WORDS: usize = 200;
/// Most steps of a record: all numbers up to this are exact as a `float64`. A run takes years to exceed it.
const MAX_STEPS: u64 = 1 << 53;

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

// ---- notes ----------------------------------------------------------------------------------------------------------

/// The note as text.
#[must_use]
pub fn write_note<const N: usize>(note: &StepNote<N>) -> String {
    let (kind, value) = match note {
        StepNote::Begin(simulation) => {
            let simulation = simulation.write();
            let begin = json!({"links": N, "version": VERSION, "simulation": simulation});
            ("begin", begin)
        }
        StepNote::Diverged => ("diverged", Value::Null),
        StepNote::Input(input) => match input {
            ArmInput::Method(method) => ("method", method.write()),
            ArmInput::Timestep(timestep) => ("timestep", timestep.write()),
            ArmInput::Arm(arm) => ("params", arm.write()),
            ArmInput::Gains(gains) => ("gains", gains.write()),
            ArmInput::Enabled(on) => ("enable", on.write()),
            ArmInput::Setpoint(setpoint) => ("setpoint", setpoint.write()),
            ArmInput::Disturbance { effort, duration } => ("disturb", (*effort, *duration).write()),
            ArmInput::Period(period) => ("period", period.write()),
            ArmInput::Limits(limits) => ("limits", limits.write()),
            ArmInput::Sensors(sensors) => ("sensors", sensors.write()),
            ArmInput::State(state) => ("state", state.write()),
            ArmInput::Command(effort) => ("command", effort.write()),
            ArmInput::Drive(effort) => ("drive", effort.write()),
            ArmInput::Reset => ("reset", Value::Null),
        },
    };
    json!({ kind: value }).to_string()
}

/// The number of links and the program's version, in a note with the whole simulation; `None` for any other note.
#[must_use]
pub(super) fn links_and_version(note: &str) -> Option<(u64, String)> {
    let note: Value = serde_json::from_str(note).ok()?;
    let version = note.pointer("/begin/version")?.as_str()?;
    let links = note.pointer("/begin/links")?.as_u64()?;
    Some((links, version.to_owned()))
}

/// Reads a note.
///
/// # Errors
/// If it is not a note, or not for an arm of `N` links.
pub fn read_note<const N: usize>(note: &str) -> Result<StepNote<N>, NoteError> {
    let note: Value = serde_json::from_str(note)?;
    let mut members = note.as_object().into_iter().flatten();
    let (Some((kind, value)), None) = (members.next(), members.next()) else {
        return Err(NoteError::Kind(note.to_string()));
    };
    Ok(StepNote::Input(match kind.as_str() {
        "begin" => {
            let simulation: Checkpoint<N> = Noted::read("begin", &value["simulation"])?;
            require_positive("timestep", simulation.timestep)?;
            return Ok(StepNote::Begin(Box::new(simulation)));
        }
        "diverged" => return Ok(StepNote::Diverged),
        "method" => ArmInput::Method(Noted::read("method", value)?),
        "timestep" => {
            let timestep = Noted::read("timestep", value)?;
            require_positive("timestep", timestep)?;
            ArmInput::Timestep(timestep)
        }
        "params" => ArmInput::Arm(Noted::read("params", value)?),
        "gains" => ArmInput::Gains(Noted::read("gains", value)?),
        "enable" => ArmInput::Enabled(Noted::read("enable", value)?),
        "setpoint" => ArmInput::Setpoint(Noted::read("setpoint", value)?),
        "disturb" => {
            let (effort, duration) = Noted::read("disturb", value)?;
            ArmInput::Disturbance { effort, duration }
        }
        "period" => ArmInput::Period(Noted::read("period", value)?),
        "limits" => ArmInput::Limits(Noted::read("limits", value)?),
        "sensors" => ArmInput::Sensors(Noted::read("sensors", value)?),
        "state" => ArmInput::State(Noted::read("state", value)?),
        "command" => ArmInput::Command(Noted::read("command", value)?),
        "drive" => ArmInput::Drive(Noted::read("drive", value)?),
        "reset" => ArmInput::Reset,
        other => return Err(NoteError::Kind(other.to_owned())),
    }))
}

fn require_positive(name: &'static str, time: f64) -> Result<(), NoteError> {
    let is_positive = (time > 0.0).then_some(());
    is_positive.ok_or(NoteError::Field(name, "be greater than 0"))
}

// ---- the values in them ---------------------------------------------------------------------------------------------

/// A value in a note.
trait Noted: Sized {
    fn write(&self) -> Value;

    /// Reads the value of the field `name`.
    fn read(name: &'static str, from: &Value) -> Result<Self, NoteError>;
}

/// An object with the fields of a structure, each written and read by its type.
macro_rules! noted {
    ($([$($n:tt)*] $structure:ty { $($field:ident),* })*) => {$(
        impl<$($n)*> Noted for $structure {
            fn write(&self) -> Value {
                json!({$(stringify!($field): self.$field.write()),*})
            }

            fn read(_: &'static str, from: &Value) -> Result<Self, NoteError> {
                Ok(Self {$($field: Noted::read(stringify!($field), &from[stringify!($field)])?),*})
            }
        }
    )*};
}

noted! {
    [const N: usize] Checkpoint<N> {
        arm, gains, setpoint, integral, enabled, held, limits, sensors, memory, method, timestep, state, carry, effort, disturbance, base,
        steps_since_base, steps, divergence
    }
    [const N: usize] Held<N> { period, due, effort, computed, command, driven }
    [const N: usize] Gains<N> { kp, ki, kd }
    [const N: usize] Setpoint<N> { position, velocity }
    [const N: usize] State<N> { position, velocity }
}

/// Records of older versions have a delay of `false` or `true`.
impl Noted for ControlPeriod {
    fn write(&self) -> Value {
        json!({"period": self.period, "delay": self.delay})
    }

    fn read(name: &'static str, from: &Value) -> Result<Self, NoteError> {
        let period = Noted::read("period", &from["period"])?;
        let given = &from["delay"];
        let delay = given.as_bool().map(u64::from).or(given.as_u64());
        let delay = delay.and_then(|delay| u8::try_from(delay).ok());
        let delay = delay.filter(|delay| *delay <= MAX_DELAY);
        let delay = delay.ok_or(NoteError::Field("delay", "be a whole number from 0 to 16"))?;
        let read = Some(Self { period, delay }).filter(|one| one.period >= 0.0);
        read.ok_or(NoteError::Field(name, "not be negative"))
    }
}

/// Records of versions without limits have none.
impl<const N: usize> Noted for Limits<N> {
    fn write(&self) -> Value {
        let anti_windup = self.anti_windup.name();
        let tracking_time = self.tracking_time;
        json!({"effort": self.effort.write(), "anti_windup": anti_windup, "tracking_time": tracking_time})
    }

    fn read(_: &'static str, from: &Value) -> Result<Self, NoteError> {
        if from.is_null() {
            return Ok(Self::default());
        }
        let effort: Option<[f64; N]> = Noted::read("effort", &from["effort"])?;
        if effort.iter().flatten().any(|limit| *limit < 0.0) {
            return Err(NoteError::Field("effort", "not be negative"));
        }
        let mut forms = AntiWindup::ALL.into_iter();
        let anti_windup = forms.find(|form| from["anti_windup"] == form.name());
        let tracking_time = Noted::read("tracking_time", &from["tracking_time"])?;
        require_positive("tracking_time", tracking_time)?;
        Ok(Self {
            effort,
            anti_windup: anti_windup
                .ok_or(NoteError::Field("anti_windup", "be the name of a form"))?,
            tracking_time,
        })
    }
}

/// Records of versions without sensors have none.
impl<const N: usize> Noted for Sensors<N> {
    fn write(&self) -> Value {
        json!({"encoder_step": self.encoder_step.write(), "velocity": self.velocity.name()})
    }

    fn read(_: &'static str, from: &Value) -> Result<Self, NoteError> {
        if from.is_null() {
            return Ok(Self::default());
        }
        let encoder_step: [f64; N] = Noted::read("encoder_step", &from["encoder_step"])?;
        if encoder_step.iter().any(|step| *step < 0.0) {
            return Err(NoteError::Field("encoder_step", "not be negative"));
        }
        let mut sources = VelocitySource::ALL.into_iter();
        let velocity = sources.find(|source| from["velocity"] == source.name());
        Ok(Self {
            encoder_step,
            velocity: velocity.ok_or(NoteError::Field("velocity", "be exact or difference"))?,
        })
    }
}

/// Without a measurement and waiting efforts it is null, as in records of older versions.
impl<const N: usize> Noted for Memory<N> {
    fn write(&self) -> Value {
        if *self == Self::default() {
            return Value::Null;
        }
        let waiting: Vec<Value> = self.waiting.iter().map(Noted::write).collect();
        json!({"measured": self.measured.write(), "waiting": waiting})
    }

    fn read(_: &'static str, from: &Value) -> Result<Self, NoteError> {
        let mut read = Self::default();
        if !from.is_null() {
            read.measured = Noted::read("measured", &from["measured"])?;
            let mut waiting = from["waiting"].as_array().into_iter().flatten();
            for place in &mut read.waiting {
                *place = Noted::read("waiting", waiting.next().unwrap_or(&Value::Null))?;
            }
        }
        Ok(read)
    }
}

impl<const N: usize> Noted for Arm<N> {
    fn write(&self) -> Value {
        let (masses, lengths) = (self.masses().write(), self.lengths().write());
        let viscous = self.has_friction().then(|| self.viscous().write());
        json!({"gravity": self.gravity(), "masses": masses, "lengths": lengths, "viscous": viscous})
    }

    fn read(_: &'static str, from: &Value) -> Result<Self, NoteError> {
        let lengths = Noted::read("lengths", &from["lengths"])?;
        let masses = Noted::read("masses", &from["masses"])?;
        let gravity = Noted::read("gravity", &from["gravity"])?;
        let viscous: Option<[f64; N]> = Noted::read("viscous", &from["viscous"])?;
        let arm = Self::new(lengths, masses, gravity)?;
        Ok(arm.with_friction(viscous.unwrap_or([0.0; N]))?)
    }
}

impl Noted for Method {
    fn write(&self) -> Value {
        self.name().into()
    }

    fn read(name: &'static str, from: &Value) -> Result<Self, NoteError> {
        let found = Self::ALL.into_iter().find(|one| *from == one.name());
        found.ok_or(NoteError::Field(name, "be the name of a method"))
    }
}

impl<T: Noted> Noted for Option<T> {
    fn write(&self) -> Value {
        self.as_ref().map_or(Value::Null, T::write)
    }

    fn read(name: &'static str, from: &Value) -> Result<Self, NoteError> {
        let value = Some(from).filter(|value| !value.is_null());
        value.map(|value| T::read(name, value)).transpose()
    }
}

impl<A: Noted, B: Noted> Noted for (A, B) {
    fn write(&self) -> Value {
        json!([self.0.write(), self.1.write()])
    }

    fn read(name: &'static str, from: &Value) -> Result<Self, NoteError> {
        Ok((A::read(name, &from[0])?, B::read(name, &from[1])?))
    }
}

impl<const N: usize> Noted for [f64; N] {
    fn write(&self) -> Value {
        self.as_slice().into()
    }

    fn read(name: &'static str, from: &Value) -> Result<Self, NoteError> {
        let values = from.as_array().and_then(|values| {
            let numbers = values.iter().map(Value::as_f64);
            numbers.collect::<Option<Vec<_>>>()?.try_into().ok()
        });
        values.ok_or(NoteError::Field(name, "have one number per joint"))
    }
}

macro_rules! noted_scalars {
    ($($scalar:ty: $read:expr, $rule:literal;)*) => {$(
        impl Noted for $scalar {
            fn write(&self) -> Value {
                (*self).into()
            }

            fn read(name: &'static str, from: &Value) -> Result<Self, NoteError> {
                $read(from).ok_or(NoteError::Field(name, $rule))
            }
        }
    )*};
}

noted_scalars! {
    f64: Value::as_f64, "be a number";
    bool: Value::as_bool, "be true or false";
    u64: |from: &Value| from.as_u64().filter(|steps| *steps <= MAX_STEPS), "be at most 2^53";
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::simulation::Simulation;

    #[test]
    fn an_input_that_no_arm_accepts_is_refused_by_its_field() {
        let simulation = Simulation::new(Arm::<2>::default(), Gains::default());
        let begin = write_note(&StepNote::Begin(Box::new(simulation.checkpoint())));
        let mut stopped: Value = serde_json::from_str(&begin).unwrap();
        stopped["begin"]["simulation"]["timestep"] = 0.into();
        assert!(read_note::<2>(&begin).is_ok());
        let timestep = "timestep must be greater than 0";
        for (note, why) in [
            (&*stopped.to_string(), timestep),
            ("{\"timestep\":0}", timestep),
            ("{\"timestep\":-0.001}", timestep),
            (
                "{\"period\":{\"period\":-1,\"delay\":false}}",
                "period must not be negative",
            ),
        ] {
            assert_eq!(read_note::<2>(note).unwrap_err().to_string(), why);
        }
    }
}

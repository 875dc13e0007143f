//! Reads a request field by field and collects the rejections by name.
//!
//! Every field is read alone: a bad one is rejected and recorded, and the others still count. The catalog has the
//! fields of a service, their order in a positional array, and which are required. A field that is an object is
//! read member by member in the same way. Its members have names such as `gains.kp`.
//!
//! **Invariant:** each rejected field is named once, or once for each wrong entry of an array. All are reported in one line of
//! bounded length.

use std::borrow::Cow;
use std::fmt;
use std::ops::RangeInclusive;

use serde_json::value::RawValue;

use crate::protocol::catalog::{Action, Field, Service, Topic, types};
use crate::protocol::op::Arguments;
use crate::protocol::wire::{json, text};

/// Longest `status` in characters: room for every field of the largest service.
const MAX_STATUS: usize = 2048;
/// Longest reason, in characters.
const MAX_REASON: usize = 256;

/// The fields of one request.
#[derive(Debug)]
pub struct Fields<'a> {
    /// The fields that the catalog lists.
    fields: &'static [Field],
    /// Whether `null` in an optional field means absent.
    null_is_absent: bool,
    /// The prefix of the names: empty, or the name of the object and a full stop.
    prefix: String,
    /// The received values, in the order of the catalog.
    values: Vec<Option<&'a RawValue>>,
    rejections: Rejections,
}

impl<'a> Fields<'a> {
    /// Sorts the arguments of a call into the fields of the service. Unknown fields are ignored.
    ///
    /// # Errors
    /// If a positional array has more entries than the service has fields.
    pub fn read(args: &'a Arguments, service: Service) -> Result<Self, RejectedField> {
        Self::of(service).filled(args)
    }

    /// Sorts the fields of a goal. One bad field rejects the whole goal.
    ///
    /// # Errors
    /// If a positional array has more entries than a goal has fields.
    pub fn of_goal(args: &'a Arguments, action: Action) -> Result<Self, RejectedField> {
        Self::with(action.goal_fields(), true).filled(args)
    }

    /// Sorts the fields of a message. One bad field rejects the whole message.
    ///
    /// # Errors
    /// If it is not a message.
    pub fn of_message(msg: &'a Arguments, topic: Topic) -> Result<Self, RejectedField> {
        Self::with(topic.fields(), true).filled(msg)
    }

    fn filled(self, args: &'a Arguments) -> Result<Self, RejectedField> {
        let mut read = self;
        let (fields, values) = (read.fields, &mut read.values);
        let refused = |reason: String| RejectedField::refused("args", &reason);
        let raw = args.raw();
        match raw.get().as_bytes().first() {
            Some(b'{') => {
                let names: Vec<&str> = fields.iter().map(|field| field.name).collect();
                json::members_into(raw.get(), &names, values)
                    .map_err(|_| refused(mistyped("an object", raw)))?;
            }
            Some(b'[') => {
                let entries = json::entries(raw, fields.len())
                    .ok_or_else(|| refused(mistyped("an array", raw)))?;
                if entries.count > fields.len() {
                    return Err(refused(too_many(fields.len(), entries.count)));
                }
                for (value, entry) in values.iter_mut().zip(entries.first) {
                    *value = Some(entry);
                }
            }
            _ => return Err(refused(mistyped("an object or an array", raw))),
        }
        Ok(read)
    }

    /// Sorts the arguments of a call. If they are rejected as a whole, all fields count as missing, so the answer can
    /// echo the present values.
    #[must_use]
    pub fn read_or_none(args: &'a Arguments, service: Service) -> Self {
        Self::read(args, service).unwrap_or_else(|rejection| Self {
            rejections: rejection.into(),
            ..Self::of(service)
        })
    }

    /// The fields of a request with at most one field.
    #[must_use]
    pub fn single(service: Service, name: &str, value: Option<&'a RawValue>) -> Self {
        let mut fields = Self::of(service);
        let given = fields.fields.iter().zip(&mut fields.values);
        for (field, entry) in given {
            *entry = value.filter(|_| field.name == name);
        }
        fields
    }

    /// The fields of an empty request.
    fn of(service: Service) -> Self {
        Self::with(service.fields(), service.null_is_absent())
    }

    fn with(fields: &'static [Field], null_is_absent: bool) -> Self {
        Self {
            fields,
            null_is_absent,
            prefix: String::new(),
            values: vec![None; fields.len()],
            rejections: Rejections::default(),
        }
    }

    /// Whether the catalog lists a field of that name.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.fields.iter().any(|field| field.name == name)
    }

    /// A finite number within `bound`.
    pub fn number(&mut self, name: &'static str, bound: Bound) -> Option<f64> {
        let raw = self.take(name)?;
        match finite(raw, bound) {
            Ok(value) => Some(value),
            Err(reason) => self.rejected_as(name, &reason),
        }
    }

    /// An array of `count` finite numbers within `bound`.
    pub fn numbers(&mut self, name: &'static str, count: usize, bound: Bound) -> Option<Vec<f64>> {
        let raw = self.take(name)?;
        let Some(entries) = json::entries(raw, count) else {
            return self.mistyped(name, &format!("an array of {count} numbers"), raw);
        };
        if entries.count != count {
            return self.rejected_as(name, &wrong_length(count, entries.count));
        }
        let mut values = Vec::with_capacity(count);
        for (index, entry) in entries.first.into_iter().enumerate() {
            match finite(entry, bound) {
                Ok(value) => values.push(value),
                Err(reason) => {
                    self.rejected_as::<()>(&format!("{name}[{index}]"), &reason);
                }
            }
        }
        (values.len() == count).then_some(values)
    }

    /// An array of finite numbers within `bound`, one per joint.
    pub fn array<const N: usize>(&mut self, name: &'static str, bound: Bound) -> Option<[f64; N]> {
        self.numbers(name, N, bound)?.try_into().ok()
    }

    /// The same, or `null` for none.
    #[allow(
        clippy::option_option,
        reason = "an absent field is not a field that is null"
    )]
    pub fn array_or_null<const N: usize>(
        &mut self,
        name: &'static str,
        bound: Bound,
    ) -> Option<Option<[f64; N]>> {
        let index = self.fields.iter().position(|field| field.name == name);
        let raw = index.and_then(|index| self.values.get(index).copied().flatten());
        if raw.is_some_and(|raw| raw.get() == "null") {
            return Some(None);
        }
        self.array(name, bound).map(Some)
    }

    /// `true` or `false`.
    pub fn boolean(&mut self, name: &'static str) -> Option<bool> {
        self.value(name, "true or false", json::boolean)
    }

    /// A string.
    pub fn text(&mut self, name: &'static str) -> Option<Cow<'a, str>> {
        self.value(name, "a string", json::text)
    }

    /// The raw value.
    pub fn raw(&mut self, name: &'static str) -> Option<&'a RawValue> {
        self.take(name)
    }

    /// An array of at most `most` values of any type.
    pub fn entries(&mut self, name: &'static str, most: usize) -> Option<Vec<&'a RawValue>> {
        let raw = self.take(name)?;
        let Some(entries) = json::entries(raw, most) else {
            return self.mistyped(name, "an array", raw);
        };
        if entries.count > most {
            return self.rejected_as(name, &too_many(most, entries.count));
        }
        Some(entries.first)
    }

    /// An array of at most `most` strings.
    pub fn texts(&mut self, name: &'static str, most: usize) -> Option<Vec<String>> {
        let entries = self.entries(name, most)?;
        let mut texts = Vec::with_capacity(entries.len());
        for (index, entry) in entries.iter().enumerate() {
            match json::text(entry) {
                Some(text) => texts.push(text.into_owned()),
                None => self.mistyped(&format!("{name}[{index}]"), "a string", entry)?,
            }
        }
        Some(texts)
    }

    /// A whole number in `range`; `10.0` counts as 10.
    pub fn count(&mut self, name: &'static str, range: RangeInclusive<u64>) -> Option<u64> {
        let raw = self.take(name)?;
        let value = json::integer(raw).filter(|value| range.contains(value));
        let expected = || format!("an integer from {} to {}", range.start(), range.end());
        value.or_else(|| self.mistyped(name, &expected(), raw))
    }

    /// A whole number, 0 or more; `10.0` counts as 10.
    pub fn whole(&mut self, name: &'static str) -> Option<u64> {
        self.value(name, "an integer, at least 0", json::integer)
    }

    /// One of `options`, by its name.
    pub fn choice<T: Copy>(
        &mut self,
        name: &'static str,
        options: &[T],
        name_of: impl Fn(T) -> &'static str,
    ) -> Option<T> {
        let raw = self.take(name)?;
        let text = json::text(raw);
        let is_meant = |option: &T| Some(name_of(*option)) == text.as_deref();
        options.iter().copied().find(is_meant).or_else(|| {
            let names: Vec<&str> = options.iter().map(|&option| name_of(option)).collect();
            self.mistyped(name, &format!("one of {}", names.join(", ")), raw)
        })
    }

    /// A value that `read` accepts.
    fn value<T>(
        &mut self,
        name: &'static str,
        expected: &str,
        read: impl FnOnce(&'a RawValue) -> Option<T>,
    ) -> Option<T> {
        let raw = self.take(name)?;
        read(raw).or_else(|| self.mistyped(name, expected, raw))
    }

    /// An object. `read` reads its members like the fields of a request. `None` if it is absent or not an object. The
    /// field's type defines the members.
    pub fn object<T>(
        &mut self,
        name: &'static str,
        read: impl FnOnce(&mut Fields<'a>) -> T,
    ) -> Option<T> {
        let raw = self.take(name)?;
        let field = self.fields.iter().find(|field| field.name == name)?;
        let fields = types::members(field);
        let names: Vec<&str> = fields.iter().map(|field| field.name).collect();
        let mut values = vec![None; fields.len()];
        if json::members_into(raw.get(), &names, &mut values).is_err() {
            return self.mistyped(name, "an object", raw);
        }
        let mut members = Fields {
            fields,
            null_is_absent: self.null_is_absent,
            prefix: format!("{}{name}.", self.prefix),
            values,
            rejections: Rejections::default(),
        };
        let value = read(&mut members);
        self.rejections.append(members.rejections);
        Some(value)
    }

    /// Rejects a field. The reason continues the sentence after the field's name.
    pub fn refuse(&mut self, name: &str, reason: &impl fmt::Display) {
        self.rejections
            .refuse(&format!("{}{name}", self.prefix), reason);
    }

    /// The rejections so far.
    #[must_use]
    pub fn rejections(&self) -> Rejections {
        self.rejections.clone()
    }

    /// Returns the rejections after the whole request has been read.
    #[must_use]
    pub fn finish(self) -> Rejections {
        self.rejections
    }

    /// The request, unless a field was rejected.
    ///
    /// # Errors
    /// All rejected fields.
    pub fn accept<T>(self, request: T) -> Result<T, Rejections> {
        match self.accepted() {
            true => Ok(request),
            false => Err(self.rejections),
        }
    }

    /// Whether every field read so far was valid: the `result` of the response.
    #[must_use]
    pub fn accepted(&self) -> bool {
        self.rejections.is_empty()
    }

    /// Takes the value of that name. A missing required field is rejected.
    fn take(&mut self, name: &'static str) -> Option<&'a RawValue> {
        let index = self.fields.iter().position(|field| field.name == name);
        debug_assert!(index.is_some(), "{name} is not in the catalog");
        let index = index?;
        let required = self.fields.get(index).is_some_and(|field| field.required);
        let raw = self.values.get(index).copied().flatten();
        let null_is_absent = self.null_is_absent && !required;
        match raw {
            Some(raw) if null_is_absent && raw.get() == "null" => None,
            None if required => self.rejected_as(name, MISSING),
            raw => raw,
        }
    }

    fn mistyped<T>(&mut self, name: &str, expected: &str, raw: &RawValue) -> Option<T> {
        self.rejected_as(name, &mistyped(expected, raw))
    }

    fn rejected_as<T>(&mut self, name: &str, reason: &str) -> Option<T> {
        self.refuse(name, &reason);
        None
    }
}

// ---- rejections ----------------------------------------------------------------------------------------------------

/// The required range of a finite number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// Any finite number.
    Finite,
    /// Greater than 0.
    Positive,
    /// 0 or greater.
    NonNegative,
}

impl Bound {
    fn holds(self, value: f64) -> bool {
        match self {
            Self::Finite => true,
            Self::Positive => value > 0.0,
            Self::NonNegative => value >= 0.0,
        }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Finite => "finite",
            Self::Positive => "greater than 0",
            Self::NonNegative => "at least 0",
        })
    }
}

/// A rejected field with its reason. It reads as a sentence: `masses[1] must be greater than 0, got -2`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field} {reason}")]
pub struct RejectedField {
    /// The field, with the index of the wrong entry if there is one.
    pub field: String,
    /// The fault, which continues the sentence.
    pub reason: String,
}

/// The rejected fields of a request, in the order of reading.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Rejections(Vec<RejectedField>);

impl From<RejectedField> for Rejections {
    fn from(rejection: RejectedField) -> Self {
        Self(vec![rejection])
    }
}

impl Rejections {
    /// Whether no field was rejected.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The rejections, one by one.
    #[must_use]
    pub fn as_slice(&self) -> &[RejectedField] {
        &self.0
    }

    /// All of them in one line; empty if there are none: the `status` of the response.
    #[must_use]
    pub fn status(&self) -> String {
        let sentences: Vec<String> = self.0.iter().map(RejectedField::to_string).collect();
        text::shortened(&sentences.join("; "), MAX_STATUS)
    }

    /// Rejects a field. The reason continues the sentence after the field's name.
    pub fn refuse(&mut self, field: &str, reason: &impl fmt::Display) {
        self.0.push(RejectedField::refused(field, reason));
    }

    /// Replaces a field's name by the sender's name for it, also before the index of an entry.
    pub fn rename(&mut self, field: &str, name: &str) {
        for rejection in &mut self.0 {
            let rest = rejection.field.strip_prefix(field);
            if let Some(index) = rest.filter(|rest| rest.is_empty() || rest.starts_with('[')) {
                rejection.field = format!("{name}{index}");
            }
        }
    }

    /// Appends the rejections of `later`.
    pub fn append(&mut self, mut later: Self) {
        self.0.append(&mut later.0);
    }
}

impl fmt::Display for Rejections {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.status())
    }
}

impl RejectedField {
    /// A rejected field. `reason` continues the sentence after the field's name.
    #[must_use]
    pub fn refused(field: &str, reason: &impl fmt::Display) -> Self {
        Self {
            field: field.to_owned(),
            reason: text::shortened(&reason.to_string(), MAX_REASON),
        }
    }
}

/// The reason why a required field is rejected that is not there.
pub(crate) const MISSING: &str = "is required";

/// The reason why a value of another kind is rejected.
pub(crate) fn mistyped(expected: &str, raw: &RawValue) -> String {
    format!("must be {expected}, got {}", text::found(raw))
}

/// The reason why an array of `got` entries is rejected.
pub(crate) fn too_many(limit: usize, got: usize) -> String {
    let entries = if limit == 1 { "entry" } else { "entries" };
    format!("must have at most {limit} {entries}, got {got}")
}

/// The reason why an array is rejected that does not have `expected` entries.
pub(crate) fn wrong_length(expected: usize, got: usize) -> String {
    format!("must have {expected} entries, got {got}")
}

/// The finite number of a value, within `bound`, or the reason why it is rejected.
pub(crate) fn finite(raw: &RawValue, bound: Bound) -> Result<f64, String> {
    let value = json::number(raw).ok_or_else(|| mistyped("a number", raw))?;
    if !value.is_finite() {
        return Err(mistyped("a finite number", raw));
    }
    if !bound.holds(value) {
        return Err(mistyped(&bound.to_string(), raw));
    }
    Ok(value)
}

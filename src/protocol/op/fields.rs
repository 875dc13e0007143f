//! Reads a request field by field and collects the rejections by name.
//!
//! Every field is read alone: a bad one is rejected and recorded, and the others still count. The catalog has the
//! fields of a service, their order in a positional array, and which are required. A field that is an object is
//! read member by member in the same way. Its members have names such as `gains.kp`.
//!
//! **Invariant:** each rejected field is named once, or once for each wrong entry of an array.

use std::borrow::Cow;
use std::fmt;
use std::ops::RangeInclusive;

use serde_json::value::RawValue;

pub use super::rejections::{Bound, RejectedField, Rejections};
pub(crate) use super::rejections::{MISSING, finite, mistyped, too_many, wrong_length};

use crate::protocol::catalog::{Action, Field, Service, Topic};
use crate::protocol::op::Arguments;
use crate::protocol::wire::json;

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
        let fields = field.members();
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

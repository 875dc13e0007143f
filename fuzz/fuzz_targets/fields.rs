//! The field reader against a second reading of the same JSON.
//!
//! Asserted: for any arguments of any of the arm's services, both readings accept the same fields with the same values,
//! to the bit and within their bounds. Every other field is refused by its name, once and in the order of reading. The
//! status names it and is one bounded line.
//!
//! Input: a byte that chooses the service, a byte that chooses how its fields are read, the text of `args`.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pendularm::protocol::catalog::{Field, Service, types};
use pendularm::protocol::op::fields::{Bound, Fields};
use pendularm::protocol::op::{self, Arguments, CallService, Op};
use pendularm::protocol::wire::frame::FrameReader;
use pendularm_fuzz::json::Json;
use pendularm_fuzz::limits::{READING, hold};

const METHODS: [&str; 4] = ["euler", "midpoint", "verlet", "rk4"];

fuzz_target!(|input: &[u8]| hold(input.len(), READING, || examine(input)));

fn examine(input: &[u8]) {
    let &[service, seed, ref args @ ..] = input else {
        return;
    };
    let service = Service::ALL[usize::from(service) % Service::ALL.len()];
    let Some(args) = arguments(service, args) else {
        return;
    };
    let Some(json) = Json::read(args.get()) else {
        panic!("accepted, and no JSON: {}", args.get());
    };
    let Some(mut model) = Model::new(service, &json) else {
        let refusal = Fields::read(&args, service).expect_err("the other reading refuses it");
        assert_eq!(refusal.field, "args");
        return;
    };
    let mut fields = Fields::read(&args, service).expect("the other reading takes it");
    for field in service.fields() {
        compare(&mut fields, &mut model, field, seed);
    }
    let is_accepted = fields.accepted();
    let rejections = fields.finish();
    let refused: Vec<&str> = rejections
        .as_slice()
        .iter()
        .map(|one| &*one.field)
        .collect();
    assert_eq!(refused, model.refused, "{args:?}");
    assert_eq!(is_accepted, refused.is_empty());
    let status = rejections.status();
    assert!(status.chars().count() <= 2049 && !status.contains(char::is_control));
    for name in refused {
        assert!(status.contains(name) || status.ends_with('…'), "{status}");
    }
}

/// The arguments of a frame with this text, if it is one.
fn arguments(service: Service, args: &[u8]) -> Option<Arguments> {
    let mut frame = format!(
        "{{\"op\":\"call_service\",\"service\":\"{}\",\"args\":",
        service.name()
    )
    .into_bytes();
    frame.extend_from_slice(args);
    frame.extend_from_slice(b"}\n");
    let mut frames = FrameReader::new();
    frames.push(&frame);
    let frame = frames.next()?.ok()?;
    match op::read(&frame.text).op {
        // The text may have ended the frame early, or begun with another `service`.
        Ok(Op::CallService(CallService {
            service: name,
            args,
            ..
        })) if name == service.name() => Some(args),
        _ => None,
    }
}

/// The second reading: the values under each name, and the refusals.
struct Model<'a> {
    values: Vec<(&'static str, Option<&'a Json>)>,
    null_is_absent: bool,
    prefix: String,
    refused: Vec<String>,
}

impl<'a> Model<'a> {
    fn new(service: Service, args: &'a Json) -> Option<Self> {
        let fields = service.fields();
        let values = match args {
            Json::Array(entries) if entries.len() > fields.len() => return None,
            Json::Array(entries) => {
                let entries = entries.iter().map(Some).chain(std::iter::repeat(None));
                fields.iter().map(|field| field.name).zip(entries).collect()
            }
            Json::Object(_) => members(fields, args)?,
            _ => return None,
        };
        Some(Self {
            values,
            null_is_absent: service.null_is_absent(),
            prefix: String::new(),
            refused: Vec::new(),
        })
    }

    /// The value of a field, if there is one to be read.
    fn take(&mut self, field: &Field) -> Option<&'a Json> {
        let (_, value) = self.values.iter().find(|(name, _)| *name == field.name)?;
        match value {
            Some(Json::Null) if self.null_is_absent && !field.required => None,
            None if field.required => self.refuse(field.name),
            value => *value,
        }
    }

    fn refuse<T>(&mut self, name: &str) -> Option<T> {
        self.refused.push(format!("{}{name}", self.prefix));
        None
    }

    fn number(&mut self, name: &str, value: &Json, bound: Bound) -> Option<f64> {
        let number = value.number().filter(|number| within(*number, bound));
        number.or_else(|| self.refuse(name))
    }

    fn numbers(
        &mut self,
        name: &str,
        value: &Json,
        count: usize,
        bound: Bound,
    ) -> Option<Vec<f64>> {
        let Json::Array(entries) = value else {
            return self.refuse(name);
        };
        if entries.len() != count {
            return self.refuse(name);
        }
        let numbers: Vec<Option<f64>> = entries
            .iter()
            .enumerate()
            .map(|(index, entry)| self.number(&format!("{name}[{index}]"), entry, bound))
            .collect();
        numbers.into_iter().collect()
    }

    fn count(&mut self, name: &str, value: &Json, limit: u64) -> Option<u64> {
        let Json::Number(text) = value else {
            return self.refuse(name);
        };
        let whole = text.parse::<u64>().ok().or_else(|| {
            let number: f64 = text.parse().ok()?;
            (number.is_finite() && number >= 0.0 && number.fract() == 0.0).then_some(number as u64)
        });
        whole
            .filter(|count| (1..=limit).contains(count))
            .or_else(|| self.refuse(name))
    }
}

/// The members of an object. `None` if it is none.
fn members<'a>(
    fields: &[Field],
    object: &'a Json,
) -> Option<Vec<(&'static str, Option<&'a Json>)>> {
    let named = |field: &Field| (field.name, object.get(field.name));
    let is_object = matches!(object, Json::Object(_));
    is_object.then(|| fields.iter().map(named).collect())
}

fn within(number: f64, bound: Bound) -> bool {
    number.is_finite()
        && match bound {
            Bound::Finite => true,
            Bound::Positive => number > 0.0,
            Bound::NonNegative => number >= 0.0,
        }
}

/// Reads one field in both ways. The seed selects its bounds.
fn compare(fields: &mut Fields<'_>, model: &mut Model<'_>, field: &Field, seed: u8) {
    let name = field.name;
    let value = model.take(field);
    let bound = [Bound::Finite, Bound::Positive, Bound::NonNegative][usize::from(seed) % 3];
    match field.kind {
        "float64" => {
            let expected = value.and_then(|value| model.number(name, value, bound));
            let found = fields.number(name, bound);
            assert_eq!(
                found.map(f64::to_bits),
                expected.map(f64::to_bits),
                "{name}"
            );
        }
        "float64[]" => {
            let count = usize::from(seed >> 2) % 4;
            let expected = value.and_then(|value| model.numbers(name, value, count, bound));
            let found = fields.numbers(name, count, bound);
            let bits =
                |numbers: Vec<f64>| numbers.into_iter().map(f64::to_bits).collect::<Vec<_>>();
            assert_eq!(found.map(bits), expected.map(bits), "{name}");
        }
        "bool" => {
            let expected = value.and_then(|value| match value {
                Json::Boolean(value) => Some(*value),
                _ => model.refuse(name),
            });
            assert_eq!(fields.boolean(name), expected, "{name}");
        }
        "string" if seed & 4 == 0 => {
            let expected = value.and_then(|value| value.text().or_else(|| model.refuse(name)));
            assert_eq!(fields.text(name).as_deref(), expected, "{name}");
        }
        "string" => {
            let chosen = |value: &Json| METHODS.into_iter().find(|one| value.text() == Some(one));
            let expected = value.and_then(|value| chosen(value).or_else(|| model.refuse(name)));
            assert_eq!(fields.choice(name, &METHODS, |one| one), expected, "{name}");
        }
        "uint64" => {
            let limit = [1, 10_000, u64::MAX][usize::from(seed) % 3];
            let expected = value.and_then(|value| model.count(name, value, limit));
            assert_eq!(fields.count(name, 1..=limit), expected, "{name}");
        }
        _ => compare_object(fields, model, field, value),
    }
}

/// Reads the members of an object in both ways.
fn compare_object(
    fields: &mut Fields<'_>,
    model: &mut Model<'_>,
    field: &Field,
    value: Option<&Json>,
) {
    let values = value.and_then(|value| {
        members(types::members(field), value).or_else(|| model.refuse(field.name))
    });
    let is_object = values.is_some();
    let mut inner = Model {
        values: values.unwrap_or_default(),
        null_is_absent: model.null_is_absent,
        prefix: format!("{}{}.", model.prefix, field.name),
        refused: Vec::new(),
    };
    let read = fields.object(field.name, |members| {
        for member in types::members(field) {
            compare(members, &mut inner, member, 11);
        }
    });
    assert_eq!(read.is_some(), is_object, "{}", field.name);
    model.refused.append(&mut inner.refused);
}

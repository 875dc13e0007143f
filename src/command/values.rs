//! Values in JSON or YAML: arguments, and values of the runtime, written as YAML or as a line of JSON.
//!
//! YAML is written here, because the library's writer does not escape control characters, which act on a terminal.
//!
//! **Invariant:** a value is nested at most as deep as the runtime accepts. When written, members keep their order and
//! numbers their value, and control characters in texts are escaped.

use std::io::{BufWriter, Write};

use serde_json::Value;
use serde_json::value::RawValue;
use yaml_rust2::parser::{Event, Parser};
use yaml_rust2::{Yaml, YamlLoader};

use super::output::{CommandError, Outcome};
use crate::protocol::limits::MAX_NESTING;
use crate::protocol::wire::literals::string_end;
use crate::protocol::wire::text::escape;

/// Reads a value in JSON or YAML.
///
/// # Errors
/// [`CommandError::Usage`] with the reader's message.
pub fn read(text: &str) -> Outcome<Value> {
    // JSON has its own reader, because in YAML a pair of `\u` escapes is not one character.
    let value = serde_json::from_str(text).or_else(|_| read_yaml(text));
    value.map_err(|why| CommandError::Usage(format!("VALUE cannot be read as JSON or YAML: {why}")))
}

fn read_yaml(text: &str) -> Result<Value, String> {
    check_yaml(text)?;
    let mut documents = YamlLoader::load_from_str(text).map_err(|error| error.to_string())?;
    match (documents.pop(), documents.pop()) {
        (None, _) => Ok(Value::Null),
        (Some(document), None) => to_json(document),
        _ => Err("it must be one document, not several".to_owned()),
    }
}

/// Refuses values that the library would load without a bound: it copies the value of every alias, and its stack grows
/// with the depth.
fn check_yaml(text: &str) -> Result<(), String> {
    let mut events = Parser::new_from_str(text);
    let mut depth = 0;
    loop {
        match events.next_token().map_err(|error| error.to_string())?.0 {
            Event::StreamEnd => return Ok(()),
            Event::SequenceStart(_, None) | Event::MappingStart(_, None) => depth += 1,
            Event::SequenceEnd | Event::MappingEnd => depth -= 1,
            Event::Alias(_)
            | Event::Scalar(.., Some(_))
            | Event::SequenceStart(..)
            | Event::MappingStart(..) => {
                return Err("aliases (*name) and tags (!name) are not supported".to_owned());
            }
            _ => {}
        }
        // The frame around it is a level too.
        if depth >= MAX_NESTING {
            let most = MAX_NESTING - 1;
            return Err(format!("it is nested more than {most} deep"));
        }
    }
}

fn to_json(value: Yaml) -> Result<Value, String> {
    Ok(match value {
        Yaml::Boolean(value) => value.into(),
        Yaml::Integer(value) => value.into(),
        Yaml::String(text) => text.into(),
        Yaml::Array(items) => items.into_iter().map(to_json).collect::<Result<_, _>>()?,
        Yaml::Hash(members) => {
            let named = |(name, value)| match name {
                Yaml::String(name) | Yaml::Real(name) => Ok((name, to_json(value)?)),
                Yaml::Integer(name) => Ok((name.to_string(), to_json(value)?)),
                _ => Err("the name of a member must be a text".to_owned()),
            };
            Value::Object(members.into_iter().map(named).collect::<Result<_, _>>()?)
        }
        Yaml::Real(number) => match Yaml::Real(number.clone()).as_f64() {
            Some(value) if value.is_finite() => value.into(),
            _ => return Err(format!("{number} is not a JSON number")),
        },
        _ => Value::Null,
    })
}

/// Texts that YAML readers would not read as text, in lower case.
pub const WORDS: [&str; 10] = [
    "true", "false", "null", "yes", "no", "on", "off", "y", "n", "~",
];

/// JSON on one line, unchanged except for escaped control characters. YAML reads the escapes of its texts too.
#[must_use]
pub fn json_line(json: &str) -> String {
    // These are between tokens. Inside a text JSON does not allow them.
    escape(&json.replace(['\t', '\r', '\n'], " "))
}

/// Writes the value as lines of YAML, and `end` after them. It writes while it reads, because a deeply nested value is
/// a hundred times longer in YAML than in JSON.
///
/// # Errors
/// [`CommandError::Lost`] if it is nested deeper than the runtime accepts, or the error of `out`.
pub fn write_yaml(raw: &RawValue, end: &str, out: impl Write) -> Outcome {
    let mut out = BufWriter::new(out);
    let mut rest = raw.get();
    let token = next_token(&mut rest);
    write_value("", token, &mut rest, 0, &mut out)?;
    out.write_all(end.as_bytes())?;
    Ok(out.flush()?)
}

/// Cuts the next token from valid JSON: a bracket, or a scalar.
fn next_token<'a>(rest: &mut &'a str) -> &'a str {
    let is_space = |one: char| matches!(one, ' ' | '\t' | '\r' | '\n' | ',' | ':');
    let token = rest.trim_start_matches(is_space);
    let end = match token.as_bytes().first() {
        Some(b'"') => string_end(token.as_bytes(), 0),
        Some(b'[' | b']' | b'{' | b'}') => 1,
        _ => token
            .find(|one| is_space(one) || matches!(one, ']' | '}'))
            .unwrap_or(token.len()),
    };
    let (token, behind) = token.split_at(end);
    *rest = behind;
    token
}

/// Writes the value that begins with `token`, after its name or dash, which follows `indent` spaces.
fn write_value(
    name: &str,
    token: &str,
    rest: &mut &str,
    indent: usize,
    out: &mut dyn Write,
) -> Outcome {
    if indent > 2 * MAX_NESTING {
        let why = format_args!("a frame is nested more than {MAX_NESTING} deep");
        return Err(CommandError::lost(why));
    }
    write!(out, "{name}")?;
    let is_list = token == "[";
    let mut next = match is_list || token == "{" {
        true => next_token(rest),
        false => "",
    };
    let is_end = |token: &str| matches!(token, "" | "]" | "}");
    if is_end(next) {
        let space = if name.is_empty() { "" } else { " " };
        return Ok(writeln!(out, "{space}{}{next}", scalar(token)?)?);
    }
    let is_item = name == "-";
    // The dashes of a member are below its name.
    let is_level = name.is_empty() || (is_list && !is_item);
    let indent = if is_level { indent } else { indent + 2 };
    let line = " ".repeat(indent);
    let mut start = match name {
        "" => String::new(),
        "-" => " ".to_owned(),
        _ => format!("\n{line}"),
    };
    while !is_end(next) {
        write!(out, "{start}")?;
        start.clone_from(&line);
        if is_list {
            write_value("-", next, rest, indent, out)?;
        } else {
            let name = scalar(next)? + ":";
            write_value(&name, next_token(rest), rest, indent, out)?;
        }
        next = next_token(rest);
    }
    Ok(())
}

/// A scalar. Python reads numbers of YAML 1.1: with a point, and a sign in the exponent.
fn scalar(json: &str) -> Outcome<String> {
    if json.starts_with('"') {
        return Ok(text(&serde_json::from_str::<String>(json)?));
    }
    let is_number = json.starts_with(|one: char| one == '-' || one.is_ascii_digit());
    let Some((digits, exponent)) = json.split_once(['e', 'E']).filter(|_| is_number) else {
        return Ok(json.to_owned());
    };
    let point = if digits.contains('.') { "" } else { ".0" };
    let is_signed = exponent.starts_with(['-', '+']);
    let sign = if is_signed { "" } else { "+" };
    Ok(format!("{digits}{point}e{sign}{exponent}"))
}

/// A text, with quotes unless every reader reads it as a text without them.
fn text(value: &str) -> String {
    let begins = |one: char| one.is_ascii_alphabetic() || one == '/' || one == '_';
    let goes_on = |one: char| one.is_ascii_alphanumeric() || "/_.-+() ".contains(one);
    if value.starts_with(begins)
        && value.chars().all(goes_on)
        && !value.ends_with(' ')
        && !WORDS.contains(&value.to_ascii_lowercase().as_str())
    {
        return value.to_owned();
    }
    json_line(&Value::from(value).to_string())
}

//! The body of a message in either encoding: its sender, and a comparison with the sent body.

use crate::json::Json;

/// A message's body, in either encoding.
#[derive(Debug, Clone, Copy)]
pub(super) enum Body<'a> {
    Text(&'a str),
    Binary(&'a Json),
}

impl Body<'_> {
    /// Its publisher and its number.
    pub(super) fn origin(&self) -> Option<(u64, u64)> {
        let read = match self {
            Self::Text(text) => &Json::read(text)?,
            Self::Binary(msg) => *msg,
        };
        let number = |name: &str| read.get(name).and_then(Json::number).map(|one| one as u64);
        number("from").zip(number("number"))
    }

    /// Whether it equals the sent body: in every byte, or in another encoding in every value.
    pub(super) fn is(&self, sent: &str) -> bool {
        match self {
            Self::Text(text) => *text == sent,
            Self::Binary(msg) => Json::read(sent).is_some_and(|sent| are_same(&sent, msg)),
        }
    }
}

fn are_same(one: &Json, other: &Json) -> bool {
    match (one, other) {
        (Json::Number(_), Json::Number(_)) => one.number() == other.number(),
        (Json::Array(ones), Json::Array(others)) => {
            let mut pairs = ones.iter().zip(others);
            ones.len() == others.len() && pairs.all(|(one, other)| are_same(one, other))
        }
        (Json::Object(ones), Json::Object(others)) => {
            let all = |(key, one): &(Option<String>, Json)| {
                let found = key.as_deref().and_then(|key| other.get(key));
                found.is_some_and(|other| are_same(one, other))
            };
            ones.len() == others.len() && ones.iter().all(all)
        }
        _ => one == other,
    }
}

//! The rows of the catalog's tables: fields, message types, topics and services, each written in one expression.
//!
//! **Invariant:** a row is a constant. The catalog does not change while the program runs.

use super::node::Node;

/// One field of a message, a request or a response.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// Its key.
    pub name: &'static str,
    /// Its type in ROS notation: `float64`, `float64[]`, `bool`, `string`, `uint64`, `pkg/msg/Type`. `float64[][]`,
    /// one array per sample, is not a ROS type.
    pub kind: &'static str,
    /// Its unit: empty if it has none, `SI` if it differs between joints or depends on the controller.
    pub unit: &'static str,
    /// Whether a request must have it. Messages and responses always have every field.
    pub required: bool,
}

/// The number of values in a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Count {
    /// One.
    One,
    /// Any number, possibly up to a bound: `float64[]`, `float64[<=3]`.
    Any,
    /// A fixed number: `uint8[16]`.
    Exactly(usize),
}

impl Field {
    /// The field's type without brackets, and its number of values.
    #[must_use]
    pub fn element(&self) -> (&'static str, Count) {
        let array = self.kind.strip_suffix(']');
        match array.and_then(|kind| kind.rsplit_once('[')) {
            Some((kind, count)) => match count.parse() {
                Ok(count) => (kind, Count::Exactly(count)),
                Err(_) => (kind, Count::Any),
            },
            None => (self.kind, Count::One),
        }
    }
}

/// A field in the notation of `.msg` files, with its unit as a comment: `float64 x  # m`. A request may omit a field
/// whose name ends with `?`.
pub(crate) const fn field(text: &'static str) -> Field {
    let (kind, rest) = cut(text, b' ');
    let (spelled, unit) = cut(rest, b' ');
    let (name, _) = cut(spelled, b'?');
    let (_, unit) = cut(unit.trim_ascii(), b' ');
    Field {
        name,
        kind,
        unit,
        required: name.len() == spelled.len(),
    }
}

/// The text before the first `mark`, and the text after it; the whole text if there is none.
const fn cut(text: &'static str, mark: u8) -> (&'static str, &'static str) {
    let mut rest = text.as_bytes();
    let mut at = 0;
    while let [first, behind @ ..] = rest {
        if *first == mark {
            return (text.split_at(at).0, text.split_at(at + 1).1);
        }
        rest = behind;
        at += 1;
    }
    (text, "")
}

/// A list of fields. It is a separate constant, because a row borrows its lists for `'static`.
macro_rules! fields {
    ($($field:literal),* $(,)?) => { const { &[$($crate::protocol::catalog::field($field)),*] } };
}
pub(crate) use fields;

/// A message type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Type {
    /// Its name in ROS notation: `std_msgs/msg/Header`.
    pub name: &'static str,
    /// Its fields, in the order of the definition.
    pub fields: &'static [Field],
    /// Its constants: their type, then each with its value, `uint8 WARN=30 ERROR=40`. Empty if it has none.
    pub constants: &'static str,
}

/// A message type without constants.
pub(crate) const fn message(name: &'static str, fields: &'static [Field]) -> Type {
    Type {
        name,
        fields,
        constants: "",
    }
}

impl Type {
    /// The same type with constants.
    pub(crate) const fn with_constants(self, constants: &'static str) -> Self {
        Self { constants, ..self }
    }

    /// The type, the name and the value of each constant.
    pub fn constants(self) -> impl Iterator<Item = (&'static str, &'static str, &'static str)> {
        let (kind, all) = self.constants.split_once(' ').unwrap_or_default();
        let all = all.split_ascii_whitespace();
        all.filter_map(move |one| one.split_once('=').map(|(name, value)| (kind, name, value)))
    }
}

/// The publisher of a topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Direction {
    /// The runtime publishes. Clients can subscribe, but neither advertise nor publish.
    Published,
    /// The runtime subscribes. Any client may publish, also without an advertisement.
    Subscribed,
}

/// A row of the table of topics.
pub(super) struct TopicEntry {
    pub(super) name: &'static str,
    /// The node that publishes the topic or subscribes to it. The arm owns `/diagnostics`; the gateway adds a status.
    pub(super) owner: Node,
    pub(super) type_name: &'static str,
    pub(super) fields: &'static [Field],
    pub(super) constants: &'static str,
    pub(super) direction: Direction,
    pub(super) latched: bool,
    pub(super) supersedes: &'static [&'static str],
}

/// A topic that the runtime publishes.
pub(super) const fn published(
    name: &'static str,
    owner: Node,
    type_name: &'static str,
    fields: &'static [Field],
) -> TopicEntry {
    TopicEntry {
        name,
        owner,
        type_name,
        fields,
        constants: "",
        direction: Direction::Published,
        latched: false,
        supersedes: &[],
    }
}

/// A topic to which the runtime subscribes.
pub(super) const fn subscribed(
    name: &'static str,
    owner: Node,
    type_name: &'static str,
    fields: &'static [Field],
) -> TopicEntry {
    TopicEntry {
        direction: Direction::Subscribed,
        ..published(name, owner, type_name, fields)
    }
}

impl TopicEntry {
    /// A new subscriber gets the last message.
    pub(super) const fn latched(self) -> Self {
        Self {
            latched: true,
            ..self
        }
    }

    /// After a message, no earlier message of these topics may follow.
    pub(super) const fn supersedes(self, topics: &'static [&'static str]) -> Self {
        Self {
            supersedes: topics,
            ..self
        }
    }

    /// The topic's type has constants.
    pub(super) const fn constants(self, constants: &'static str) -> Self {
        Self { constants, ..self }
    }
}

/// A row of the tables of services.
pub(super) struct ServiceEntry {
    pub(super) name: &'static str,
    pub(super) type_name: &'static str,
    pub(super) owner: Node,
    pub(super) request: &'static [Field],
    pub(super) response: &'static [Field],
    pub(super) is_computation: bool,
    pub(super) null_is_absent: bool,
    pub(super) supersedes: &'static [&'static str],
}

/// A service with an empty request and an empty response.
pub(super) const fn service(
    name: &'static str,
    type_name: &'static str,
    owner: Node,
) -> ServiceEntry {
    ServiceEntry {
        name,
        type_name,
        owner,
        request: &[],
        response: &[],
        is_computation: false,
        null_is_absent: true,
        supersedes: &[],
    }
}

impl ServiceEntry {
    /// The fields of a request, in the order of a positional `args` array.
    pub(super) const fn request(self, request: &'static [Field]) -> Self {
        Self { request, ..self }
    }

    /// The fields of a response, in the order in which they are written.
    pub(super) const fn response(self, response: &'static [Field]) -> Self {
        Self { response, ..self }
    }

    /// The service is a pure computation, which may answer late and out of order.
    pub(super) const fn computation(self) -> Self {
        Self {
            is_computation: true,
            ..self
        }
    }

    /// `null` in an optional field does not mean absent. A field may accept it.
    pub(super) const fn null_is_refused(self) -> Self {
        Self {
            null_is_absent: false,
            ..self
        }
    }

    /// After an answer, no earlier message of these topics may follow.
    pub(super) const fn supersedes(self, topics: &'static [&'static str]) -> Self {
        Self {
            supersedes: topics,
            ..self
        }
    }
}

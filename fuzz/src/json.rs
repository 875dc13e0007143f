//! A second reading of JSON (RFC 8259), one character after the other, strict: every reader takes the texts that
//! it takes.
//!
//! Numbers keep their text. A string that holds half a surrogate pair is a string without a text.

/// A value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Json {
    /// `null`.
    Null,
    /// `true` or `false`.
    Boolean(bool),
    /// A number, as it is written.
    Number(String),
    /// A string, unless it holds half a surrogate pair.
    Text(Option<String>),
    /// An array.
    Array(Vec<Json>),
    /// An object's members in their order; a key may be no text, and may come twice.
    Object(Vec<(Option<String>, Json)>),
}

impl Json {
    /// Reads a text that is one value.
    #[must_use]
    pub fn read(text: &str) -> Option<Self> {
        let mut reading = Reading(text);
        let value = reading.value()?;
        reading.skip_space();
        reading.0.is_empty().then_some(value)
    }

    /// The member of that name, the last one where there are several.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Self> {
        let Self::Object(members) = self else {
            return None;
        };
        let mut named = members.iter().rev();
        let found = named.find(|(key, _)| key.as_deref() == Some(name));
        found.map(|(_, value)| value)
    }

    /// The text of a string.
    #[must_use]
    pub fn text(&self) -> Option<&str> {
        match self {
            Self::Text(text) => text.as_deref(),
            _ => None,
        }
    }

    /// The value of a number, infinite where it overflows.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(text) => text.parse().ok(),
            _ => None,
        }
    }

    /// Whether a number in it overflows an `f64`.
    #[must_use]
    pub fn overflows(&self) -> bool {
        match self {
            Self::Number(_) => self.number().is_some_and(f64::is_infinite),
            Self::Array(entries) => entries.iter().any(Self::overflows),
            Self::Object(members) => members.iter().any(|(_, value)| value.overflows()),
            _ => false,
        }
    }
}

struct Reading<'a>(&'a str);

impl Reading<'_> {
    fn skip_space(&mut self) {
        self.0 = self.0.trim_start_matches([' ', '\t', '\r', '\n']);
    }

    fn takes(&mut self, word: &str) -> bool {
        let rest = self.0.strip_prefix(word);
        self.0 = rest.unwrap_or(self.0);
        rest.is_some()
    }

    fn value(&mut self) -> Option<Json> {
        self.skip_space();
        match self.0.chars().next()? {
            'n' => self.takes("null").then_some(Json::Null),
            't' => self.takes("true").then_some(Json::Boolean(true)),
            'f' => self.takes("false").then_some(Json::Boolean(false)),
            '"' => self.string().map(Json::Text),
            '[' => self.array(),
            '{' => self.object(),
            _ => self.number(),
        }
    }

    fn array(&mut self) -> Option<Json> {
        self.takes("[");
        let mut entries = Vec::new();
        self.skip_space();
        if self.takes("]") {
            return Some(Json::Array(entries));
        }
        loop {
            entries.push(self.value()?);
            self.skip_space();
            if self.takes("]") {
                return Some(Json::Array(entries));
            }
            if !self.takes(",") {
                return None;
            }
        }
    }

    fn object(&mut self) -> Option<Json> {
        self.takes("{");
        let mut members = Vec::new();
        self.skip_space();
        if self.takes("}") {
            return Some(Json::Object(members));
        }
        loop {
            self.skip_space();
            let key = self.string()?;
            self.skip_space();
            if !self.takes(":") {
                return None;
            }
            members.push((key, self.value()?));
            self.skip_space();
            if self.takes("}") {
                return Some(Json::Object(members));
            }
            if !self.takes(",") {
                return None;
            }
        }
    }

    fn string(&mut self) -> Option<Option<String>> {
        if !self.takes("\"") {
            return None;
        }
        let mut units = Vec::new();
        loop {
            let character = self.0.chars().next()?;
            self.0 = &self.0[character.len_utf8()..];
            match character {
                '"' => return Some(String::from_utf16(&units).ok()),
                '\\' => units.push(self.escape()?),
                '\0'..=' ' if character != ' ' => return None,
                _ => units.extend_from_slice(character.encode_utf16(&mut [0; 2])),
            }
        }
    }

    fn escape(&mut self) -> Option<u16> {
        let character = self.0.chars().next()?;
        self.0 = &self.0[character.len_utf8()..];
        let plain = match character {
            '"' | '\\' | '/' => character,
            'b' => '\u{8}',
            'f' => '\u{c}',
            'n' => '\n',
            'r' => '\r',
            't' => '\t',
            'u' => {
                let digits = self.0.get(..4)?;
                self.0 = &self.0[4..];
                let are_digits = digits.bytes().all(|byte| byte.is_ascii_hexdigit());
                return are_digits.then(|| u16::from_str_radix(digits, 16).ok())?;
            }
            _ => return None,
        };
        u16::try_from(u32::from(plain)).ok()
    }

    fn number(&mut self) -> Option<Json> {
        let text = self.0;
        self.takes("-");
        if !self.takes("0") {
            self.digits()?;
        }
        if self.takes(".") {
            self.digits()?;
        }
        if self.takes("e") || self.takes("E") {
            let _ = self.takes("+") || self.takes("-");
            self.digits()?;
        }
        let length = text.len() - self.0.len();
        Some(Json::Number(text[..length].to_owned()))
    }

    /// At least one digit.
    fn digits(&mut self) -> Option<()> {
        let rest = self.0.trim_start_matches(|one: char| one.is_ascii_digit());
        let some = rest.len() < self.0.len();
        self.0 = rest;
        some.then_some(())
    }
}

//! A decoder of CBOR, as far as it is sent.

/// A CBOR value.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Cbor {
    Integer(i128),
    Float(f64),
    Text(String),
    Bytes(Vec<u8>),
    Array(Vec<Cbor>),
    Map(Vec<(String, Cbor)>),
    Floats(Vec<f64>),
    Simple(u8),
}

impl Cbor {
    pub(super) fn read(bytes: &[u8]) -> Self {
        let mut rest = bytes;
        let value = Self::next(&mut rest);
        assert!(rest.is_empty(), "{} bytes behind the value", rest.len());
        value
    }

    fn take<'a>(rest: &mut &'a [u8], count: usize) -> &'a [u8] {
        let (taken, behind) = rest.split_at(count);
        *rest = behind;
        taken
    }

    fn next(rest: &mut &[u8]) -> Self {
        let first = Self::take(rest, 1)[0];
        let (major, short) = (first >> 5, first & 31);
        if major == 7 {
            return match short {
                27 => Self::Float(f64::from_be_bytes(Self::take(rest, 8).try_into().unwrap())),
                simple => Self::Simple(simple),
            };
        }
        let number = match short {
            0..=23 => u64::from(short),
            24..=27 => Self::take(rest, 1 << (short - 24))
                .iter()
                .fold(0, |number, byte| number << 8 | u64::from(*byte)),
            other => panic!("no length: {other}"),
        };
        let count = usize::try_from(number).unwrap();
        match major {
            0 => Self::Integer(number.into()),
            1 => Self::Integer(-1 - i128::from(number)),
            2 => Self::Bytes(Self::take(rest, count).to_vec()),
            3 => Self::Text(String::from_utf8(Self::take(rest, count).to_vec()).unwrap()),
            4 => Self::Array((0..count).map(|_| Self::next(rest)).collect()),
            5 => Self::Map(
                (0..count)
                    .map(|_| match Self::next(rest) {
                        Self::Text(key) => (key, Self::next(rest)),
                        other => panic!("not a key: {other:?}"),
                    })
                    .collect(),
            ),
            _ => match (number, Self::next(rest)) {
                (86, Self::Bytes(bytes)) => Self::Floats(
                    bytes
                        .chunks_exact(8)
                        .map(|chunk| f64::from_le_bytes(chunk.try_into().unwrap()))
                        .collect(),
                ),
                (tag, tagged) => panic!("tag {tag} of {tagged:?}"),
            },
        }
    }

    pub(super) fn get(&self, key: &str) -> &Self {
        let Self::Map(members) = self else {
            panic!("no map: {self:?}");
        };
        let found = members.iter().find(|(one, _)| one == key);
        &found.unwrap_or_else(|| panic!("no {key} in {self:?}")).1
    }

    pub(super) fn text(&self) -> &str {
        match self {
            Self::Text(text) => text,
            other => panic!("no text: {other:?}"),
        }
    }
}

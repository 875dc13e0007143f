//! The form in which a subscriber wants its messages: compression and pieces.

use pendularm::protocol::op::{Compression, Encoding, Op};

use super::op;

#[track_caller]
fn encoding(more: &str) -> Encoding {
    match op(&format!(r#"{{"op":"subscribe","topic":"/x"{more}}}"#)) {
        Op::Subscribe(subscribe) => subscribe.encoding,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_subscription_comes_as_json_in_one_piece_unless_it_says_otherwise() {
    assert_eq!(encoding(""), Encoding::default());
    for (name, compression) in [
        ("none", Compression::None),
        ("png", Compression::None),
        ("cbor", Compression::Cbor),
        ("cbor-raw", Compression::CborRaw),
    ] {
        let found = encoding(&format!(r#","compression":"{name}""#));
        assert_eq!(found.compression, compression, "{name}");
        assert_eq!(found.fragment_size, None);
    }
    assert_eq!(encoding(r#","fragment_size":1"#).fragment_size, Some(1));
    assert_eq!(encoding(r#","fragment_size":null"#).fragment_size, None);
    for binary in ["cbor", "cbor-raw"] {
        let found = encoding(&format!(r#","compression":"{binary}","fragment_size":100"#));
        assert_eq!(found.fragment_size, None, "{binary} is not cut up");
    }
}

#[test]
fn of_two_encodings_the_denser_and_the_smaller_pieces_count() {
    let one = |compression, fragment_size| Encoding {
        compression,
        fragment_size,
        ros1_stamps: false,
    };
    for (first, second, both) in [
        (
            one(Compression::None, Some(12)),
            one(Compression::None, Some(9)),
            one(Compression::None, Some(9)),
        ),
        (
            one(Compression::None, None),
            one(Compression::None, Some(9)),
            one(Compression::None, Some(9)),
        ),
        (
            one(Compression::CborRaw, None),
            one(Compression::Cbor, None),
            one(Compression::CborRaw, None),
        ),
        // Binary frames are not cut up: their subscribers share them, whatever size they give besides.
        (
            one(Compression::None, Some(9)),
            one(Compression::Cbor, Some(5)),
            one(Compression::Cbor, None),
        ),
    ] {
        assert_eq!(first.merged(second), both);
        assert_eq!(second.merged(first), both);
    }
}

//! Pieces of long messages.
//!
//! **Invariant:** a message about bad input is compared whole: it is what its sender has to go by.

use pendularm::protocol::limits::MAX_NAME;
use pendularm::protocol::op::Op;
use pendularm::protocol::wire::fragments::Piece;

use super::{op, problem};

#[test]
fn a_fragment_is_a_piece_with_its_number_and_how_many_there_are() {
    let fragment = op(r#"{"op":"fragment","id":7,"data":"a\"b","num":1,"total":3}"#);
    let Op::Fragment(piece) = fragment else {
        panic!("{fragment:?}");
    };
    assert_eq!(
        piece,
        Piece {
            id: "7".to_owned(),
            data: "a\"b".to_owned(),
            num: 1,
            total: 3,
        }
    );
}

#[test]
fn a_fragment_without_a_member_or_with_a_bad_one_is_refused_by_its_name() {
    let long = "x".repeat(MAX_NAME);
    for (more, message) in [
        (
            r#""data":"x","num":0,"total":1"#.to_owned(),
            "fragment: id is required".to_owned(),
        ),
        (
            r#""id":1,"num":0,"total":1"#.to_owned(),
            "fragment: data is required".to_owned(),
        ),
        (
            r#""id":1,"data":5,"num":0,"total":1"#.to_owned(),
            "fragment: data must be a string, got 5".to_owned(),
        ),
        (
            r#""id":1,"data":"x","total":1"#.to_owned(),
            "fragment: num is required".to_owned(),
        ),
        (
            r#""id":1,"data":"x","num":-1,"total":1"#.to_owned(),
            "fragment: num must be an integer, at least 0, got -1".to_owned(),
        ),
        (
            r#""id":1,"data":"x","num":0,"total":1.5"#.to_owned(),
            "fragment: total must be an integer, at least 0, got 1.5".to_owned(),
        ),
        (
            // The quotes count: an id is any JSON value.
            format!(r#""id":"{long}","data":"x","num":0,"total":1"#),
            format!(
                "fragment: id must be at most {MAX_NAME} bytes long, got {}",
                MAX_NAME + 2
            ),
        ),
    ] {
        let frame = format!(r#"{{"op":"fragment",{more}}}"#);
        assert_eq!(problem(&frame), message);
    }
}

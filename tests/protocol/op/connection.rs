//! Operations about the connection itself: levels of statuses, the form of errors, the token.

use pendularm::protocol::limits::MAX_NAME;
use pendularm::protocol::messages::{ErrorForm, Level};
use pendularm::protocol::op::Op;

use super::{op, status};

#[test]
fn a_level_is_one_of_four_and_says_which_statuses_are_wanted() {
    for (name, wanted) in [
        ("info", [true, true, true]),
        ("warning", [false, true, true]),
        ("error", [false, false, true]),
        ("none", [false, false, false]),
    ] {
        let frame = format!(r#"{{"op":"set_level","level":"{name}"}}"#);
        let Op::SetLevel { verbosity, errors } = op(&frame) else {
            panic!("{name} is a level");
        };
        assert_eq!(errors, None);
        assert_eq!(Level::ALL.map(|level| verbosity.wants(level)), wanted);
    }
}

#[test]
fn the_form_of_errors_is_one_of_two() {
    for (name, form) in [("object", ErrorForm::Object), ("text", ErrorForm::Text)] {
        let frame = format!(r#"{{"op":"set_level","level":"none","errors":"{name}"}}"#);
        let Op::SetLevel { errors, .. } = op(&frame) else {
            panic!("{name} is a form");
        };
        assert_eq!(errors, Some(form));
    }
}

#[test]
fn a_token_is_a_string_and_what_is_wrong_with_it_is_told_without_repeating_it() {
    let Op::Auth { token, is_command } = op(r#"{"op":"auth","token":"secr\u0065t"}"#) else {
        panic!("it shows a token");
    };
    assert_eq!((token.as_deref(), is_command), (Some("secret"), false));
    assert_eq!(status(r#"{"op":"auth"}"#), "auth: token is required");
    let mistyped = status(r#"{"op":"auth","token":["secret"]}"#);
    assert!(mistyped.starts_with("auth: token must be a string") && !mistyped.contains("secret"));
    let long = format!(r#"{{"op":"auth","token":"{}"}}"#, "s".repeat(MAX_NAME + 1));
    assert!(status(&long).contains("at most 1024 bytes"));
}

#[test]
fn a_command_of_this_program_says_so_and_needs_no_token() {
    for (members, shown, commands) in [
        (r#""command":true"#, None, true),
        (r#""command":true,"token":"secret""#, Some("secret"), true),
        (r#""command":false,"token":"secret""#, Some("secret"), false),
    ] {
        let Op::Auth { token, is_command } = op(&format!(r#"{{"op":"auth",{members}}}"#)) else {
            panic!("{members} is an auth");
        };
        assert_eq!((token.as_deref(), is_command), (shown, commands));
    }
    assert_eq!(
        status(r#"{"op":"auth","command":false}"#),
        "auth: token is required"
    );
    let mistyped = status(r#"{"op":"auth","command":1,"token":"secret"}"#);
    assert!(
        mistyped.starts_with("auth: command must be true or false"),
        "{mistyped}"
    );
}

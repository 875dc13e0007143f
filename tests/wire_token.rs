//! The token: every door asks for it, and opens to nothing else.
//!
//! **Invariant:** without the token nothing is done, whatever is sent and however.

#![allow(
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::needless_pass_by_value,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a helper of a test fails by panicking, as a test does; it reads best called with a value"
)]

mod common;
#[cfg(feature = "web")]
mod web_client;

use std::net::SocketAddr;

use common::{Client, Runtime};
use pendularm::actors::connection::gate::MAX_LOCKED;
use serde_json::json;
#[cfg(feature = "web")]
use web_client::{Socket, get, handshake, request, try_handshake};

const TOKEN: &str = "s3cret-&%;=\"token";
/// The same as a query and a cookie carry it.
#[cfg(feature = "web")]
const ENCODED: &str = "s3cret-%26%25%3B%3D%22token";

fn guarded() -> Runtime {
    Runtime::with(&["--token", TOKEN])
}

/// The one line that a client gets which is not let in.
fn explanation(client: &mut Client) -> String {
    let status = client.receive();
    assert_eq!(status["level"], "error", "{status}");
    assert!(client.is_closed());
    status["msg"].as_str().unwrap().to_owned()
}

fn assert_untouched(runtime: &Runtime) {
    let mut client = runtime.connect();
    client.send(&json!({"op": "auth", "token": TOKEN}));
    let parameters = client.ask("/arm_sim/set_params", json!({}));
    assert_eq!(parameters["gravity"], 9.81);
}

#[test]
fn over_tcp_the_first_frame_shows_the_token_and_the_rest_is_as_ever() {
    let runtime = guarded();
    let mut client = runtime.connect();
    client.send(&json!({"op": "auth", "token": TOKEN, "id": 1}));
    client.subscribe("/clock");
    client.message("/clock");
    client.settle();
    // Once in, showing it again changes nothing.
    client.send(&json!({"op": "auth", "token": "another"}));
    client.settle();
}

#[test]
fn a_client_that_begins_otherwise_is_told_so_and_closed_with_nothing_done() {
    let runtime = guarded();
    let set =
        json!({"op": "call_service", "service": "/arm_sim/set_params", "args": {"gravity": 1}});
    for first in [
        set.to_string(),
        "nonsense".to_owned(),
        "{}".to_owned(),
        json!({"op": "auth"}).to_string(),
        json!({"op": "auth", "token": 5}).to_string(),
        json!({"op": "Auth", "token": TOKEN}).to_string(),
    ] {
        let mut client = runtime.connect();
        client.send_bytes(format!("{first}\n{set}\n").as_bytes());
        let why = explanation(&mut client);
        assert!(why.contains("\"op\":\"auth\""), "{why}");
    }
    assert_untouched(&runtime);
}

#[test]
fn a_wrong_token_closes_and_the_right_one_behind_it_comes_too_late() {
    let runtime = guarded();
    for wrong in [
        "",
        "s3cret",
        &format!("{TOKEN}x"),
        &TOKEN.to_uppercase(),
        &"x".repeat(10_000),
    ] {
        let mut client = runtime.connect();
        let frames = [
            json!({"op": "auth", "token": wrong}),
            json!({"op": "auth", "token": TOKEN}),
            json!({"op": "call_service", "service": "/arm_sim/set_params", "args": {"gravity": 1}}),
        ];
        for frame in frames {
            client.send(&frame);
        }
        let why = explanation(&mut client);
        assert!(why.contains("token") && !why.contains(TOKEN), "{why}");
    }
    assert_untouched(&runtime);
}

#[test]
fn a_client_that_sends_much_before_the_token_is_closed() {
    let runtime = guarded();
    let mut client = runtime.connect();
    let pad = "x".repeat(100_000);
    client.send(&json!({"op": "auth", "pad": pad, "token": TOKEN}));
    // Both are right: whether the frame is seen whole or in parts is the network's choice.
    client.send(&json!({"op": "call_service", "service": "/arm_sim/pause", "id": 1}));
    let first = client.receive();
    assert!(
        first["id"] == 1 || first["msg"].as_str().unwrap().contains("16384 bytes"),
        "{first}"
    );
    let mut client = runtime.connect();
    client.send_bytes("{\"pad\":\"".as_bytes());
    client.send_bytes(&vec![b'x'; MAX_LOCKED]);
    assert!(explanation(&mut client).contains("16384 bytes"));
}

#[test]
fn without_a_token_to_ask_for_any_that_is_shown_will_do() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send(&json!({"op": "auth", "token": "whatever"}));
    client.settle();
    assert!(client.kept.is_empty());
}

#[test]
fn an_address_that_others_can_reach_is_served_with_a_token() {
    let runtime = Runtime::with_bind("0.0.0.0:0", &["--token", TOKEN]);
    assert!(runtime.address.ip().is_unspecified());
    let address = SocketAddr::from(([127, 0, 0, 1], runtime.address.port()));
    let mut client = Client::to(address);
    client.send(&json!({"op": "auth", "token": TOKEN}));
    client.settle();
    #[cfg(feature = "web")]
    {
        assert_eq!(get(address, &format!("/?token={ENCODED}")).status, 200);
        assert_eq!(get(address, "/").status, 403);
    }
}

#[cfg(feature = "web")]
#[test]
fn over_http_the_query_shows_the_token_once_and_leaves_a_cookie() {
    let runtime = guarded();
    let address = runtime.address;
    for path in ["/", "/main.js", "/report/", "/nothing"] {
        let refused = get(address, path);
        assert_eq!(refused.status, 403, "{path}");
        assert!(refused.text().contains("?token="), "{}", refused.text());
        assert_eq!(refused.header("set-cookie"), None);
    }
    let page = get(address, &format!("/?token={ENCODED}"));
    assert_eq!(page.status, 200);
    let cookie = page.header("set-cookie").unwrap();
    let name = format!("pendularm_{}", address.port());
    assert_eq!(
        cookie,
        format!("{name}={ENCODED}; Path=/; HttpOnly; SameSite=Strict")
    );

    let shown = format!("Host: {address}\r\nCookie: other=1; {name}={ENCODED}\r\n");
    let again = request(address, "/main.js", &shown);
    assert_eq!((again.status, again.header("set-cookie")), (200, None));
}

#[cfg(feature = "web")]
#[test]
fn a_wrong_token_in_the_query_or_the_cookie_is_a_403() {
    let runtime = guarded();
    let address = runtime.address;
    for query in [
        "token=wrong",
        "token=",
        "token",
        "Token=s3cret",
        "x=token%3D",
        "token=%ff",
        "token=%",
    ] {
        let refused = get(address, &format!("/?{query}"));
        assert_eq!(refused.status, 403, "{query}");
        assert_eq!(refused.header("set-cookie"), None);
        assert!(!refused.text().contains("s3cret"));
    }
    let name = format!("pendularm_{}", address.port());
    for cookie in [
        format!("{name}=wrong"),
        format!("{name}="),
        format!("pendularm_1={ENCODED}"),
        format!("x{name}={ENCODED}"),
    ] {
        let headers = format!("Host: {address}\r\nCookie: {cookie}\r\n");
        assert_eq!(request(address, "/", &headers).status, 403, "{cookie}");
    }
}

#[cfg(feature = "web")]
#[test]
fn a_websocket_needs_the_token_in_its_query_or_the_cookie_and_then_no_auth() {
    let runtime = guarded();
    let address = runtime.address;
    let (status, body) = try_handshake(address, "/", &handshake(address));
    assert_eq!(status, 403);
    assert!(body.contains("?token="), "{body}");
    assert_eq!(
        try_handshake(address, "/?token=wrong", &handshake(address)).0,
        403
    );

    Socket::open_with(address, &format!("/?token={ENCODED}"), &[]).settle();
    let cookie = format!("pendularm_{}={ENCODED}", address.port());
    let mut socket = Socket::open_with(address, "/", &[("cookie", &cookie)]);
    socket.settle();
    socket.send(&json!({"op": "auth", "token": TOKEN}));
    socket.settle();
}

/// The token is no pass for a foreign page: a browser would send the cookie along.
#[cfg(feature = "web")]
#[test]
fn with_the_token_host_and_origin_are_asked_all_the_same() {
    let runtime = guarded();
    let address = runtime.address;
    let target = format!("/?token={ENCODED}");
    let origin = handshake(address) + "Origin: https://evil.example\r\n";
    assert_eq!(try_handshake(address, &target, &origin).0, 403);
    let host = format!("Host: evil.example:{}\r\n", address.port());
    assert_eq!(request(address, &target, &host).status, 403);
}

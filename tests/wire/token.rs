//! The token: every door asks for it, and opens to nothing else.
//!
//! **Invariant:** without the token nothing is done, whatever is sent and however.

#[cfg(feature = "web")]
use std::net::SocketAddr;

use crate::common::{Client, Runtime, SET_GRAVITY};
#[cfg(feature = "web")]
use crate::web_client::{Socket, get, handshake, request, try_handshake};
use pendularm::actors::gateway::connection::admission::MAX_AUTH_BYTES;
use serde_json::json;

const TOKEN: &str = "s3cret-&%;=\"token";
/// The same as a query and a cookie carry it.
#[cfg(feature = "web")]
const ENCODED: &str = "%73%33%63%72%65%74%2D%26%25%3B%3D%22%74%6F%6B%65%6E";

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
fn a_client_that_begins_otherwise_or_with_a_wrong_token_is_closed_with_nothing_done() {
    let runtime = guarded();
    let shown = |token: &str| json!({"op": "auth", "token": token}).to_string();
    for (first, word) in [
        (SET_GRAVITY.trim_end().to_owned(), "\"op\":\"auth\""),
        ("nonsense".to_owned(), "\"op\":\"auth\""),
        ("{}".to_owned(), "\"op\":\"auth\""),
        (json!({"op": "auth"}).to_string(), "\"op\":\"auth\""),
        (
            json!({"op": "auth", "token": 5}).to_string(),
            "\"op\":\"auth\"",
        ),
        (
            json!({"op": "Auth", "token": TOKEN}).to_string(),
            "\"op\":\"auth\"",
        ),
        (shown(""), "token"),
        (shown("s3cret"), "token"),
        (shown(&format!("{TOKEN}x")), "token"),
        (shown(&TOKEN.to_uppercase()), "token"),
        (shown(&"x".repeat(10_000)), "token"),
    ] {
        let mut client = runtime.connect();
        // The right one behind it comes too late.
        client.send_bytes(format!("{first}\n{}\n{SET_GRAVITY}", shown(TOKEN)).as_bytes());
        let why = explanation(&mut client);
        assert!(why.contains(word) && !why.contains(TOKEN), "{why}");
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
    client.send_bytes(&vec![b'x'; MAX_AUTH_BYTES]);
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

    Socket::open_with(address, &format!("/?token={ENCODED}"), "").settle();
    let cookie = format!("pendularm_{}={ENCODED}", address.port());
    let mut socket = Socket::open_with(address, "/", &format!("Cookie: {cookie}\r\n"));
    socket.settle();
    socket.send(&json!({"op": "auth", "token": TOKEN}));
    socket.settle();
}

/// A browser sends the cookie along from every port of its host, so a page of another port is a foreign one.
#[cfg(feature = "web")]
#[test]
fn with_a_token_a_page_must_be_our_own_port_included_unless_it_is_named() {
    let named = "http://localhost:3000";
    let runtime = Runtime::with(&["--token", TOKEN, "--allow-origin", named]);
    let (address, port) = (runtime.address, runtime.address.port());
    let cookie = format!("Cookie: pendularm_{port}={ENCODED}\r\n");
    for (origin, expected) in [
        (format!("http://{address}"), 101),
        (format!("HTTP://{address}"), 101),
        (named.to_owned(), 101),
        (format!("http://localhost:{port}"), 403),
        (format!("http://[::1]:{port}"), 403),
        (format!("http://127.0.0.2:{port}"), 403),
        (format!("https://{address}"), 403),
        (format!("ws://{address}"), 403),
        (format!("http://{address}/"), 403),
        (format!("http://{address}@localhost:3000"), 403),
        (format!("http://127.0.0.1.:{port}"), 403),
        ("http://127.0.0.1".to_owned(), 403),
        ("http://127.0.0.1:3000".to_owned(), 403),
        ("http://localhost:3001".to_owned(), 403),
        ("http://localhost".to_owned(), 403),
        ("http://[::1]:5173".to_owned(), 403),
        ("null".to_owned(), 403),
        ("file://".to_owned(), 403),
        (String::new(), 403),
        (format!("http://{address}\r\nOrigin: http://{address}"), 403),
    ] {
        let headers = handshake(address) + &cookie + &format!("Origin: {origin}\r\n");
        let (status, _) = try_handshake(address, "/", &headers);
        assert_eq!(status, expected, "{origin}");
    }
}

/// How the token is shown over HTTP: a target, a cookie and the status. `TOKEN` is the token as a query and a cookie carry
/// it, `NAME` the cookie's name.
const SHOWN: [(&str, &str, u16); 27] = [
    // Its characters may be written as bytes, its name may not.
    ("/?token=%733cret-%26%25%3B%3D%22token", "", 200),
    ("/?a=b&token=TOKEN&token=x", "", 200),
    ("/?token=x&token=TOKEN", "", 403),
    ("/?%74oken=TOKEN", "", 403),
    ("/?Token=TOKEN", "", 403),
    ("/?a=b;token=TOKEN", "", 403),
    ("/?token=TOKEN%00", "", 403),
    ("/?token=%733cret-%2526%25%3B%3D%22token", "", 403),
    ("/?token=%73+3cret-%26%25%3B%3D%22token", "", 403),
    ("/?token=wrong", "", 403),
    ("/?token=", "", 403),
    ("/?token", "", 403),
    ("/?Token=s3cret", "", 403),
    ("/?x=token%3D", "", 403),
    ("/?token=%ff", "", 403),
    ("/?token=%", "", 403),
    ("/TOKEN", "", 403),
    ("/", "NAME=TOKEN", 200),
    ("/", "a=NAME; NAME=TOKEN; b", 200),
    ("/", "NAME=x; NAME=TOKEN", 403),
    ("/", "NAME=wrong", 403),
    ("/", "NAME=", 403),
    ("/", "pendularm_1=TOKEN", 403),
    ("/", "xNAME=TOKEN", 403),
    ("/", "NAME =TOKEN", 403),
    ("/", "NAME=\"TOKEN\"", 403),
    // The token in the query goes before the cookie.
    ("/?token=x", "NAME=TOKEN", 403),
];

#[cfg(feature = "web")]
#[test]
fn the_token_is_shown_in_one_way_and_no_other_spelling_counts() {
    let runtime = guarded();
    let (address, port) = (runtime.address, runtime.address.port());
    let name = format!("pendularm_{port}");
    for (target, cookie, expected) in SHOWN {
        let target = target.replace("TOKEN", ENCODED);
        let cookie = cookie.replace("NAME", &name).replace("TOKEN", ENCODED);
        let headers = format!("Host: {address}\r\nCookie: {cookie}\r\n");
        let answer = request(address, &target, &headers);
        assert_eq!(answer.status, expected, "{target} {cookie}");
        assert!(expected == 200 || answer.header("set-cookie").is_none());
        assert!(!answer.text().contains("s3cret"));
    }
    // A header of that name, and credentials as other servers take them, are nothing here.
    for header in [
        format!("Authorization: Bearer {TOKEN}"),
        format!("Token: {TOKEN}"),
        format!("Set-Cookie: {name}={ENCODED}"),
        format!("X: y\r\n Cookie: {name}={ENCODED}"),
        format!("Cookie : {name}={ENCODED}"),
    ] {
        let status = request(address, "/", &format!("Host: {address}\r\n{header}\r\n")).status;
        assert!(status == 403 || status == 400, "{header}: {status}");
    }
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

//! The host that a request names: ours, those that are allowed, and all others.

use crate::common::Runtime;
use crate::web_client::{Answer, exchange, request};

#[test]
fn loopbacks_names_are_our_hosts_at_every_port() {
    let runtime = Runtime::start();
    let port = runtime.address.port();
    for host in [
        "localhost",
        "LOCALHOST",
        "127.0.0.1",
        "[::1]",
        "[0:0::1]",
        "127.0.0.2",
    ] {
        // A tunnel or a proxy has a port of its own, and a browser leaves out that of its scheme.
        for port in [
            format!(":{port}"),
            String::new(),
            ":80".to_owned(),
            ":8443".to_owned(),
        ] {
            let answer = request(runtime.address, "/", &format!("Host: {host}{port}\r\n"));
            assert_eq!(answer.status, 200, "{host}{port}");
        }
    }
}

#[test]
fn any_other_host_is_a_403_that_names_the_option() {
    let runtime = Runtime::start();
    let port = runtime.address.port();
    let hosts = [
        format!("evil.example:{port}"),
        format!("localhost.evil.example:{port}"),
        format!("127.0.0.1.evil.example:{port}"),
        "evil.example".to_owned(),
        "evil.example:80".to_owned(),
        "localhost:65536".to_owned(),
        format!("user@localhost:{port}"),
        format!("localhost:{port}:{port}"),
        format!("0.0.0.0:{port}"),
        // Other spellings of this machine, which some resolvers read as such and browsers don't send.
        format!("localhost.:{port}"),
        format!("127.0.0.1.:{port}"),
        format!("127.1:{port}"),
        format!("2130706433:{port}"),
        format!("0x7f.0.0.1:{port}"),
        format!("0177.0.0.1:{port}"),
        format!("local%68ost:{port}"),
        format!("[::ffff:127.0.0.1]:{port}"),
        format!("[::1%25lo]:{port}"),
        format!("[127.0.0.1]:{port}"),
        format!("::1:{port}"),
        format!("[::1:{port}"),
        format!("localhost:+{port}"),
        format!("localhost:{port}a"),
        "localhost:".to_owned(),
        format!("localhost :{port}"),
        format!("localhost:{port}, localhost:{port}"),
        format!("http://localhost:{port}"),
        String::new(),
        "<script>alert(1)</script>".to_owned(),
    ];
    for host in hosts {
        for path in ["/", "/main.js", "/report/", "/nothing"] {
            let answer = request(runtime.address, path, &format!("Host: {host}\r\n"));
            assert_eq!(answer.status, 403, "{host}");
            assert!(answer.text().contains("--allow-host"), "{host}");
            assert!(answer.text().contains(&format!("http://localhost:{port}/")));
            // The part of the request that it repeats is plain text.
            assert_eq!(
                answer.header("content-type"),
                Some("text/plain; charset=utf-8")
            );
            assert_eq!(answer.header("x-content-type-options"), Some("nosniff"));
        }
    }
}

/// Ways to say another host beside the header: none of them is heard, and none of them lets a foreign header in.
#[test]
fn nothing_but_the_one_host_header_says_the_host() {
    let runtime = Runtime::start();
    let address = runtime.address;
    for (head, status) in [
        (
            format!("GET http://{address}/ HTTP/1.1\r\nHost: {address}\r\n"),
            400,
        ),
        (
            format!("GET http://{address}/ HTTP/1.1\r\nHost: evil.example\r\n"),
            400,
        ),
        (
            format!("GET //{address}/ HTTP/1.1\r\nHost: evil.example\r\n"),
            403,
        ),
        (
            format!("GET {address} HTTP/1.1\r\nHost: {address}\r\n"),
            400,
        ),
        (
            format!("GET / HTTP/1.1\r\nHost: evil.example\r\nX-Forwarded-Host: {address}\r\n"),
            403,
        ),
        (
            format!("GET / HTTP/1.1\r\nHost: evil.example\r\nhOST: {address}\r\n"),
            400,
        ),
        (
            format!("GET / HTTP/1.1\r\nHost: {address}\r\nHost: {address}\r\n"),
            400,
        ),
        (
            format!("GET / HTTP/1.1\r\nHost: evil.example\r\n Host: {address}\r\n"),
            400,
        ),
        (format!("GET / HTTP/1.1\r\nHost : {address}\r\n"), 400),
        (format!("GET / HTTP/1.1\r\n Host: {address}\r\n"), 400),
        (format!("GET / HTTP/1.1\r\nX: y\rHost: {address}\r\n"), 400),
        ("GET / HTTP/1.0\r\n".to_owned(), 400),
        (format!("GET / HTTP/1.0\r\nHost: {address}\r\n"), 200),
        (format!("GET / HTTP/1.1\r\nHost:\t {address} \t\r\n"), 200),
    ] {
        let answer = Answer::parse(&exchange(address, format!("{head}\r\n").as_bytes()));
        assert_eq!(answer.status, status, "{head}");
    }
}

#[test]
fn a_request_without_a_host_or_with_two_is_a_400() {
    let runtime = Runtime::start();
    let two = format!("Host: {0}\r\nHost: {0}\r\n", runtime.address);
    for headers in ["", &two] {
        let answer = request(runtime.address, "/", headers);
        assert_eq!(answer.status, 400);
        assert!(answer.text().contains("Host"));
    }
}

#[test]
fn an_allowed_host_is_ours_too() {
    let allowed = "robot.local,Arm.Example.,proxy.example:443,odd.example:8443,[fd00::5]";
    let runtime = Runtime::with(&["--allow-host", allowed]);
    let port = runtime.address.port();
    for (host, status) in [
        (format!("arm.example:{port}"), 200),
        (format!("Arm.Example:{port}"), 200),
        ("arm.example.".to_owned(), 200),
        ("arm.example..".to_owned(), 403),
        ("robot.local".to_owned(), 200),
        ("robot.local.".to_owned(), 200),
        ("ROBOT.local:443".to_owned(), 200),
        ("robot.local:80".to_owned(), 200),
        ("robot.local:8443".to_owned(), 200),
        ("xrobot.local".to_owned(), 403),
        ("robot.local.evil.example".to_owned(), 403),
        ("proxy.example:443".to_owned(), 200),
        ("proxy.example".to_owned(), 200),
        (format!("proxy.example:{port}"), 403),
        ("odd.example:8443".to_owned(), 200),
        ("odd.example".to_owned(), 403),
        ("[fd00::5]".to_owned(), 200),
        ("[FD00:0::5]:80".to_owned(), 200),
        ("[fd00::6]".to_owned(), 403),
        ("localhost".to_owned(), 200),
        (format!("sub.arm.example:{port}"), 403),
    ] {
        let answer = request(runtime.address, "/", &format!("Host: {host}\r\n"));
        assert_eq!(answer.status, status, "{host}");
    }
}

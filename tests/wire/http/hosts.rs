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
        format!("[::]:{port}"),
        format!("l\u{43e}calhost:{port}"),
        format!("localhost\u{200b}:{port}"),
        format!("localhost/:{port}"),
        format!("localhost#:{port}"),
        format!("localhost:{port}, localhost:{port}"),
        format!("http://localhost:{port}"),
        String::new(),
        "<script>alert(1)</script>".to_owned(),
    ];
    for host in hosts {
        for path in ["/", "/report/"] {
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

/// Ways to say another host beside the header: none of them counts, and none of them lets a foreign header in. `OURS` is
/// our own host.
const HEADS: [(&str, u16); 17] = [
    ("GET http://OURS/ HTTP/1.1\r\nHost: OURS\r\n", 400),
    ("GET http://OURS/ HTTP/1.1\r\nHost: evil.example\r\n", 400),
    ("GET //OURS/ HTTP/1.1\r\nHost: evil.example\r\n", 403),
    ("GET OURS HTTP/1.1\r\nHost: OURS\r\n", 400),
    (
        "GET / HTTP/1.1\r\nHost: evil.example\r\nX-Forwarded-Host: OURS\r\n",
        403,
    ),
    (
        "GET / HTTP/1.1\r\nHost: evil.example\r\nhOST: OURS\r\n",
        400,
    ),
    ("GET / HTTP/1.1\r\nHost: OURS\r\nHost: OURS\r\n", 400),
    (
        "GET / HTTP/1.1\r\nHost: evil.example\r\n Host: OURS\r\n",
        400,
    ),
    ("GET / HTTP/1.1\r\nHost : OURS\r\n", 400),
    ("GET / HTTP/1.1\r\n Host: OURS\r\n", 400),
    ("GET / HTTP/1.1\r\nX: y\rHost: OURS\r\n", 400),
    ("GET / HTTP/1.1\r\n", 400),
    ("GET / HTTP/1.0\r\n", 400),
    ("GET / HTTP/1.0\r\nHost: OURS\r\n", 200),
    // A line may end in a newline alone.
    ("GET / HTTP/1.0\nHost: OURS\n", 200),
    ("GET / HTTP/1.1\r\nHost:\t OURS \t\r\n", 200),
    (
        "GET / HTTP/1.1\r\nHost: OURS\r\nX-Forwarded-Host: evil.example\r\n",
        200,
    ),
];

#[test]
fn nothing_but_the_one_host_header_says_the_host() {
    let runtime = Runtime::start();
    for (head, status) in HEADS {
        let head = head.replace("OURS", &runtime.address.to_string());
        let answer = Answer::parse(&exchange(runtime.address, format!("{head}\r\n").as_bytes()));
        assert_eq!(answer.status, status, "{head}");
    }
}

/// Hosts, and whether they are ours where some are allowed. `PORT` is our own.
const ALLOWED: [(&str, u16); 21] = [
    ("arm.example:PORT", 200),
    ("Arm.Example:PORT", 200),
    ("arm.example.", 200),
    ("arm.example..", 403),
    ("robot.local", 200),
    ("robot.local.", 200),
    ("ROBOT.local:443", 200),
    ("robot.local:80", 200),
    ("robot.local:8443", 200),
    ("xrobot.local", 403),
    ("robot.local.evil.example", 403),
    ("proxy.example:443", 200),
    ("proxy.example", 200),
    ("proxy.example:PORT", 403),
    ("odd.example:8443", 200),
    ("odd.example", 403),
    ("[fd00::5]", 200),
    ("[FD00:0::5]:80", 200),
    ("[fd00::6]", 403),
    ("localhost", 200),
    ("sub.arm.example:PORT", 403),
];

#[test]
fn an_allowed_host_is_ours_too() {
    let allowed = "robot.local,Arm.Example.,proxy.example:443,odd.example:8443,[fd00::5]";
    let runtime = Runtime::with(&["--allow-host", allowed]);
    for (host, status) in ALLOWED {
        let host = host.replace("PORT", &runtime.address.port().to_string());
        let answer = request(runtime.address, "/", &format!("Host: {host}\r\n"));
        assert_eq!(answer.status, status, "{host}");
    }
}

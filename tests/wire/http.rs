//! HTTP on the port: the page, the report, who may ask, and bytes that mean harm.
//!
//! **Invariant:** whatever is sent over HTTP, the arm's parameters stay as they were.

#![cfg(feature = "web")]
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::path::Path;
use std::process::{Command, Stdio};

use crate::common::{PATIENCE, Runtime, SET_GRAVITY};
use crate::web_client::{Answer, exchange, folder, get, request, rest};
use pendularm::web::head::MAX_HEAD;
use pendularm::web::page::ASSETS;

#[test]
fn the_page_and_its_files_are_served_with_their_types() {
    let runtime = Runtime::start();
    let page = get(runtime.address, "/");
    assert_eq!(page.status, 200);
    assert_eq!(
        page.header("content-type"),
        Some("text/html; charset=utf-8")
    );
    assert!(
        page.text()
            .to_ascii_lowercase()
            .starts_with("<!doctype html>")
    );
    let with_query = get(runtime.address, "/?dt=0.001&method=rk4");
    assert_eq!(with_query.body, page.body);
    for asset in ASSETS {
        let kind = match Path::new(asset.file).extension().unwrap().to_str() {
            Some("html") => "text/html",
            Some("css") => "text/css",
            Some("js") => "text/javascript",
            Some("svg") => "image/svg+xml",
            other => panic!("{other:?} is a kind that this test does not know"),
        };
        let file = get(runtime.address, asset.path);
        assert_eq!(file.status, 200, "{}", asset.path);
        assert!(file.header("content-type").unwrap().starts_with(kind));
        if asset.path != "/" {
            assert_eq!(file.body, asset.bytes, "{}", asset.path);
        }
    }
}

#[test]
fn a_file_goes_out_packed_to_a_browser_and_is_the_same() {
    let runtime = Runtime::start();
    let (mut plain, mut packed) = (0, 0);
    for asset in ASSETS.iter().filter(|asset| asset.path != "/") {
        let headers = format!(
            "Host: {}\r\nAccept-Encoding: gzip, deflate\r\n",
            runtime.address
        );
        let answer = request(runtime.address, asset.path, &headers);
        assert_eq!(answer.header("content-encoding"), Some("deflate"));
        let unpacked = miniz_oxide::inflate::decompress_to_vec_zlib(&answer.body).unwrap();
        assert_eq!(unpacked, asset.bytes, "{}", asset.path);
        plain += asset.bytes.len();
        packed += answer.body.len();
    }
    assert!(3 * packed < plain + packed, "{packed} of {plain} bytes");
}

#[test]
fn a_name_that_stands_for_its_content_may_be_kept_and_no_other() {
    let runtime = Runtime::start();
    let page = get(runtime.address, "/");
    assert_eq!(page.header("cache-control"), Some("no-store"));
    let html = page.text();
    let named: Vec<&str> = html
        .split('"')
        .filter(|one| one.starts_with("/v/"))
        .collect();
    for path in &named {
        let kept = get(runtime.address, path);
        assert_eq!(kept.status, 200, "{path}");
        let cache = kept.header("cache-control").unwrap();
        assert!(cache.contains("immutable"), "{path}: {cache}");
    }
    let script = named.iter().find(|one| one.ends_with("/page.js")).unwrap();
    assert_eq!(get(runtime.address, "/page.js").status, 404);
    let kept = get(runtime.address, &script.replace("page.js", "main.js"));
    let plain = get(runtime.address, "/main.js");
    assert_eq!(plain.header("cache-control"), Some("no-store"));
    assert_eq!(plain.body, kept.body);
    let other = get(runtime.address, "/v/0123456789abcdef/main.js");
    assert_eq!(other.status, 404);
}

#[test]
fn the_page_may_run_its_own_files_speak_to_its_own_port_and_nothing_else() {
    let runtime = Runtime::start();
    let page = get(runtime.address, "/");
    let policy = page.header("content-security-policy").unwrap();
    let own = format!("connect-src 'self' ws://{}", runtime.address);
    for rule in [
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        &own,
        "frame-ancestors 'none'",
        "base-uri 'none'",
        "form-action 'none'",
    ] {
        assert!(
            policy.split("; ").any(|one| one == rule),
            "{rule} in {policy}"
        );
    }
    assert!(
        !policy.contains("unsafe") && !policy.contains('*'),
        "{policy}"
    );
    assert_eq!(page.header("x-content-type-options"), Some("nosniff"));
    assert_eq!(page.header("referrer-policy"), Some("no-referrer"));
    assert_eq!(page.header("connection"), Some("close"));
    let elsewhere = ["http://", "https://", "//"];
    for quote in ["src=\"", "href=\""] {
        for start in elsewhere {
            assert!(!page.text().contains(&format!("{quote}{start}")));
        }
    }
}

#[test]
fn what_is_not_there_is_a_404_that_says_what_is() {
    let runtime = Runtime::start();
    for path in [
        "/nothing",
        "/index.htm",
        "//",
        "/../Cargo.toml",
        "/%2e%2e/Cargo.toml",
        "/style.css/",
    ] {
        let answer = get(runtime.address, path);
        assert_eq!(answer.status, 404, "{path}");
        assert!(answer.text().contains("the page is at /"), "{path}");
        assert_eq!(
            answer.header("content-type"),
            Some("text/plain; charset=utf-8")
        );
    }
}

#[test]
fn loopbacks_names_with_our_port_are_our_hosts() {
    let runtime = Runtime::start();
    let port = runtime.address.port();
    for host in ["localhost", "LOCALHOST", "127.0.0.1", "[::1]", "127.0.0.2"] {
        let answer = request(runtime.address, "/", &format!("Host: {host}:{port}\r\n"));
        assert_eq!(answer.status, 200, "{host}");
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
        "localhost".to_owned(),
        "localhost:1".to_owned(),
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

/// Bytes behind a request are no request, however its length is told: the first answer is the last.
#[test]
fn no_second_request_is_smuggled_behind_the_first() {
    let runtime = Runtime::start();
    let address = runtime.address;
    let second = format!("GET /nothing HTTP/1.1\r\nHost: {address}\r\n\r\n");
    for lengths in [
        "",
        "Connection: keep-alive\r\n",
        "Content-Length: 0\r\n",
        "Content-Length: 5\r\nContent-Length: 0\r\n",
        "Transfer-Encoding: chunked\r\n",
        "Transfer-Encoding: chunked\r\nContent-Length: 4\r\n",
        "Transfer-Encoding: xchunked\r\nContent-Length: -1\r\n",
    ] {
        for body in ["", "0\r\n\r\n"] {
            let request =
                format!("GET / HTTP/1.1\r\nHost: {address}\r\n{lengths}\r\n{body}{second}");
            let bytes = exchange(address, request.as_bytes());
            let answers = String::from_utf8_lossy(&bytes).matches("HTTP/1.1 ").count();
            assert_eq!(
                (answers, Answer::parse(&bytes).status),
                (1, 200),
                "{lengths}"
            );
        }
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
    let runtime = Runtime::with(&["--allow-host", "arm.example,proxy.example:443"]);
    let port = runtime.address.port();
    for (host, status) in [
        (format!("arm.example:{port}"), 200),
        (format!("Arm.Example:{port}"), 200),
        ("arm.example:1".to_owned(), 403),
        ("proxy.example:443".to_owned(), 200),
        (format!("proxy.example:{port}"), 403),
        (format!("sub.arm.example:{port}"), 403),
    ] {
        let answer = request(runtime.address, "/", &format!("Host: {host}\r\n"));
        assert_eq!(answer.status, status, "{host}");
    }
}

#[test]
fn what_is_no_request_is_a_400_that_says_why() {
    let runtime = Runtime::start();
    for head in [
        "GET /\r\n\r\n",
        "GET / HTTP/1.2\r\n\r\n",
        "GET / HTTP/1.1\r\nHost\r\n\r\n",
        "GET / HTTP/1.1\r\nHo st: a\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: a\x01b\r\n\r\n",
        "GET / HTTP/1.1\r\n Host: folded\r\n\r\n",
        "GET http://127.0.0.1/ HTTP/1.1\r\n\r\n",
        "GET \t HTTP/1.1\r\n\r\n",
    ] {
        let answer = Answer::parse(&exchange(runtime.address, head.as_bytes()));
        assert_eq!(answer.status, 400, "{head:?}");
        assert!(answer.text().contains("not a well-formed HTTP request"));
    }
}

#[test]
fn a_huge_head_is_refused_and_what_follows_is_swallowed() {
    let runtime = Runtime::start();
    let start = format!("GET / HTTP/1.1\r\nHost: {}\r\n", runtime.address);
    let long = format!("{start}X: {}\r\n\r\n", "x".repeat(500_000));
    let many = format!("{start}{}\r\n", "X: y\r\n".repeat(1000));
    let path = format!("GET /{} HTTP/1.1\r\n\r\n", "a".repeat(20_000));
    for head in [long, many, path] {
        let answer = Answer::parse(&exchange(runtime.address, head.as_bytes()));
        assert_eq!(answer.status, 431);
        assert!(answer.text().contains("16384 bytes"));
    }
    // Just within the limit.
    let room = MAX_HEAD - start.len() - "X: \r\n\r\n".len();
    for (length, status) in [(room, 200), (room + 1, 431)] {
        let head = format!("{start}X: {}\r\n\r\n", "x".repeat(length));
        let answer = Answer::parse(&exchange(runtime.address, head.as_bytes()));
        assert_eq!(answer.status, status);
    }
}

#[test]
fn a_request_that_comes_byte_by_byte_is_answered() {
    let runtime = Runtime::start();
    let mut stream = TcpStream::connect(runtime.address).unwrap();
    stream.set_nodelay(true).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    for byte in format!("GET / HTTP/1.1\r\nHost: {}\r\n\r\n", runtime.address).as_bytes() {
        stream.write_all(&[*byte]).unwrap();
    }
    assert_eq!(Answer::parse(&rest(&mut stream)).status, 200);
}

#[test]
fn lines_may_end_in_a_newline_alone_and_the_version_may_be_1_0() {
    let runtime = Runtime::start();
    let head = format!("GET / HTTP/1.0\nHost: {}\n\n", runtime.address);
    let answer = Answer::parse(&exchange(runtime.address, head.as_bytes()));
    assert_eq!(answer.status, 200);
}

#[test]
fn json_behind_a_request_is_not_executed_however_it_is_hidden() {
    let runtime = Runtime::start();
    let own = format!("Host: {}\r\n", runtime.address);
    for head in [
        format!("GET / HTTP/1.1\r\n{own}\r\n"),
        format!("GET / HTTP/1.1\r\n{own}Content-Length: 100\r\n\r\n"),
        format!("GET / HTTP/1.1\r\n{own}Transfer-Encoding: chunked\r\n\r\n"),
        "GET / HTTP/1.1\r\n\r\n".to_owned(),
        "GET \r\n".to_owned(),
        "GET /\r\n\r\nGET / HTTP/1.1\r\n\r\n".to_owned(),
    ] {
        // Two line ends: a head that has not ended does so here.
        let bytes = format!("{head}{SET_GRAVITY}\r\n\r\n{SET_GRAVITY}");
        let answer = exchange(runtime.address, bytes.as_bytes());
        let answers = String::from_utf8_lossy(&answer)
            .matches("HTTP/1.1 ")
            .count();
        assert_eq!(answers, 1, "one request, one answer: {head:?}");
    }
    runtime.assert_nothing_was_executed();
}

#[test]
fn a_posted_command_is_not_executed_and_told_so_in_one_line() {
    let runtime = Runtime::start();
    for method in ["POST", "PUT", "HEAD", "OPTIONS", "DELETE", "PATCH"] {
        let request = format!(
            "{method} / HTTP/1.1\r\nHost: {}\r\nContent-Type: text/plain\r\nContent-Length: {}\r\n\r\n{SET_GRAVITY}",
            runtime.address,
            SET_GRAVITY.len()
        );
        let answer = exchange(runtime.address, request.as_bytes());
        let line = String::from_utf8(answer).unwrap();
        assert_eq!(line.lines().count(), 1, "{line}");
        assert!(line.contains("\"level\":\"error\"") && line.contains("HTTP"));
    }
    runtime.assert_nothing_was_executed();
}

#[test]
fn nothing_of_a_request_becomes_a_header_of_the_answer() {
    let runtime = Runtime::start();
    let port = runtime.address.port();
    let paths = [
        "/%0d%0aSet-Cookie:%20a=b",
        "/report/%0d%0aSet-Cookie:%20a=b.svg",
        "/?token=%0d%0aSet-Cookie:%20a=b",
    ];
    for path in paths {
        let answer = get(runtime.address, path);
        assert_eq!(answer.header("set-cookie"), None, "{path}");
    }
    let hosts = [
        format!("localhost:{port}; script-src *"),
        format!("localhost:{port} evil"),
        format!("localhost:{port}\t'unsafe-inline'"),
    ];
    for host in hosts {
        let answer = request(runtime.address, "/", &format!("Host: {host}\r\n"));
        assert_eq!(answer.status, 403, "{host}");
    }
    let origin = format!("Host: localhost:{port}\r\nOrigin: http://evil.example\r\n");
    let answer = request(runtime.address, "/", &origin);
    assert_eq!(answer.header("access-control-allow-origin"), None);
}

#[test]
fn the_report_is_served_from_its_folder_with_a_policy_of_its_own() {
    let folder = folder("report");
    fs::write(folder.join("index.html"), "<h1>report</h1>").unwrap();
    fs::create_dir(folder.join("data")).unwrap();
    fs::write(folder.join("data/error.csv"), "h,e\n").unwrap();
    fs::write(folder.join("figure.svg"), "<svg/>").unwrap();
    let runtime = Runtime::with(&["--report", folder.to_str().unwrap()]);
    for (path, kind, body) in [
        ("/report/", "text/html", "<h1>report</h1>"),
        ("/report/index.html", "text/html", "<h1>report</h1>"),
        ("/report/data/error.csv?x=1", "text/csv", "h,e\n"),
        ("/report/figure.svg", "image/svg+xml", "<svg/>"),
    ] {
        let file = get(runtime.address, path);
        assert_eq!((file.status, file.text()), (200, body), "{path}");
        assert!(file.header("content-type").unwrap().starts_with(kind));
        let policy = file.header("content-security-policy").unwrap();
        assert!(
            policy.contains("default-src 'none'") && policy.contains("style-src 'unsafe-inline'")
        );
        assert!(!policy.contains("script-src") && !policy.contains("connect-src"));
    }
    let moved = get(runtime.address, "/report");
    assert_eq!(
        (moved.status, moved.header("location")),
        (301, Some("/report/"))
    );
}

#[test]
fn a_report_larger_than_a_socket_holds_arrives_whole() {
    let folder = folder("large");
    let text: String = (0..500_000).map(|line| format!("{line}\n")).collect();
    fs::write(folder.join("large.txt"), &text).unwrap();
    let runtime = Runtime::with(&["--report", folder.to_str().unwrap()]);
    assert!(get(runtime.address, "/report/large.txt").text() == text);
}

#[test]
fn no_path_leads_out_of_the_reports_folder() {
    let outside = folder("outside");
    let inside = outside.join("inside");
    fs::create_dir(&inside).unwrap();
    fs::write(outside.join("secret.txt"), "secret").unwrap();
    fs::write(inside.join(".hidden.txt"), "secret").unwrap();
    fs::write(inside.join("program.exe"), "secret").unwrap();
    fs::create_dir(inside.join("folder.txt")).unwrap();
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(outside.join("secret.txt"), inside.join("link.txt")).unwrap();
        std::os::unix::fs::symlink(&outside, inside.join("up")).unwrap();
    }
    let runtime = Runtime::with(&["--report", inside.to_str().unwrap()]);
    for rest in [
        "../secret.txt",
        "%2e%2e/secret.txt",
        "..%2fsecret.txt",
        "..%5csecret.txt",
        "./../secret.txt",
        "/secret.txt",
        "link.txt",
        "up/secret.txt",
        ".hidden.txt",
        "program.exe",
        "folder.txt",
        "missing.txt",
        "%00.txt",
        "",
    ] {
        let answer = get(runtime.address, &format!("/report/{rest}"));
        assert_eq!(answer.status, 404, "{rest}");
        assert!(answer.text().contains("--report"), "{}", answer.text());
        assert!(!answer.text().contains("secret"));
    }
}

/// A pipe without a writer would keep its reader waiting.
#[cfg(unix)]
#[test]
fn a_pipe_in_the_reports_folder_holds_up_nobody() {
    let folder = folder("pipe");
    let made = Command::new("mkfifo").arg(folder.join("a.txt")).status();
    if !made.is_ok_and(|status| status.success()) {
        return;
    }
    let runtime = Runtime::with(&["--report", folder.to_str().unwrap()]);
    assert_eq!(get(runtime.address, "/report/a.txt").status, 404);
}

#[test]
fn a_client_that_leaves_within_its_head_costs_nothing() {
    let runtime = Runtime::start();
    for _ in 0..100 {
        let mut stream = TcpStream::connect(runtime.address).unwrap();
        stream.write_all(b"GET / HTTP/1.1\r\nHost").unwrap();
        stream.shutdown(Shutdown::Write).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        assert!(rest(&mut stream).is_empty());
    }
    assert_eq!(get(runtime.address, "/").status, 200);
}

#[test]
fn the_log_names_the_pages_address_at_the_start() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_pendularm"))
        .args(["--bind", "127.0.0.1:0", "--log", "info"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    let mut stdout = BufReader::new(child.stdout.take().unwrap());
    stdout.read_line(&mut line).unwrap();
    let address = line.trim().strip_prefix("listening on ").unwrap();
    let page = format!("page: http://{address}/");
    let log = BufReader::new(child.stderr.take().unwrap());
    let found = log
        .lines()
        .map_while(Result::ok)
        .any(|line| line.contains(&page));
    let _ = child.kill();
    let _ = child.wait();
    let mut more = String::new();
    stdout.read_to_string(&mut more).unwrap();
    assert!(
        found && more.is_empty(),
        "{page} in the log, nothing else on stdout"
    );
}

/// The program without the feature web is to have nothing of it.
#[test]
fn without_the_feature_no_crate_of_the_web_door_is_built_in() {
    let tree = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO"))
            .args([
                "tree",
                "--locked",
                "--offline",
                "--edges",
                "normal",
                "--prefix",
                "none",
            ])
            .args(arguments)
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .unwrap();
        assert!(output.status.success());
        String::from_utf8(output.stdout).unwrap()
    };
    let (with, without) = (
        tree(&[]),
        tree(&["--no-default-features", "--features", "runtime"]),
    );
    for name in [
        "tokio-tungstenite",
        "tungstenite",
        "httparse",
        "sha1",
        "rand",
    ] {
        let named = |tree: &str| {
            tree.lines()
                .any(|line| line.starts_with(&format!("{name} v")))
        };
        assert!(named(&with) && !named(&without), "{name}");
    }
}

//! The page and its files: their types, their packing, their policy, how long they may be kept, and where they are.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Stdio};

use crate::common::Runtime;
use crate::web_client::{get, request};
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

//! The page and its files: their types, their policy, and where they are. `tests/actors/web/http.rs` has many requests over one connection.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Stdio;

use crate::common::{Logged, Runtime, program};
use crate::folder::Folder;
use crate::web_client::{exchange, get};
use pendularm::web::page::ASSETS;
use pendularm_client::websocket::handshake;

#[test]
fn the_page_and_its_files_are_served_with_their_types() {
    let runtime = Runtime::start();
    let page = get(runtime.address, "/");
    assert_eq!(page.status, 200);
    assert_eq!(
        page.header("content-type"),
        Some("text/html; charset=utf-8")
    );
    assert!(page.text().starts_with("<!DOCTYPE html>"));
    let with_query = get(runtime.address, "/?dt=0.001&method=rk4");
    assert_eq!(with_query.body, page.body);
    for (name, bytes) in ASSETS.iter().filter(|(name, _)| *name != "index.html") {
        let kind = match Path::new(name).extension().unwrap().to_str() {
            Some("css") => "text/css",
            Some("js") => "text/javascript",
            Some("svg") => "image/svg+xml",
            other => panic!("{other:?} is a kind that this test does not know"),
        };
        let file = get(runtime.address, &format!("/{name}"));
        assert_eq!(file.status, 200, "{name}");
        assert!(file.header("content-type").unwrap().starts_with(kind));
        assert_eq!(file.header("cache-control"), Some("no-store"), "{name}");
        assert_eq!(file.body, *bytes, "{name}");
    }
    assert_eq!(get(runtime.address, "/index.html").status, 404);
    let icon = get(runtime.address, "/favicon.ico");
    assert_eq!(icon.body, get(runtime.address, "/icon.svg").body);
}

#[test]
fn pages_of_the_named_origins_may_frame_the_page_and_its_report_and_no_others() {
    let folder = Folder::new("framed");
    std::fs::write(folder.join("index.html"), "report").unwrap();
    let folder = folder.to_str().unwrap();
    let named = "https://Class.example,http://localhost:8000";
    let framed = Runtime::with(&["--allow-frame", named, "--report", folder]);
    for path in ["/", "/report/", "/main.js"] {
        let answer = get(framed.address, path);
        let policy = answer.header("content-security-policy").unwrap();
        let ancestors = "frame-ancestors https://class.example http://localhost:8000";
        assert!(policy.split("; ").any(|one| one == ancestors), "{policy}");
        assert_eq!(answer.header("x-frame-options"), None, "{path}");
    }
    let refused = get(framed.address, "/nothing");
    assert_eq!(refused.header("x-frame-options"), Some("DENY"));
    let alone = Runtime::with(&["--report", folder]);
    for path in ["/", "/report/"] {
        let answer = get(alone.address, path);
        let policy = answer.header("content-security-policy").unwrap();
        assert!(policy.contains("frame-ancestors 'none'"), "{policy}");
        assert_eq!(answer.header("x-frame-options"), Some("DENY"), "{path}");
    }
}

#[test]
fn the_log_names_the_pages_address_at_the_start() {
    let mut runtime = Logged::start(program(), Stdio::null());
    let page = format!("page: http://{}/", runtime.address);
    runtime.await_line(&page);
}

/// A browser does not show the answer to a handshake.
#[test]
fn the_log_names_the_option_for_a_foreign_origin() {
    let mut runtime = Logged::start(program(), Stdio::null());
    let (host, origin) = (
        runtime.address.to_string(),
        "Origin: https://class.example\r\n",
    );
    let request = handshake(&host, "/", origin);
    exchange(runtime.address, request.as_bytes());
    let line = runtime.await_line("--allow-origin");
    assert!(line.contains("WARN"), "{line}");
    assert!(line.contains("https://class.example"), "{line}");
}

#[test]
fn every_file_of_the_folder_is_served() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/page");
    let files: BTreeSet<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    let served: BTreeSet<String> = ASSETS.iter().map(|(name, _)| (*name).into()).collect();
    assert_eq!(files, served);
    assert_eq!(files.len(), ASSETS.len());
}

//! The page: the files of `page/`, in the binary, under their own names.
//!
//! **Invariant:** every file of that folder is in the table, and no other file is served as part of the
//! page.

use std::time::Duration;

use bytes::Bytes;
use tokio::time::timeout;

use super::response::{HttpResponse, file};
use super::{Site, report};
use crate::address::Authority;

/// The name of the document, which is served as `/`.
const DOCUMENT: &str = "index.html";

/// Time to look for the report.
const LOOK_TIME: Duration = Duration::from_millis(250);

/// A file of the page: its name in `page/`, and its bytes.
pub type Asset = (&'static str, &'static [u8]);

macro_rules! assets {
    ($($file:literal)*) => {
        &[$(($file, include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/page/", $file)))),*]
    };
}

/// Every file of the page.
pub const ASSETS: &[Asset] = assets! {
    "index.html" "icon.svg" "style.css" "actions.js" "aim.js" "answers.js" "arm_view.js"
    "chart.js" "compare.js" "controls.js" "copy.js" "course.js" "course_view.js" "dom.js"
    "field.js" "format.js" "held_limit.js" "history.js" "kernel.js" "keyboard.js" "ladder.js" "ladder_panel.js"
    "latest.js" "main.js" "mechanics.js" "motions.js" "packed.js" "plots.js" "policy.js" "question.js"
    "readouts.js" "realism.js" "responses.js" "rosbridge.js" "runtime.js" "scale.js" "scenes.js"
    "settings.js" "sheet.js" "stability_panel.js" "store.js" "study.js"
    "submission.js" "surface.js" "tasks_panel.js" "theme.js" "transport.js" "views.js"
};

/// The file at `path`, if it is part of the page.
#[must_use]
pub fn find(path: &str) -> Option<Asset> {
    let wanted = match path.strip_prefix('/')? {
        "" => DOCUMENT,
        DOCUMENT => return None,
        // Browsers ask for it where a document names no icon, as the report does.
        "favicon.ico" => "icon.svg",
        name => name,
    };
    ASSETS.iter().find(|(name, _)| *name == wanted).copied()
}

/// The answer with a file of the page. The document has a link to the report if the folder has one.
pub async fn answer((name, bytes): Asset, own: &Authority, site: &Site) -> HttpResponse {
    let mut body = Bytes::from_static(bytes);
    if name == DOCUMENT {
        // The page is served without the link while others read all files that may be read, or if the disk hangs.
        let look = site.look_now(|folder| folder.join(report::INDEX).is_file());
        if let Ok(Some((true, _))) = timeout(LOOK_TIME, look).await {
            let html = String::from_utf8_lossy(bytes);
            body = html
                .replace("href=\"report/\" hidden", "href=\"report/\"")
                .into();
        }
    }
    // All others are scripts, which are not allowed in a report.
    let kind = report::media_type(name).unwrap_or("text/javascript; charset=utf-8");
    file(kind, &policy(own), body)
}

/// The policy of the page: it may run its own scripts and styles, draw, and connect to `own`, its origin. `'self'`
/// includes the WebSocket only in newer browsers, so its address is listed. No text can become markup or a script,
/// because there are no trusted types.
fn policy(own: &Authority) -> String {
    format!(
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self' ws://{own}; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'; require-trusted-types-for 'script'; \
         trusted-types 'none'"
    )
}

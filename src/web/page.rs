//! The page: the files of `page/`, in the binary.
//!
//! **Invariant:** every file of that folder is in the table, and nothing else is served as part of the page.

/// A file of the page.
#[derive(Debug)]
pub struct Asset {
    /// Where it is served.
    pub path: &'static str,
    /// Its name in `page/`.
    pub file: &'static str,
    /// Its media type.
    pub kind: &'static str,
    /// What is in it.
    pub bytes: &'static [u8],
}

/// An entry of the table, by the file's name, which is its path too unless another is given.
macro_rules! asset {
    ($file:literal, $kind:expr) => {
        asset!(concat!("/", $file), $file, $kind)
    };
    ($path:expr, $file:literal, $kind:expr) => {
        Asset {
            path: $path,
            file: $file,
            kind: $kind,
            bytes: include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/page/", $file)),
        }
    };
}

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SVG: &str = "image/svg+xml";
const JAVASCRIPT: &str = "text/javascript; charset=utf-8";

/// Every file of the page.
pub const ASSETS: &[Asset] = &[
    asset!("/", "index.html", HTML),
    asset!("icon.svg", SVG),
    asset!("style.css", CSS),
    asset!("aim.js", JAVASCRIPT),
    asset!("announce.js", JAVASCRIPT),
    asset!("arm_view.js", JAVASCRIPT),
    asset!("axis.js", JAVASCRIPT),
    asset!("backdrop.js", JAVASCRIPT),
    asset!("compare.js", JAVASCRIPT),
    asset!("compare_view.js", JAVASCRIPT),
    asset!("controls.js", JAVASCRIPT),
    asset!("csv.js", JAVASCRIPT),
    asset!("dom.js", JAVASCRIPT),
    asset!("field.js", JAVASCRIPT),
    asset!("format.js", JAVASCRIPT),
    asset!("goal_panel.js", JAVASCRIPT),
    asset!("keyboard.js", JAVASCRIPT),
    asset!("latest.js", JAVASCRIPT),
    asset!("main.js", JAVASCRIPT),
    asset!("mechanics.js", JAVASCRIPT),
    asset!("phase_plot.js", JAVASCRIPT),
    asset!("plots.js", JAVASCRIPT),
    asset!("readouts.js", JAVASCRIPT),
    asset!("recorder.js", JAVASCRIPT),
    asset!("resample.js", JAVASCRIPT),
    asset!("ring.js", JAVASCRIPT),
    asset!("rosbridge.js", JAVASCRIPT),
    asset!("runtime.js", JAVASCRIPT),
    asset!("share.js", JAVASCRIPT),
    asset!("store.js", JAVASCRIPT),
    asset!("strip_chart.js", JAVASCRIPT),
    asset!("surface.js", JAVASCRIPT),
    asset!("theme.js", JAVASCRIPT),
    asset!("transport.js", JAVASCRIPT),
    asset!("trial_panel.js", JAVASCRIPT),
];

/// The file that is served at `path`.
#[must_use]
pub fn find(path: &str) -> Option<&'static Asset> {
    ASSETS.iter().find(|asset| asset.path == path)
}

/// What the page may do: run its own scripts and styles, draw, and speak to `own`, where it came from. `'self'` covers the
/// WebSocket in newer browsers only, so that is spelled out. No text can become markup or a script: of trusted types there are none.
#[must_use]
pub fn policy(own: &super::authority::Authority) -> String {
    format!(
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self' ws://{own}; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'; require-trusted-types-for 'script'; \
         trusted-types 'none'"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_file_of_the_folder_is_served() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/page");
        let files: BTreeSet<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        let served: BTreeSet<String> = ASSETS.iter().map(|asset| asset.file.into()).collect();
        assert_eq!(files, served);
        let paths: BTreeSet<&str> = ASSETS.iter().map(|asset| asset.path).collect();
        assert_eq!(paths.len(), ASSETS.len());
    }
}

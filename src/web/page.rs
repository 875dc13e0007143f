//! The page: the files of `page/`, in the binary.
//!
//! They are served under their own names, never to be kept, and under [`versioned`] ones, which stand for what is in
//! them and may be kept for ever. The page's document names those, all scripts as the one file [`SCRIPT`] and all style
//! sheets as [`STYLE`], so that a browser asks for four files, once per version.
//!
//! **Invariant:** every file of that folder is in the table, and nothing else is served as part of the page.

use std::borrow::Cow;
use std::sync::LazyLock;

use tokio::sync::OnceCell;
use tokio::task::spawn_blocking;

use super::authority::Authority;
use super::bundle::{bundle, styles};
use super::response::HttpResponse;
use super::{Site, report};

/// A file of the page.
#[derive(Debug)]
pub struct Asset {
    /// Path under which it is served.
    pub path: &'static str,
    /// Its name in `page/`.
    pub file: &'static str,
    /// Its media type.
    pub kind: &'static str,
    /// Its bytes.
    pub bytes: &'static [u8],
}

impl Asset {
    fn is_document(&self) -> bool {
        self.path == "/"
    }
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
    asset!("base.css", CSS),
    asset!("colors.css", CSS),
    asset!("frame.css", CSS),
    asset!("panels.css", CSS),
    asset!("settings.css", CSS),
    asset!("small.css", CSS),
    asset!("style.css", CSS),
    asset!("view.css", CSS),
    asset!("actions.js", JAVASCRIPT),
    asset!("aim.js", JAVASCRIPT),
    asset!("announce.js", JAVASCRIPT),
    asset!("arm_view.js", JAVASCRIPT),
    asset!("arrows.js", JAVASCRIPT),
    asset!("axis.js", JAVASCRIPT),
    asset!("backdrop.js", JAVASCRIPT),
    asset!("compare.js", JAVASCRIPT),
    asset!("compare_view.js", JAVASCRIPT),
    asset!("controls.js", JAVASCRIPT),
    asset!("csv.js", JAVASCRIPT),
    asset!("cursor.js", JAVASCRIPT),
    asset!("dom.js", JAVASCRIPT),
    asset!("eigen.js", JAVASCRIPT),
    asset!("field.js", JAVASCRIPT),
    asset!("format.js", JAVASCRIPT),
    asset!("frames.js", JAVASCRIPT),
    asset!("goal_panel.js", JAVASCRIPT),
    asset!("growth.js", JAVASCRIPT),
    asset!("history.js", JAVASCRIPT),
    asset!("history_panel.js", JAVASCRIPT),
    asset!("keyboard.js", JAVASCRIPT),
    asset!("ladder.js", JAVASCRIPT),
    asset!("ladder_panel.js", JAVASCRIPT),
    asset!("latest.js", JAVASCRIPT),
    asset!("lessons.js", JAVASCRIPT),
    asset!("lessons_panel.js", JAVASCRIPT),
    asset!("limits_view.js", JAVASCRIPT),
    asset!("loop.js", JAVASCRIPT),
    asset!("main.js", JAVASCRIPT),
    asset!("map_view.js", JAVASCRIPT),
    asset!("mechanics.js", JAVASCRIPT),
    asset!("modes_view.js", JAVASCRIPT),
    asset!("pencil.js", JAVASCRIPT),
    asset!("phase_plot.js", JAVASCRIPT),
    asset!("playback.js", JAVASCRIPT),
    asset!("player_bar.js", JAVASCRIPT),
    asset!("plots.js", JAVASCRIPT),
    asset!("policy.js", JAVASCRIPT),
    asset!("readouts.js", JAVASCRIPT),
    asset!("resample.js", JAVASCRIPT),
    asset!("ring.js", JAVASCRIPT),
    asset!("rosbridge.js", JAVASCRIPT),
    asset!("runs.js", JAVASCRIPT),
    asset!("runtime.js", JAVASCRIPT),
    asset!("save.js", JAVASCRIPT),
    asset!("scale.js", JAVASCRIPT),
    asset!("settings.js", JAVASCRIPT),
    asset!("share.js", JAVASCRIPT),
    asset!("smooth.js", JAVASCRIPT),
    asset!("store.js", JAVASCRIPT),
    asset!("strip_chart.js", JAVASCRIPT),
    asset!("surface.js", JAVASCRIPT),
    asset!("svg_context.js", JAVASCRIPT),
    asset!("tabs.js", JAVASCRIPT),
    asset!("theme.js", JAVASCRIPT),
    asset!("trail.js", JAVASCRIPT),
    asset!("transport.js", JAVASCRIPT),
    asset!("trial_panel.js", JAVASCRIPT),
    asset!("why.js", JAVASCRIPT),
];

/// All scripts in one, served under its versioned name only.
pub const SCRIPT: &str = "/page.js";
/// All style sheets in one, likewise.
pub const STYLE: &str = "/page.css";

static BUNDLES: LazyLock<[Asset; 2]> = LazyLock::new(|| {
    let of = |kind: &str| -> Vec<_> {
        let files = ASSETS.iter().filter(|asset| asset.kind == kind);
        files
            .filter_map(|asset| Some((asset.file, std::str::from_utf8(asset.bytes).ok()?)))
            .collect()
    };
    let asset = |path, kind, text: String| Asset {
        path,
        file: "",
        kind,
        bytes: Box::leak(text.into_bytes().into_boxed_slice()),
    };
    [
        asset(SCRIPT, JAVASCRIPT, bundle("main.js", &of(JAVASCRIPT))),
        asset(STYLE, CSS, styles("style.css", &of(CSS))),
    ]
});

/// Each file once packed, when it is first asked for.
static PACKED: [OnceCell<Vec<u8>>; ASSETS.len() + 2] =
    [const { OnceCell::const_new() }; ASSETS.len() + 2];

/// How hard the packing tries: beyond it text gets hardly smaller.
const LEVEL: u8 = 6;

/// The beginning of the names that stand for a version: a number made of every byte of every file.
static VERSION: LazyLock<String> = LazyLock::new(|| {
    // FNV-1a, 64 bits: it has to tell versions apart, not to resist anybody.
    let all = ASSETS.iter().flat_map(|asset| asset.bytes);
    let hash = all.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    });
    format!("/v/{hash:016x}")
});

/// The path of a file, given with its slash, that stands for its present content.
#[must_use]
pub fn versioned(path: &str) -> String {
    format!("{}{path}", *VERSION)
}

/// A file of the page that was asked for.
#[derive(Debug)]
pub struct PageFile {
    asset: &'static Asset,
    policy: String,
    /// Under a name that stands for its content.
    is_kept: bool,
    /// Where it is kept packed, for a client that takes it so.
    packed: Option<&'static OnceCell<Vec<u8>>>,
}

/// The file at `path`, if that is one of the page's. It goes out packed to a client that takes `encodings` with
/// `deflate` among them.
#[must_use]
pub fn find(path: &str, own: &Authority, encodings: &str) -> Option<PageFile> {
    let kept = path.strip_prefix(VERSION.as_str());
    let wanted = kept.unwrap_or(path);
    let bundles = if kept.is_some() {
        BUNDLES.as_slice()
    } else {
        &[]
    };
    let mut served = ASSETS.iter().chain(bundles).zip(&PACKED);
    let (asset, packed) = served.find(|(asset, _)| asset.path == wanted)?;
    let takes_packed = encodings.split(',').any(|one| one.trim() == "deflate");
    Some(PageFile {
        asset,
        policy: policy(own),
        is_kept: kept.is_some() && !asset.is_document(),
        packed: (takes_packed && !asset.is_document()).then_some(packed),
    })
}

impl PageFile {
    /// The answer; the document shows the way to the report if there is one in the folder. Looking there may take as
    /// long as the disk does, and packing a file takes milliseconds, once: another thread does both.
    pub async fn answer(self, site: &Site) -> HttpResponse {
        let Asset { kind, bytes, .. } = *self.asset;
        let body = if self.asset.is_document() {
            let folder = site.report.clone();
            let has_report = site.at_disk(move || report::exists(&folder)).await;
            Cow::Owned(document(bytes, has_report.unwrap_or(false)))
        } else {
            Cow::Borrowed(bytes)
        };
        let response = HttpResponse::file(kind, self.policy, body);
        let response = response.with("Vary", "Accept-Encoding");
        let response = if self.is_kept {
            response.kept()
        } else {
            response
        };
        let Some(packed) = self.packed else {
            return response;
        };
        let pack = || spawn_blocking(|| miniz_oxide::deflate::compress_to_vec_zlib(bytes, LEVEL));
        match packed.get_or_try_init(pack).await {
            Ok(packed) => response.packed(packed),
            // The runtime is ending.
            Err(_) => response,
        }
    }
}

/// The page's document: its files by their versioned names, its scripts as one and its style sheets as one.
fn document(html: &[u8], has_report: bool) -> Vec<u8> {
    let mut html = String::from_utf8_lossy(html).into_owned();
    for (name, path) in [
        ("main.js", SCRIPT),
        ("style.css", STYLE),
        ("icon.svg", "/icon.svg"),
    ] {
        html = html.replace(&format!("\"{name}\""), &format!("\"{}\"", versioned(path)));
    }
    if has_report {
        html = html.replace("href=\"report/\" hidden", "href=\"report/\"");
    }
    html.into_bytes()
}

/// The policy under which the page may run its own scripts and styles, draw, and speak to `own`, where it came from.
/// `'self'` covers the WebSocket in newer browsers only, so that is spelled out. No text can become markup or a script:
/// of trusted types there are none.
fn policy(own: &Authority) -> String {
    format!(
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self' ws://{own}; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'; require-trusted-types-for 'script'; \
         trusted-types 'none'"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures_util::FutureExt;
    use std::collections::BTreeSet;
    use std::future::ready;
    use std::pin::pin;

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

    #[test]
    fn the_document_names_only_files_that_are_served() {
        let html = String::from_utf8(document(ASSETS[0].bytes, false)).unwrap();
        let own = Authority::parse("127.0.0.1:9095").unwrap();
        let named: Vec<&str> = html
            .split(['"'])
            .filter(|one| one.starts_with("/v/"))
            .collect();
        let files: BTreeSet<&str> = named.iter().copied().collect();
        assert_eq!(files.len(), 3, "{files:?}");
        for path in named {
            assert!(find(path, &own, "").is_some(), "{path}");
        }
    }

    #[tokio::test]
    async fn a_file_is_packed_once_and_not_by_the_thread_that_serves_everybody() {
        let own = Authority::parse("127.0.0.1:9095").unwrap();
        let path = versioned(SCRIPT);
        let file = || find(&path, &own, "gzip, deflate").unwrap();
        let site = Site::default();
        let ask = || file().answer(&site);
        let mut asked = pin!(ask());
        let first = tokio::select! {
            biased;
            response = &mut asked => panic!("packed at once: {response:?}"),
            () = ready(()) => asked.await,
        };
        assert!(first.head().contains("Content-Encoding: deflate"));
        assert_eq!(ask().now_or_never(), Some(first));
    }

    #[test]
    fn the_one_script_holds_every_module_once_and_imports_nothing() {
        let text = std::str::from_utf8(BUNDLES[0].bytes).unwrap();
        for asset in ASSETS.iter().filter(|asset| asset.kind == JAVASCRIPT) {
            let begin = format!("const ${} = (() => {{", asset.file.trim_end_matches(".js"));
            assert_eq!(text.matches(&begin).count(), 1, "{}", asset.file);
        }
        let line = text
            .lines()
            .find(|line| line.starts_with("import ") || line.starts_with("} from"));
        assert_eq!(line, None);
    }

    #[test]
    fn the_one_style_sheet_holds_every_other_once_and_imports_nothing() {
        let text = std::str::from_utf8(BUNDLES[1].bytes).unwrap();
        for asset in ASSETS
            .iter()
            .filter(|asset| asset.kind == CSS && asset.file != "style.css")
        {
            let sheet = std::str::from_utf8(asset.bytes).unwrap();
            assert_eq!(text.matches(sheet).count(), 1, "{}", asset.file);
        }
        assert!(!text.contains("@import"));
    }

    #[test]
    fn the_way_to_the_report_is_shown_only_if_there_is_one() {
        for (has_report, hidden) in [(true, false), (false, true)] {
            let html = String::from_utf8(document(ASSETS[0].bytes, has_report)).unwrap();
            assert_eq!(html.contains("href=\"report/\" hidden"), hidden);
        }
    }
}

//! The machine of the measurements: processor, load, flags, and the version of the program.
//!
//! **Invariant:** a value that cannot be determined is reported as unknown, never guessed.

use std::fs;

use serde::Serialize;

/// The program's version, with the commit of a release build.
const VERSION: &str = env!("PENDULARM_VERSION");

/// Facts about the machine and the build, in the order in which they are shown.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Machine {
    /// The program's version, with the commit of a release build.
    pub(crate) version: String,
    pub(crate) facts: Vec<(String, String)>,
    #[serde(skip)]
    pub(crate) processor: String,
}

impl Machine {
    pub(crate) fn here() -> Self {
        use std::env::consts::{ARCH, OS};
        let build = if cfg!(debug_assertions) {
            "development build: its times say nothing about the shipped program"
        } else {
            "release build (optimised)"
        };
        let cores = std::thread::available_parallelism().ok();
        let load = load().map(|load| {
            format!("{load} (1, 5 and 15 minutes); above 0 other programs were running")
        });
        let unknown = || "unknown".to_owned();
        let processor = processor().unwrap_or_else(unknown);
        let facts = [
            ("Version", Some(format!("pendularm {VERSION}"))),
            ("Build", Some(build.to_owned())),
            ("Target", Some(format!("{ARCH} {OS}, {}", features()))),
            ("Processor", Some(processor.clone())),
            ("Cores", cores.map(|cores| cores.to_string())),
            ("Load when started", load),
        ];
        let facts = facts.map(|(name, value)| (name.to_owned(), value.unwrap_or_else(unknown)));
        let (version, facts) = (VERSION.to_owned(), facts.to_vec());
        Self {
            version,
            facts,
            processor,
        }
    }
}

fn processor() -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

fn load() -> Option<String> {
    let text = fs::read_to_string("/proc/loadavg").ok()?;
    Some(text.split(' ').take(3).collect::<Vec<_>>().join(" "))
}

fn features() -> &'static str {
    if cfg!(target_feature = "avx2") {
        "compiled for AVX2"
    } else if cfg!(target_feature = "sse2") {
        "compiled for the baseline (SSE2), no fused multiply-add"
    } else {
        "compiled for the baseline"
    }
}

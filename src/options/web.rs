//! The options of the site.
//!
//! **Invariant:** without any of them, only this machine and its own pages are let in.

use std::path::PathBuf;

use super::setting::{Given, LaunchOption};
use super::usage::UsageError;
use crate::web::DEFAULT_REPORT;
use crate::web::authority::Authority;

pub(super) const ALLOW_HOST: LaunchOption = LaunchOption {
    option: "allow-host",
    variable: "ARM_SIM_ALLOW_HOST",
    value: "HOSTS",
    about: "Names besides loopback's that a browser may find this runtime under, separated by commas",
    default: "none",
    is_switch: false,
};

pub(super) const ALLOW_ORIGIN: LaunchOption = LaunchOption {
    option: "allow-origin",
    variable: "ARM_SIM_ALLOW_ORIGIN",
    value: "ORIGINS",
    about: "Pages besides this machine's that may open a WebSocket, by origin, separated by commas",
    default: "none",
    is_switch: false,
};

pub(super) const STRICT_ORIGIN: LaunchOption = LaunchOption {
    option: "strict-origin",
    variable: "ARM_SIM_STRICT_ORIGIN",
    value: "SWITCH",
    about: "Of pages, lets only this runtime's own and those of --allow-origin open a WebSocket; a token does that too",
    default: "false",
    is_switch: true,
};

pub(super) const REPORT: LaunchOption = LaunchOption {
    option: "report",
    variable: "ARM_SIM_REPORT",
    value: "FOLDER",
    about: "Folder of the report that is shown at /report/",
    default: DEFAULT_REPORT,
    is_switch: false,
};

/// The options of the site, as chosen at launch.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WebOptions {
    /// Names that a browser may find the runtime under, besides loopback's and the address bound.
    pub hosts: Vec<Authority>,
    /// Pages that may open a WebSocket, besides those of this machine; in lower case.
    pub origins: Vec<Box<str>>,
    /// Other pages of this machine may not; with a token they may not anyway.
    pub strict_origin: bool,
    /// Folder of the report.
    pub report: PathBuf,
}

impl Default for WebOptions {
    fn default() -> Self {
        Self {
            hosts: Vec::new(),
            origins: Vec::new(),
            strict_origin: false,
            report: DEFAULT_REPORT.into(),
        }
    }
}

impl WebOptions {
    pub(super) fn read(given: impl Fn(&LaunchOption) -> Option<Given>) -> Result<Self, UsageError> {
        let standard = Self::default();
        Ok(Self {
            hosts: given(&ALLOW_HOST)
                .map(read_hosts)
                .transpose()?
                .unwrap_or_default(),
            origins: given(&ALLOW_ORIGIN)
                .map(read_origins)
                .transpose()?
                .unwrap_or_default(),
            strict_origin: given(&STRICT_ORIGIN)
                .map(read_switch)
                .transpose()?
                .unwrap_or(standard.strict_origin),
            report: given(&REPORT).map_or(standard.report, |given| given.value.into()),
        })
    }
}

fn read_hosts(Given { origin, value }: Given) -> Result<Vec<Authority>, UsageError> {
    let hosts: Option<Vec<Authority>> = list(&value).map(Authority::parse).collect();
    hosts.ok_or(UsageError::AllowHost { origin, value })
}

fn read_origins(Given { origin, value }: Given) -> Result<Vec<Box<str>>, UsageError> {
    if !list(&value).all(is_origin) {
        return Err(UsageError::AllowOrigin { origin, value });
    }
    let lower = list(&value).map(|one| one.to_ascii_lowercase().into());
    Ok(lower.collect())
}

fn is_origin(text: &str) -> bool {
    let in_scheme = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'-' | b'.');
    match text.split_once("://") {
        Some(("file", "")) => true,
        Some((scheme, host)) => {
            !scheme.is_empty() && scheme.bytes().all(in_scheme) && Authority::parse(host).is_some()
        }
        None => text == "null",
    }
}

fn list(value: &str) -> impl Iterator<Item = &str> {
    value.split(',').map(str::trim)
}

fn read_switch(Given { origin, value }: Given) -> Result<bool, UsageError> {
    switch(&value).ok_or(UsageError::Switch { origin, value })
}

fn switch(value: &str) -> Option<bool> {
    match value {
        "true" | "1" | "yes" | "on" => Some(true),
        "false" | "0" | "no" | "off" => Some(false),
        _ => None,
    }
}

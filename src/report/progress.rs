//! How far the report is and how long it will take, on standard error.
//!
//! On a terminal one line is redrawn; elsewhere a plain line is written now and then, so that a log stays readable.
//!
//! **Invariant:** a standard error that is closed or full hinders nothing.

use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

use crate::math::count::length_in_f64;

/// Time between two redrawn lines, and between two plain ones.
const REDRAW: Duration = Duration::from_millis(100);
const PLAIN: Duration = Duration::from_secs(10);

const CELLS: usize = 30;

/// Sections are made side by side, so that several may be under way.
///
/// Work is measured in weights, which are about seconds on the machine they were chosen on.
#[derive(Debug)]
pub(crate) struct ProgressBar {
    terminal: bool,
    started: Instant,
    shown: Option<Instant>,
    done: f64,
    /// Sections under way: weight, and how much is done.
    current: Vec<(&'static str, f64, f64)>,
    total: f64,
}

impl ProgressBar {
    pub(crate) fn new(total: f64) -> Self {
        Self {
            terminal: io::stderr().is_terminal(),
            started: Instant::now(),
            shown: None,
            done: 0.0,
            current: Vec::new(),
            total,
        }
    }

    /// A section of this weight begins.
    pub(crate) fn begin(&mut self, section: &'static str, weight: f64) {
        self.current.push((section, weight, 0.0));
        self.show(true);
    }

    /// A section is this far, from 0 to 1.
    pub(crate) fn at(&mut self, section: &str, part: f64) {
        for current in self.current.iter_mut().filter(|it| it.0 == section) {
            current.2 = part.clamp(0.0, 1.0);
        }
        self.show(false);
    }

    /// A section is done.
    pub(crate) fn end(&mut self, section: &str) {
        self.current.retain(|current| {
            let ends = current.0 == section;
            self.done += if ends { current.1 } else { 0.0 };
            !ends
        });
    }

    /// All is done; `line` is the last word.
    pub(crate) fn finish(&self, line: &str) {
        let clear = if self.terminal { "\r\x1b[K" } else { "" };
        let _ = writeln!(io::stderr(), "{clear}{line}");
    }

    fn show(&mut self, now: bool) {
        let pause = if self.terminal { REDRAW } else { PLAIN };
        let early = self.shown.is_some_and(|shown| shown.elapsed() < pause);
        if early && !now {
            return;
        }
        self.shown = Some(Instant::now());
        let under_way: f64 = self.current.iter().map(|it| it.1 * it.2).sum();
        let fraction = ((self.done + under_way) / self.total).clamp(0.0, 1.0);
        let names: Vec<&str> = self.current.iter().map(|it| it.0).collect();
        let names = names.join(", ");
        let elapsed = self.started.elapsed().as_secs_f64();
        // Early on the estimate would be wild.
        let left = if fraction > 0.02 {
            format!("{} left", minutes(elapsed * (1.0 - fraction) / fraction))
        } else {
            "estimating".to_owned()
        };
        let percent = 100.0 * fraction;
        let _ = if self.terminal {
            let bar = bar(fraction);
            write!(
                io::stderr(),
                "\r\x1b[K{bar} {percent:3.0} %  {left}  {names}"
            )
        } else {
            writeln!(io::stderr(), "{percent:3.0} %, {left}: {names}")
        };
    }
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a fraction between 0 and 1 of a few cells"
)]
fn bar(fraction: f64) -> String {
    let full = (fraction * length_in_f64(CELLS)).round() as usize;
    format!(
        "[{}{}]",
        "#".repeat(full),
        ".".repeat(CELLS.saturating_sub(full))
    )
}

fn minutes(seconds: f64) -> String {
    if seconds < 60.0 {
        format!("{seconds:.0} s")
    } else {
        format!(
            "{:.0} min {:02.0} s",
            (seconds / 60.0).floor(),
            seconds % 60.0
        )
    }
}

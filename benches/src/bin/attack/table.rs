//! The table: a row per attack, with a star at each missed bar.

use std::fmt;
use std::sync::atomic::Ordering;
use std::time::Duration;

use pendularm_benches::attack::Attack;
use pendularm_benches::attack::stage::Deeds;
use pendularm_benches::healthy::Health;

/// Bounds that must hold.
pub struct Bars {
    /// For 99 of 100 calls \[ms\].
    p99: f64,
    /// Between two messages of `/joint_states` \[ms\].
    gap: f64,
    /// Peak of resident memory \[MB\].
    peak: f64,
    /// From SIGTERM to the end.
    end: Duration,
}

impl Bars {
    pub const FULL: Self = Self {
        p99: 50.0,
        gap: 250.0,
        peak: 700.0,
        end: Duration::from_secs(1),
    };
    /// A busy machine may only be late. More memory, lost answers, or a missing end are faults.
    pub const QUICK: Self = Self {
        p99: 500.0,
        gap: 1_000.0,
        peak: 700.0,
        end: Duration::from_millis(1_500),
    };
}

impl fmt::Display for Bars {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            p99,
            gap,
            peak,
            end,
        } = self;
        write!(
            f,
            "bars: every call answered, 99 of 100 within {p99} ms; gaps of /joint_states at most {gap} ms; \
             at most {peak} MB; "
        )?;
        write!(
            f,
            "ended {} ms after SIGTERM; newcomers served where there is a place. * marks a miss",
            end.as_millis()
        )
    }
}

/// Whether every bar was met, and if not, whether only times were missed.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    Held,
    Late,
    Missed,
}

/// The outcome of an attack.
pub struct Row {
    pub attack: Attack,
    pub health: Health,
    /// Resident memory \[MB\].
    pub peak: f64,
    /// Time from SIGTERM to the end, and the exit status.
    pub ended: Result<(Duration, Option<i32>), String>,
    pub deeds: Deeds,
    /// There were attackers.
    pub attacked: bool,
}

pub fn print_head() {
    println!(
        "{:<21} {:>11} {:>8} {:>9} {:>9} {:>10} {:>8} {:>9} {:>8} {:>8} {:>7} {:>8}",
        "attack",
        "answered",
        "p50, ms",
        "p99, ms",
        "max, ms",
        "gap, ms",
        "served",
        "in, ms",
        "peak, MB",
        "end, ms",
        "conns",
        "sent, MB"
    );
}

impl Row {
    /// Prints it, and judges it.
    pub fn print(&self, bars: &Bars) -> Verdict {
        let health = &self.health;
        let delays = &health.delays;
        let at = |part: f64| {
            delays.get(((delays.len() as f64 * part) as usize).min(delays.len().wrapping_sub(1)))
        };
        let [p50, p99, most] = [0.5, 0.99, 1.0].map(|part| at(part).copied().unwrap_or(f64::NAN));
        let (mut is_sound, mut is_prompt) = (health.faults.is_empty(), true);
        let star = |text: String, holds: bool| format!("{text}{}", if holds { " " } else { "*" });
        let mut mark = |text: String, holds: bool| {
            is_sound &= holds;
            star(text, holds)
        };
        let mut mark_time = |text: String, holds: bool| {
            is_prompt &= holds;
            star(text, holds)
        };
        let answered = mark(
            format!("{}/{}", delays.len(), health.asked),
            delays.len() == health.asked,
        );
        let p99 = mark_time(format!("{p99:.1}"), p99 <= bars.p99);
        let gap = mark_time(
            format!("{:.0}", health.longest_gap),
            health.longest_gap <= bars.gap,
        );
        // Otherwise new clients have a place, and must be served.
        let is_full = self.attack.fills;
        let welcome = is_full || health.served == health.visits;
        let served = mark(format!("{}/{}", health.served, health.visits), welcome);
        let peak = mark(format!("{:.0}", self.peak), self.peak <= bars.peak);
        let ended = match &self.ended {
            Ok((time, Some(0))) => mark_time(time.as_millis().to_string(), *time <= bars.end),
            Ok((time, _)) => mark(time.as_millis().to_string(), false),
            Err(_) => mark("never".to_owned(), false),
        };
        let (connections, sent) = (
            self.deeds.connections.load(Ordering::Relaxed),
            self.deeds.sent.load(Ordering::Relaxed),
        );
        // An attack without any action shows nothing.
        let connections = mark(connections.to_string(), !self.attacked || connections > 0);
        println!(
            "{:<21} {answered:>11} {p50:>8.1} {p99:>9} {most:>9.0} {gap:>10} {served:>8} {:>9.0} {peak:>8} \
             {ended:>8} {connections:>7} {:>8.1}",
            self.attack.name,
            health.longest_visit,
            sent as f64 / 1e6,
        );
        for fault in &health.faults {
            println!("     {}", shortened(fault));
        }
        if let Some(fault) = health.visit_fault.as_ref().filter(|_| !is_full) {
            println!("     a newcomer: {}", shortened(fault));
        }
        if let Err(why) = &self.ended {
            println!("     {why}");
        }
        match (is_sound, is_prompt) {
            (true, true) => Verdict::Held,
            (true, false) => Verdict::Late,
            (false, _) => Verdict::Missed,
        }
    }
}

fn shortened(text: &str) -> String {
    text.trim().chars().take(200).collect()
}

//! The verdict on the healthy clients' record: was `/joint_states` in time and in order, did the arm keep time.
//!
//! **Invariant:** pure; judges what was kept, with nothing left out.

use std::time::{Duration, Instant};

use crate::statistics::{quantile, sorted};
use crate::watch::{PERIOD, Record, Seen};
use crate::world::Deeds;

/// How much later than its period a message may come to a healthy client, beyond what the machine itself is late by.
pub const LATE: f64 = 0.1;
/// How far simulation time may be off wall time: a thousandth.
pub const RATE: f64 = 0.001;
/// How long after a reset or a pause its traces may still be read. Where the machine stands still the reader is late
/// too, and has them all at once then. A clock that has really stopped stands for longer.
const TRACE: Duration = Duration::from_secs(2);
/// How often a stamp may be repeated. A message that is late by almost a period is followed at once by the next, and no
/// step may be due between them.
const STILL: usize = 1;
/// A gap of so much ends a run. The arm makes up for 250 ms and drops, as it says, what a machine owes it beyond that; gaps
/// that are not the machine's doing are judged as gaps.
const STALL: Duration = Duration::from_millis(200);
/// Shorter runs of the clock say nothing of its rate.
const LEAST_RUN: f64 = 4.0;
/// Messages at each end of a run, of which the least late one counts.
const END: usize = 60;
/// Messages at the beginning of a run that do not count. The last before a resume has the stamp of the pause, and the
/// new timestep that is set then discards a part of a step.
const BEGINNING: usize = 30;

/// How late messages came \[s\].
#[derive(Debug, Clone)]
pub struct Gaps {
    /// Half of the gaps are below; all but one in a hundred; all but one in a thousand; all.
    pub quantiles: [f64; 4],
    /// Gaps that exceed the bar and what the machine is late by.
    pub late: usize,
    /// The largest excess over the period and over the machine.
    pub worst_excess: f64,
    /// The longest gaps, longest first.
    pub longest: Vec<Gap>,
}

/// One gap \[s\].
#[derive(Debug, Clone, Copy)]
pub struct Gap {
    /// When it ended.
    pub at: Instant,
    /// From one message to the next.
    pub length: f64,
    /// Lateness of the machine itself: the most of what the controls were late by, and for how long threads waited for a processor.
    pub machine: f64,
    /// For how long the program ran.
    pub ran: f64,
}

/// Gaps that are shown.
const SHOWN: usize = 5;

/// Quantiles of the gaps between these times \[s\].
pub fn quantiles(times: impl Iterator<Item = Instant>) -> [f64; 4] {
    let times: Vec<Instant> = times.collect();
    let gaps = sorted(times.windows(2).map(|two| (two[1] - two[0]).as_secs_f64()));
    [0.5, 0.99, 0.999, 1.0].map(|share| quantile(&gaps, share))
}

/// The gaps between messages beside what the controls were late by in the same window.
pub fn gaps(record: &Record) -> Gaps {
    let period = PERIOD.as_secs_f64();
    let mut gaps = Gaps {
        quantiles: quantiles(record.states.iter().map(|seen| seen.at)),
        late: 0,
        worst_excess: f64::NEG_INFINITY,
        longest: Vec::new(),
    };
    for two in record.states.windows(2) {
        let (before, now) = (two[0], two[1]);
        let length = (now.at - before.at).as_secs_f64();
        // Most gaps are as they should be; only long ones are worth a look at the controls.
        let machine = if length > 2.0 * period {
            machine_late(record, before, now)
        } else {
            0.0
        };
        let excess = length - period - machine;
        gaps.late += usize::from(excess > LATE);
        gaps.worst_excess = gaps.worst_excess.max(excess);
        gaps.longest.push(Gap {
            at: now.at,
            length,
            machine,
            ran: now.ran - before.ran,
        });
    }
    gaps.longest
        .sort_by(|one, other| other.length.total_cmp(&one.length));
    gaps.longest.truncate(SHOWN);
    gaps
}

/// The most of what the controls were late by between these messages, and of what the threads on the way waited for a
/// processor.
fn machine_late(record: &Record, before: Seen, now: Seen) -> f64 {
    let (from, to) = (before.at, now.at);
    let first = record.woken.partition_point(|(at, _)| *at < from);
    let woken = record.woken[first..].iter();
    // One more, since whoever should have woken in the window may have done so only after it.
    let within = woken.clone().take_while(|(at, _)| *at <= to).count() + 1;
    let slept = woken
        .take(within)
        .map(|(_, late)| *late)
        .fold(0.0, f64::max);
    let first = record.bare.partition_point(|at| *at < from).max(1);
    let mut bare: f64 = 0.0;
    for index in first..record.bare.len() {
        let (before, at) = (record.bare[index - 1], record.bare[index]);
        if before > to {
            break;
        }
        bare = bare.max((at - before).as_secs_f64() - PERIOD.as_secs_f64());
    }
    slept.max(bare).max(now.queued - before.queued)
}

/// Stamps that go back without a reset, or stand still without a pause.
pub fn disorder(states: &[Seen], deeds: &Deeds) -> Vec<String> {
    let mut resets = deeds.resets.clone();
    let mut wrong = Vec::new();
    let mut still = 0;
    for two in states.windows(2) {
        let (before, now) = (two[0], two[1]);
        let in_window = |(from, to): &(Instant, Instant)| now.at >= *from && now.at <= *to + TRACE;
        still = if now.stamp > before.stamp {
            0
        } else {
            still + 1
        };
        if now.stamp < before.stamp {
            match resets.iter().position(in_window) {
                Some(reset) => drop(resets.remove(reset)),
                None => wrong.push(format!(
                    "stamp {} after {} without a reset",
                    now.stamp, before.stamp
                )),
            }
        } else if still > STILL && !deeds.pauses.iter().any(in_window) {
            wrong.push(format!(
                "stamp {} {} times without a pause",
                now.stamp,
                still + 1
            ));
        }
    }
    wrong
}

/// Simulation time beside wall time, over the runs of the clock between pauses and resets.
#[derive(Debug, Clone, Copy)]
pub struct Rate {
    /// Wall time that was measured \[s\].
    pub measured: f64,
    /// Simulation time over wall time; `None` where there was no run that is long enough.
    pub ratio: Option<f64>,
    /// The runs, and the ratio of the one that is farthest off.
    pub runs: usize,
    /// The largest such ratio.
    pub worst: f64,
    /// Gaps of [`STALL`] and more, at which runs are cut, and the simulation time that was lost at them \[s\].
    pub stalls: usize,
    /// The time that was lost so.
    pub lost: f64,
}

/// The rate of the arm's clock. A message may be read late, never early: at both ends of a run the least late of many counts.
pub fn rate(states: &[Seen]) -> Rate {
    let (mut measured, mut simulated, mut runs, mut worst) = (0.0, 0.0, 0, 1.0_f64);
    let (mut stalls, mut lost) = (0, 0.0);
    let goes_on =
        |before: &Seen, now: &Seen| now.stamp > before.stamp && now.at - before.at < STALL;
    for two in states.windows(2) {
        let (wall, sim) = (two[1].at - two[0].at, two[1].stamp - two[0].stamp);
        if wall >= STALL {
            stalls += 1;
            lost += (wall.as_secs_f64() - sim).max(0.0);
        }
    }
    for run in states.chunk_by(goes_on) {
        let run = run.get(BEGINNING..).unwrap_or_default();
        let (Some(first), Some(last)) = (run.first(), run.last()) else {
            continue;
        };
        if run.len() < 2 * END || last.stamp - first.stamp < LEAST_RUN {
            continue;
        }
        let wall = |seen: &Seen| (seen.at - first.at).as_secs_f64();
        let delay = |seen: &Seen| wall(seen) - seen.stamp;
        let least = |part: &[Seen]| {
            part.iter()
                .min_by(|one, two| delay(one).total_cmp(&delay(two)))
                .map(|seen| (wall(seen), seen.stamp))
        };
        if let (Some(begin), Some(end)) = (least(&run[..END]), least(&run[run.len() - END..])) {
            let (wall, sim) = (end.0 - begin.0, end.1 - begin.1);
            (measured, simulated, runs) = (measured + wall, simulated + sim, runs + 1);
            if (sim / wall - 1.0).abs() > (worst - 1.0).abs() {
                worst = sim / wall;
            }
        }
    }
    Rate {
        measured,
        ratio: (runs > 0).then(|| simulated / measured),
        runs,
        worst,
        stalls,
        lost,
    }
}

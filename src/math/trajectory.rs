//! A path through points with times: the desired joint state at every time, and its tolerances.
//!
//! Between two points that both have velocities, the path is the cubic Hermite polynomial with these velocities.
//! Otherwise it is a straight line. With `s = (t - t₀)/h`, `h = t₁ - t₀`:
//!
//! ```text
//! q(t) = (2s³ - 3s² + 1) q₀ + (s³ - 2s² + s) h v₀ + (3s² - 2s³) q₁ + (s³ - s²) h v₁
//! ```
//!
//! **Invariant:** a path has at least one point, and its times increase. Before the first and after the last point the
//! desired state is that point at rest.

#![allow(
    clippy::indexing_slicing,
    reason = "every index comes from `array::from_fn` over arrays of the same constant length"
)]

use super::arm::State;
use super::goal::{Dwell, SUCCESS_HOLD};
use super::pid::Setpoint;
use super::shown::shown_against;

/// A point of a path. Its numbers must be finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waypoint<const N: usize> {
    /// Time of the point from the start \[s\].
    pub time: f64,
    /// Joint positions \[rad\].
    pub position: [f64; N],
    /// Joint velocities \[rad/s\].
    pub velocity: Option<[f64; N]>,
}

/// Why points form no path.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PathError {
    /// There is no point.
    #[error("points must have at least one entry")]
    NoPoints,
    /// A time is not greater than the one before it, or the first is before the start.
    #[error("points[{0}].time_from_start must be greater than that of the point before")]
    Order(
        /// The point.
        usize,
    ),
    /// Between the previous point and this one, a position or a velocity would not be finite.
    #[error("points[{0}] must be reached from the point before by finite positions and velocities")]
    NotFinite(
        /// The point.
        usize,
    ),
}

/// A path through points.
#[derive(Debug, Clone, PartialEq)]
pub struct JointPath<const N: usize> {
    points: Vec<Waypoint<N>>,
}

impl<const N: usize> JointPath<N> {
    /// The path through `points`, which begins at time 0 at the joints' present position `start`.
    ///
    /// # Errors
    /// If there is no point, the times do not increase, or the numbers between two points overflow.
    pub fn new(start: Waypoint<N>, mut points: Vec<Waypoint<N>>) -> Result<Self, PathError> {
        let first = points.first().ok_or(PathError::NoPoints)?;
        if first.time < 0.0 {
            return Err(PathError::Order(0));
        }
        let pairs = points.iter().zip(points.iter().skip(1));
        if let Some(at) = pairs
            .into_iter()
            .position(|(one, next)| next.time <= one.time)
        {
            return Err(PathError::Order(at + 1));
        }
        let begins_before = first.time > 0.0;
        if begins_before {
            let start = Waypoint { time: 0.0, ..start };
            points.insert(0, start);
        }
        // The first point is compared with itself.
        let mut pairs = points.iter().take(1).chain(&points).zip(&points);
        if let Some(at) = pairs.position(|(one, next)| !is_finite(one, next)) {
            let at = at.saturating_sub(usize::from(begins_before));
            return Err(PathError::NotFinite(at));
        }
        Ok(Self { points })
    }

    /// The time of the last point \[s\].
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.points.last().map_or(0.0, |last| last.time)
    }

    /// The desired positions and velocities of the joints `time` after the start \[s\].
    #[must_use]
    pub fn at(&self, time: f64) -> Setpoint<N> {
        let behind = self.points.partition_point(|point| point.time <= time);
        let before = behind.checked_sub(1).and_then(|at| self.points.get(at));
        match (before, self.points.get(behind)) {
            (Some(before), Some(next)) => between(before, next, time),
            (Some(only), None) | (None, Some(only)) => Setpoint::at(only.position),
            (None, None) => {
                debug_assert!(false, "a path has points");
                Setpoint::at([0.0; N])
            }
        }
    }

    /// The desired positions `time` after the start \[s\], and the mean velocities over the next `hold` \[s\]: a setpoint
    /// that is held for that time, in which the path may end or turn.
    #[must_use]
    pub fn held(&self, time: f64, hold: f64) -> Setpoint<N> {
        let (now, then) = (self.at(time), self.at(time + hold));
        let mean = |i| (then.position[i] - now.position[i]) / hold;
        Setpoint {
            velocity: std::array::from_fn(mean),
            ..now
        }
    }
}

/// Whether no term of [`between`] overflows. Each term is at most a small multiple of one of these.
fn is_finite<const N: usize>(before: &Waypoint<N>, next: &Waypoint<N>) -> bool {
    let h = next.time - before.time;
    let (v0, v1) = (before.velocity, next.velocity);
    (0..N).all(|i| {
        let way = before.position[i].abs() + next.position[i].abs();
        let speed = v0.map_or(0.0, |v| v[i].abs()) + v1.map_or(0.0, |v| v[i].abs());
        let rate = if h == 0.0 { 0.0 } else { 6.0 * way / h };
        (12.0 * (way + speed * h.max(1.0)) + rate).is_finite()
    })
}

fn between<const N: usize>(before: &Waypoint<N>, next: &Waypoint<N>, time: f64) -> Setpoint<N> {
    let h = next.time - before.time;
    let s = (time - before.time) / h;
    let (p0, p1) = (&before.position, &next.position);
    let (Some(v0), Some(v1)) = (&before.velocity, &next.velocity) else {
        return Setpoint {
            position: std::array::from_fn(|i| p0[i] + s * (p1[i] - p0[i])),
            velocity: std::array::from_fn(|i| (p1[i] - p0[i]) / h),
        };
    };
    let (s2, s3) = (s * s, s * s * s);
    Setpoint {
        position: std::array::from_fn(|i| {
            (2.0 * s3 - 3.0 * s2 + 1.0) * p0[i]
                + (s3 - 2.0 * s2 + s) * h * v0[i]
                + (3.0 * s2 - 2.0 * s3) * p1[i]
                + (s3 - s2) * h * v1[i]
        }),
        velocity: std::array::from_fn(|i| {
            6.0 * (s2 - s) * (p0[i] - p1[i]) / h
                + (3.0 * s2 - 4.0 * s + 1.0) * v0[i]
                + (3.0 * s2 - 2.0 * s) * v1[i]
        }),
    }
}

/// Largest allowed deviations of a joint. `None` allows any deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance<const N: usize> {
    /// \[rad\], at least 0.
    pub position: [Option<f64>; N],
    /// \[rad/s\], at least 0.
    pub velocity: [Option<f64>; N],
}

impl<const N: usize> Tolerance<N> {
    /// Whether every position and velocity is allowed.
    fn is_any(&self) -> bool {
        let mut limits = self.position.iter().chain(&self.velocity);
        limits.all(Option::is_none)
    }

    /// The first joint whose deviation exceeds its tolerance.
    #[must_use]
    pub fn exceeded(&self, desired: &Setpoint<N>, actual: &State<N>) -> Option<Excess> {
        let off = |wanted: &[f64; N], is: &[f64; N], limits: &[Option<f64>; N], quantity| {
            (0..N).find_map(|joint| {
                let limit = limits[joint]?;
                let error = wanted[joint] - is[joint];
                // NaN is within no tolerance.
                let is_within = error.abs() <= limit;
                (!is_within).then_some(Excess {
                    joint,
                    quantity,
                    error,
                    limit,
                })
            })
        };
        off(
            &desired.position,
            &actual.position,
            &self.position,
            "position",
        )
        .or_else(|| {
            off(
                &desired.velocity,
                &actual.velocity,
                &self.velocity,
                "velocity",
            )
        })
    }
}

/// A joint whose deviation exceeds its tolerance.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "{quantity} of joint{} is off by {}, more than {}",
    .joint + 1, shown_against(*.error, *.limit), shown_against(*.limit, *.error)
)]
pub struct Excess {
    /// Index of the joint.
    pub joint: usize,
    /// `position` or `velocity`.
    pub quantity: &'static str,
    /// \[rad\] or \[rad/s\].
    pub error: f64,
    /// The same.
    pub limit: f64,
}

/// A path, and the tolerances for following it.
#[derive(Debug, Clone, PartialEq)]
pub struct PathTask<const N: usize> {
    /// The path.
    pub path: JointPath<N>,
    /// Tolerance on the way.
    pub on_the_way: Tolerance<N>,
    /// Tolerance at the end.
    pub at_the_end: Tolerance<N>,
    /// Time after the end in which the joints must arrive \[s\]; infinite for no limit.
    pub patience: f64,
    /// The present stay within the tolerance at the end.
    pub dwell: Dwell,
}

/// The progress of the joints on a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Standing {
    /// They are on their way.
    Moving,
    /// They have arrived.
    Arrived,
    /// They have left the tolerance of the path.
    OffPath(Excess),
    /// They have not arrived in time.
    Late(Excess),
}

impl<const N: usize> PathTask<N> {
    /// The progress of joints at `actual`, `time` after the start \[s\]. They have arrived once they have stayed
    /// within the tolerance for [`SUCCESS_HOLD`], because a joint may also pass through it.
    pub fn judge(&mut self, time: f64, actual: &State<N>) -> Standing {
        let desired = self.path.at(time);
        let duration = self.path.duration();
        if time < duration {
            let excess = self.on_the_way.exceeded(&desired, actual);
            return excess.map_or(Standing::Moving, Standing::OffPath);
        }
        let excess = self.at_the_end.exceeded(&desired, actual);
        let stays = self.dwell.stays(time, excess.is_none(), SUCCESS_HOLD);
        match excess {
            None if stays || self.at_the_end.is_any() => Standing::Arrived,
            Some(excess) if time - duration > self.patience => Standing::Late(excess),
            _ => Standing::Moving,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The greatest number, so that twice of it overflows.
    const MAX: f64 = f64::MAX;

    /// Whether a path between two points is accepted: their times, positions and velocities.
    fn is_path(times: [f64; 2], positions: [f64; 2], velocities: Option<[f64; 2]>) -> bool {
        let point = |at: usize| Waypoint {
            time: times[at],
            position: [positions[at]],
            velocity: velocities.map(|both| [both[at]]),
        };
        JointPath::new(point(0), vec![point(0), point(1)]).is_ok()
    }

    #[test]
    fn each_term_of_a_path_and_their_sum_must_be_finite() {
        for (case, times, positions, velocities) in [
            ("both positions", [0.0, 1.0], [MAX / 25.0; 2], None),
            (
                "both velocities",
                [0.0, 1.0],
                [0.0; 2],
                Some([MAX / 20.0; 2]),
            ),
            (
                "the way of a velocity",
                [0.0, 1e155],
                [0.0; 2],
                Some([1e155, 0.0]),
            ),
            (
                "positions and velocities",
                [0.0, 1.0],
                [MAX / 30.0, 0.0],
                Some([MAX / 15.0, 0.0]),
            ),
            ("positions and rates", [0.0, 1.0], [MAX / 15.0, 0.0], None),
            (
                "a rate, after some time",
                [1.0, 1.5],
                [0.0, MAX / 20.0],
                None,
            ),
            ("a rate", [0.0, 1e-200], [MAX / 3e200, 0.0], None),
        ] {
            assert!(!is_path(times, positions, velocities), "{case}");
            let less = positions.map(|position| position / 1e3);
            let slower = velocities.map(|both| both.map(|velocity| velocity / 1e3));
            assert!(is_path(times, less, slower), "less of {case}");
        }
        for (time, position, velocity) in
            [(f64::NAN, 0.0, 0.0), (0.0, MAX, 0.0), (0.0, 0.0, f64::NAN)]
        {
            let only = Waypoint {
                time,
                position: [position],
                velocity: Some([velocity]),
            };
            let refused = JointPath::new(only, vec![only]);
            assert_eq!(refused, Err(PathError::NotFinite(0)));
        }
    }
}

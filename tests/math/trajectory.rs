//! Paths through points with times: they pass through their points, velocities are the derivatives of positions,
//! and tolerances are checked correctly.

use pendularm::math::arm::State;
use pendularm::math::goal::{Dwell, SUCCESS_HOLD};
use pendularm::math::trajectory::{JointPath, PathError, PathTask, Standing, Tolerance, Waypoint};

const START: Waypoint<2> = Waypoint {
    time: 0.0,
    position: [0.5, -0.5],
    velocity: Some([0.1, 0.0]),
};

fn straight(time: f64, position: [f64; 2]) -> Waypoint<2> {
    Waypoint {
        time,
        position,
        velocity: None,
    }
}

fn curved(time: f64, position: [f64; 2], velocity: [f64; 2]) -> Waypoint<2> {
    Waypoint {
        velocity: Some(velocity),
        ..straight(time, position)
    }
}

fn near(one: [f64; 2], other: [f64; 2], within: f64) -> bool {
    one.iter().zip(other).all(|(a, b)| (a - b).abs() <= within)
}

#[test]
fn a_path_passes_through_its_points_and_rests_before_and_after_them() {
    let points = vec![
        curved(1.0, [1.0, 0.0], [0.3, -0.2]),
        curved(1.5, [0.0, 2.0], [0.0, 0.0]),
        straight(4.0, [3.0, 3.0]),
    ];
    let path = JointPath::new(START, points.clone()).unwrap();
    assert_eq!(path.duration(), 4.0);
    for point in points.iter().chain([&START]) {
        let at = path.at(point.time);
        assert_eq!(at.position, point.position);
        if let Some(velocity) = point.velocity.filter(|_| point.time < 1.5) {
            // A few units in the last place of the differences in the formula.
            assert!(near(at.velocity, velocity, 1e-15), "{at:?}");
        }
    }
    let halfway = path.at(2.75);
    let velocity = [1.2, 0.4];
    assert!(near(halfway.position, [1.5, 2.5], 1e-15) && near(halfway.velocity, velocity, 1e-15));
    let end = path.at(9.0);
    assert_eq!((end.position, end.velocity), ([3.0, 3.0], [0.0, 0.0]));
    // A path that begins with its first point needs no start.
    let points = vec![straight(0.0, [1.0, 1.0]), straight(1.0, [2.0, 1.0])];
    let path = JointPath::new(START, points).unwrap();
    assert_eq!(path.at(0.0).position, [1.0, 1.0]);
    assert_eq!(path.at(-1.0).velocity, [0.0, 0.0]);
}

#[test]
fn velocities_are_the_derivatives_of_the_positions() {
    let points = vec![
        curved(0.7, [1.0, 0.0], [0.3, -0.2]),
        curved(1.5, [0.0, 2.0], [-1.0, 4.0]),
        straight(2.0, [3.0, 3.0]),
    ];
    let path = JointPath::new(START, points).unwrap();
    for step in 1..200_u32 {
        let (time, h) = (f64::from(step) / 100.0 + 0.003, 1e-6);
        let (before, after) = (path.at(time - h).position, path.at(time + h).position);
        let slope = [0, 1].map(|joint| (after[joint] - before[joint]) / (2.0 * h));
        // Central differences of a cubic: h² times its third derivative, some 100, and rounding, 1e-16 / h.
        let setpoint = path.at(time).velocity;
        assert!(near(slope, setpoint, 2e-9), "{time}: {slope:?}");
    }
}

#[test]
fn points_without_increasing_times_are_no_path() {
    let path = |times: &[f64]| {
        let points = times.iter().map(|time| straight(*time, [0.0, 0.0]));
        JointPath::new(START, points.collect()).map(|path| path.duration())
    };
    assert_eq!(path(&[]), Err(PathError::NoPoints));
    assert_eq!(path(&[-1.0]), Err(PathError::Order(0)));
    assert_eq!(path(&[0.0, 1.0, 1.0]), Err(PathError::Order(2)));
    assert_eq!(path(&[2.0, 1.0]), Err(PathError::Order(1)));
    assert_eq!(path(&[0.0]), Ok(0.0));
}

/// Finite points between which velocities are infinite or positions are not numbers.
#[test]
fn distances_that_overflow_are_no_path() {
    let resting = |time: f64, position: f64| straight(time, [position, 0.0]);
    let moving =
        |time: f64, position: f64, velocity: f64| curved(time, [position, 0.0], [velocity, 0.0]);
    for (at, points) in [
        (0, vec![resting(1.0, 1.7e308)]),
        (1, vec![resting(1.0, 0.0), resting(2.0, -1.7e308)]),
        (0, vec![resting(5e-324, 1.0)]),
        (1, vec![moving(0.0, 0.0, 0.0), moving(1e308, 1.0, 1e10)]),
        (0, vec![moving(f64::INFINITY, 1.0, 0.0)]),
    ] {
        let refused = JointPath::new(START, points);
        assert_eq!(refused, Err(PathError::NotFinite(at)));
    }
    let far = JointPath::new(START, vec![moving(1e290, 1e300, 1e9)]).unwrap();
    for part in 0..=1000 {
        let setpoint = far.at(1e287 * f64::from(part));
        let all = setpoint.position.iter().chain(&setpoint.velocity);
        assert!(all.into_iter().all(|one| one.is_finite()), "{setpoint:?}");
    }
}

#[test]
fn a_path_is_judged_by_its_path_tolerances_and_at_the_end_by_its_goal_tolerances() {
    let mut task = PathTask {
        path: JointPath::new(START, vec![straight(1.0, [0.5, 0.5])]).unwrap(),
        on_the_way: Tolerance {
            position: [Some(0.1), None],
            velocity: [None, Some(2.0)],
        },
        at_the_end: Tolerance {
            position: [Some(0.01); 2],
            velocity: [Some(1.0), None],
        },
        patience: 0.5,
        dwell: Dwell::default(),
    };
    let mut standing =
        |time, position, velocity| match task.judge(time, &State { position, velocity }) {
            Standing::Moving => "moving".to_owned(),
            Standing::Arrived => "arrived".to_owned(),
            Standing::OffPath(excess) => format!("off: {excess}"),
            Standing::Late(excess) => format!("late: {excess}"),
        };
    let (rest, there) = ([0.0, 0.0], [0.5, 0.505]);
    let far_off = "off: position of joint1 is off by 0.25, more than 0.1";
    for (time, position, velocity, expected) in [
        (0.5, [0.55, 9.0], rest, "moving"),
        (0.5, [0.25, 0.0], rest, far_off),
        (0.5, [0.5, 0.0], [0.0, -2.0], "off: velocity of joint2"),
        (0.5, [f64::NAN, 0.0], rest, "off: position of joint1"),
        (1.5, [0.5, 0.6], rest, "moving"),
        (1.6, [0.5, 0.6], rest, "late: position of joint2"),
        // A joint has arrived if it stays. A joint that passes through is late.
        (2.0, there, [0.9, 9.0], "moving"),
        (2.0 + SUCCESS_HOLD, there, [0.9, 9.0], "arrived"),
        (3.0, there, [0.9, 9.0], "arrived"),
        (3.0, there, [1.1, 9.0], "late: velocity of joint1"),
        (3.1, there, rest, "moving"),
    ] {
        let found = standing(time, position, velocity);
        assert!(found.starts_with(expected), "{found} for {expected}");
    }
    let far = State::at_rest([9.0; 2]);
    task.patience = f64::INFINITY;
    assert_eq!(task.judge(1e300, &far), Standing::Moving);
    task.at_the_end = Tolerance {
        position: [None; 2],
        velocity: [None; 2],
    };
    assert_eq!(task.judge(1.0, &far), Standing::Arrived);
}

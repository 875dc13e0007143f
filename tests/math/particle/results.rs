//! How the samples come back: the entries, their times, slices, and values that are no numbers.
//!
//! **Invariant:** everything here is compared exactly.

use pendularm::math::integrator::{Method, increment};
use pendularm::math::particle::{Particle, evaluations};

use super::{expression, run};

fn bits(samples: &[f64]) -> Vec<u64> {
    samples.iter().map(|sample| sample.to_bits()).collect()
}

#[test]
fn the_start_is_at_index_zero_and_every_step_adds_one_entry() {
    for method in Method::ALL {
        let particle = run("sin(t)", (2.5, -1.25), 0.1, 7, method);
        assert_eq!(particle.time(0), 0.0);
        assert_eq!(
            (particle.positions()[0], particle.velocities()[0]),
            (2.5, -1.25)
        );
        assert_eq!(particle.times().len(), 8);
        assert_eq!(
            (particle.positions().len(), particle.velocities().len()),
            (8, 8)
        );
    }
}

#[test]
fn times_are_multiples_of_the_timestep_and_not_running_sums() {
    let times: Vec<f64> = run("t", (0.0, 0.0), 0.1, 10, Method::Euler)
        .times()
        .collect();
    let expected: Vec<f64> = (0..=10).map(|k| f64::from(k) * 0.1).collect();
    assert_eq!(times, expected);
    // Ten times 0.1 is 1; adding 0.1 ten times gives 0.9999999999999999.
    assert_eq!(times[10], 1.0);
}

#[test]
fn forces_are_taken_at_multiples_of_the_timestep() {
    // Euler's last step starts at 100 · 0.1 = 10, where the summed time is 9.99999999999998; there ln(10 - t) is finite.
    let particle = run("ln(10-t)", (0.0, 0.0), 0.1, 101, Method::Euler);
    let [.., before, end] = particle.velocities() else {
        panic!("102 entries");
    };
    assert!(before.is_finite());
    assert_eq!(*end, f64::NEG_INFINITY);
}

#[test]
fn the_force_is_evaluated_once_twice_twice_and_four_times_a_step() {
    for (method, each) in [
        (Method::Euler, 1),
        (Method::Midpoint, 2),
        (Method::Verlet, 2),
        (Method::Rk4, 4),
    ] {
        let particle = run("sin(t)", (0.0, 0.0), 0.1, 25, method);
        assert_eq!(particle.evaluations(), 25 * each, "{method}");
        assert_eq!(evaluations(25, method), 25 * each, "{method}");
    }
}

#[test]
fn slices_give_the_same_bits_as_one_computation() {
    for method in Method::ALL {
        let whole = run("exp(-t)*cos(5*t)", (1.0, -0.5), 0.01, 100, method);
        for slice in [1, 3, 7, 99] {
            let force = expression("exp(-t)*cos(5*t)");
            let mut sliced = Particle::new(force, 1.0, -0.5, 0.01, 100, method).unwrap();
            let mut made = 0;
            while sliced.remaining() > 0 {
                let before = sliced.done();
                let count = sliced.advance(slice);
                assert_eq!(count, slice.min(100 - before));
                assert_eq!(sliced.done(), before + count);
                made += count;
            }
            assert_eq!(made, 100);
            assert_eq!(bits(sliced.positions()), bits(whole.positions()));
            assert_eq!(bits(sliced.velocities()), bits(whole.velocities()));
        }
    }
}

#[test]
fn a_finished_computation_makes_no_further_step() {
    let mut particle = run("t", (0.0, 0.0), 0.1, 5, Method::Rk4);
    assert_eq!(particle.advance(usize::MAX), 0);
    assert_eq!((particle.done(), particle.evaluations()), (5, 20));
}

#[test]
fn a_slice_holds_the_steps_that_its_work_pays_for_and_at_least_one() {
    // Nine nodes, four evaluations: 36 a step.
    let force = expression("t^2 + 3*t - 1");
    let particle = Particle::new(force, 0.0, 0.0, 0.1, 10, Method::Rk4).unwrap();
    for (work, steps) in [(0, 1), (35, 1), (71, 1), (72, 2), (3600, 100)] {
        assert_eq!(particle.steps_within(work), steps);
    }
}

// Values that are no numbers.

/// The same steps, summed without compensation.
fn summed_plainly(force: &str, dt: f64, steps: u32, method: Method) -> Vec<(f64, f64)> {
    let force = expression(force);
    let (mut x, mut v) = (0.0, 0.0);
    let step = |k: u32| {
        let acceleration = |t, _: &[f64; 1], _: &[f64; 1]| [force.evaluate(t)];
        let t = f64::from(k) * dt;
        let (dx, dv) = increment(method, acceleration, t, &[x], &[v], dt);
        (x, v) = (x + dx[0], v + dv[0]);
        (x, v)
    };
    (0..steps).map(step).collect()
}

#[test]
fn values_that_are_not_finite_flow_on_as_in_ordinary_arithmetic() {
    let class = |x: f64| (x.is_nan(), x.is_infinite(), x.is_infinite() && x > 0.0);
    for force in [
        "sqrt(0-1)",
        "1/t",
        "ln(t)",
        "1/(t-0.5)",
        "sqrt(0.5-t)",
        "1e999",
        "1e307",
        "exp(900*t)",
    ] {
        for method in Method::ALL {
            let particle = run(force, (0.0, 0.0), 0.25, 8, method);
            let samples = particle
                .positions()
                .iter()
                .zip(particle.velocities())
                .skip(1);
            for ((x, v), plain) in samples.zip(summed_plainly(force, 0.25, 8, method)) {
                assert_eq!(
                    (class(*x), class(*v)),
                    (class(plain.0), class(plain.1)),
                    "{force} {method}"
                );
            }
        }
    }
}

#[test]
fn an_infinite_velocity_stays_infinite() {
    // ln(0) = -inf in the first step; finite pushes later change nothing.
    let particle = run("ln(t)", (1.0, 0.0), 0.5, 4, Method::Euler);
    let infinite = f64::NEG_INFINITY;
    assert_eq!(
        particle.velocities(),
        [0.0, infinite, infinite, infinite, infinite]
    );
    assert_eq!(
        particle.positions(),
        [1.0, 1.0, infinite, infinite, infinite]
    );
}

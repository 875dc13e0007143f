//! The sampled loop of any robot: its limits against closed forms, and against a simulation written apart from them.

use std::f64::consts::PI;

use pendularm::math::arm::Arm;
use pendularm::math::dynamics::{gravity_load, mass_matrix};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::held_loop::{Between, Given, HeldLimit, HeldLoop, held_limit};
use pendularm::study::linear::Linear;
use pendularm::study::matrix::Matrix;
use pendularm::study::paused::at_once;
use pendularm::study::stability::Stepping;
use pendularm::study::tableau::{Pair, Tableau};

type Rows = Vec<Vec<f64>>;

fn given(mass: Rows) -> Given {
    Given {
        mass,
        kp: vec![],
        kd: vec![],
        ki: vec![],
        damping: vec![],
        stiffness: vec![],
        delay: 0,
        between: Between::Exact,
        steps: 1,
    }
}

/// One joint of inertia 1 kg m² with these gains.
fn joint(kp: f64, kd: f64) -> Given {
    Given {
        kp: vec![vec![kp]],
        kd: vec![vec![kd]],
        ..given(vec![vec![1.0]])
    }
}

fn answer(given: &Given, period: Option<f64>) -> HeldLimit {
    at_once(held_limit(HeldLoop::try_from(given).unwrap(), period))
}

fn explicit(method: Method) -> Between {
    Between::Explicit(Box::new(Pair::of(method)))
}

fn is_near(one: f64, other: f64, tolerance: f64) -> bool {
    (one / other - 1.0).abs() <= tolerance
}

// ---- random robots --------------------------------------------------------------------------------------------------

fn rows(matrix: &Matrix) -> Rows {
    let n = matrix.size();
    let row = |i| (0..n).map(|j| matrix[(i, j)]).collect();
    (0..n).map(row).collect()
}

/// A symmetric matrix with random axes. Its eigenvalues are spread evenly, by their logarithms, over a factor of `condition`.
fn definite(rng: &mut fastrand::Rng, n: usize, condition: f64) -> Matrix {
    let mut matrix = Matrix::zeros(n);
    for i in 0..n {
        matrix[(i, i)] = condition.powf(-(i as f64) / (n.max(2) - 1) as f64);
    }
    for _ in 0..3 {
        let u: Vec<f64> = (0..n).map(|_| rng.f64() - 0.5).collect();
        let square: f64 = u.iter().map(|u| u * u).sum();
        let unit = |i: usize, j: usize| f64::from(u8::from(i == j));
        let mirror = Matrix::from_fn(n, |i, j| unit(i, j) - 2.0 * u[i] * u[j] / square);
        matrix = mirror.product(&matrix).product(&mirror);
    }
    Matrix::from_fn(n, |i, j| 0.5 * (matrix[(i, j)] + matrix[(j, i)]))
}

/// The largest eigenvalue of `L⁻¹ B L⁻ᵀ` with `M = L Lᵀ`, which is that of `M⁻¹ B`, by Jacobi's rotations.
fn largest_of_pencil(mass: &Matrix, b: &Matrix) -> f64 {
    let n = mass.size();
    let mut lower = Matrix::zeros(n);
    for i in 0..n {
        for j in 0..=i {
            let rest = mass[(i, j)] - (0..j).map(|k| lower[(i, k)] * lower[(j, k)]).sum::<f64>();
            lower[(i, j)] = if i == j {
                rest.sqrt()
            } else {
                rest / lower[(j, j)]
            };
        }
    }
    // Twice: solve for the columns, then transpose.
    let mut a = b.clone();
    for _ in 0..2 {
        for column in 0..n {
            for i in 0..n {
                let known: f64 = (0..i).map(|k| lower[(i, k)] * a[(k, column)]).sum();
                a[(i, column)] = (a[(i, column)] - known) / lower[(i, i)];
            }
        }
        a = Matrix::from_fn(n, |i, j| a[(j, i)]);
    }
    for _ in 0..60 {
        for p in 0..n {
            for q in p + 1..n {
                if a[(p, q)] == 0.0 {
                    continue;
                }
                let theta = 0.5 * (2.0 * a[(p, q)]).atan2(a[(q, q)] - a[(p, p)]);
                let (s, c) = theta.sin_cos();
                for k in 0..n {
                    let (one, other) = (a[(k, p)], a[(k, q)]);
                    (a[(k, p)], a[(k, q)]) = (c * one - s * other, s * one + c * other);
                }
                for k in 0..n {
                    let (one, other) = (a[(p, k)], a[(q, k)]);
                    (a[(p, k)], a[(q, k)]) = (c * one - s * other, s * one + c * other);
                }
            }
        }
    }
    (0..n).map(|i| a[(i, i)]).fold(0.0, f64::max)
}

/// The matrix of a period, column by column, by a simulation of the loop as a controller and a simulator would run it.
struct Simulated {
    mass: Matrix,
    kp: Matrix,
    kd: Matrix,
    ki: Matrix,
    damping: Matrix,
    stiffness: Matrix,
    delay: usize,
    steps: usize,
}

impl Simulated {
    fn times(matrix: &Matrix, x: &[f64]) -> Vec<f64> {
        let row = |i| x.iter().enumerate().map(|(j, x)| matrix[(i, j)] * x).sum();
        (0..x.len()).map(row).collect()
    }

    /// `M⁻¹ (u - D v - K x)`, where `inverse` is `M⁻¹`, or has the damping of a step in the mass.
    fn acceleration(&self, inverse: &Matrix, x: &[f64], v: &[f64], u: &[f64]) -> Vec<f64> {
        let (held, slowed) = (
            Self::times(&self.stiffness, x),
            Self::times(&self.damping, v),
        );
        let force: Vec<f64> = (0..x.len()).map(|i| u[i] - slowed[i] - held[i]).collect();
        Self::times(inverse, &force)
    }

    fn step(
        &self,
        between: &Between,
        inverse: &Matrix,
        x: &mut Vec<f64>,
        v: &mut Vec<f64>,
        u: &[f64],
        h: f64,
    ) {
        let plus = |a: &[f64], h: f64, b: &[f64]| -> Vec<f64> {
            a.iter().zip(b).map(|(a, b)| a + h * b).collect()
        };
        match between {
            Between::Implicit => {
                *v = plus(v, h, &self.acceleration(inverse, x, v, u));
                *x = plus(x, h, v);
            }
            Between::Explicit(pair) if **pair == Pair::of(Method::Euler) => {
                let a = self.acceleration(inverse, x, v, u);
                *x = plus(x, h, v);
                *v = plus(v, h, &a);
            }
            Between::Explicit(pair) if **pair == Pair::semi_implicit() => {
                *v = plus(v, h, &self.acceleration(inverse, x, v, u));
                *x = plus(x, h, v);
            }
            // Exact motion by many small steps.
            _ => {
                let parts = 60;
                for _ in 0..parts {
                    let h = h / f64::from(parts);
                    let a = |x: &[f64], v: &[f64]| self.acceleration(inverse, x, v, u);
                    let a1 = a(x, v);
                    let v2 = plus(v, 0.5 * h, &a1);
                    let a2 = a(&plus(x, 0.5 * h, v), &v2);
                    let v3 = plus(v, 0.5 * h, &a2);
                    let a3 = a(&plus(x, 0.5 * h, &v2), &v3);
                    let v4 = plus(v, h, &a3);
                    let a4 = a(&plus(x, h, &v3), &v4);
                    for i in 0..x.len() {
                        x[i] += h / 6.0 * (v[i] + 2.0 * v2[i] + 2.0 * v3[i] + v4[i]);
                        v[i] += h / 6.0 * (a1[i] + 2.0 * a2[i] + 2.0 * a3[i] + a4[i]);
                    }
                }
            }
        }
    }

    fn period(&self, between: &Between, period: f64) -> Matrix {
        let n = self.mass.size();
        let size = (3 + self.delay) * n;
        let h = period / self.steps as f64;
        let mass = match between {
            Between::Implicit => self.mass.clone().plus(h, &self.damping),
            _ => self.mass.clone(),
        };
        let inverse = mass.inverse().unwrap();
        let mut columns = Vec::new();
        for start in 0..size {
            let mut state = vec![0.0; size];
            state[start] = 1.0;
            let parts: Vec<Vec<f64>> = state.chunks(n).map(<[f64]>::to_vec).collect();
            let (mut x, mut v, mut s) = (parts[0].clone(), parts[1].clone(), parts[2].clone());
            let mut queue = parts[3..].to_vec();
            (0..n).for_each(|i| s[i] -= period * x[i]);
            let (p, d, sum) = (
                Self::times(&self.kp, &x),
                Self::times(&self.kd, &v),
                Self::times(&self.ki, &s),
            );
            queue.push((0..n).map(|i| sum[i] - p[i] - d[i]).collect());
            let u = queue.remove(0);
            for _ in 0..self.steps {
                self.step(between, &inverse, &mut x, &mut v, &u, h);
            }
            columns.push([x, v, s, queue.concat()].concat());
        }
        Matrix::from_fn(size, |i, j| columns[j][i])
    }
}

/// The spectral radius by the norms of ever higher powers, which needs no eigenvalues.
fn radius(mut matrix: Matrix) -> f64 {
    let (mut log, mut power) = (0.0, 1.0);
    for _ in 0..40 {
        let n = matrix.size();
        let entries = (0..n * n).map(|at| matrix[(at / n, at % n)]);
        let norm = entries.map(|it| it * it).sum::<f64>().sqrt();
        matrix = matrix.scaled(1.0 / norm);
        log += norm.ln() / power;
        matrix = matrix.product(&matrix);
        power *= 2.0;
    }
    log.exp()
}

// ---- closed forms ---------------------------------------------------------------------------------------------------

/// `T = 2 λmin(Kd⁻¹ M)`, for up to 32 joints and mass matrices of a condition up to 1e8. With Kp = Kd / (2 T) no mode
/// oscillates before. The eigenvalues of `M` have a rounding error of 1e-16 of the largest one.
#[test]
fn the_limit_of_pd_control_is_twice_the_least_time_constant() {
    let mut rng = fastrand::Rng::with_seed(7);
    for (case, condition) in [1.0, 1e2, 1e4, 1e6, 1e8]
        .into_iter()
        .cycle()
        .take(20)
        .enumerate()
    {
        let n = if case == 4 {
            32
        } else {
            [1, 2, 3, 5, 8, 13][case % 6]
        };
        let mass = definite(&mut rng, n, condition);
        let gains: Vec<f64> = (0..n).map(|_| 10_f64.powf(rng.f64() * 2.0)).collect();
        let diagonal = Matrix::from_fn(n, |i, j| if i == j { gains[i] } else { 0.0 });
        let expected = 2.0 / largest_of_pencil(&mass, &diagonal);
        let held = Given {
            kd: vec![gains.clone()],
            kp: vec![gains.iter().map(|kd| 0.5 * kd / expected).collect()],
            ..given(rows(&mass))
        };
        let found = answer(&held, None);
        let limit = found.period_limit.unwrap();
        let tolerance = 1e-10 + 1e-15 * condition;
        assert!(
            is_near(limit, expected, tolerance),
            "{n} {condition}: {limit} {expected}"
        );
        // The mode is the null vector of 2 M - T Kd.
        let mode = found.critical.unwrap();
        assert!(mode.reverses && is_near(mode.frequency, 0.5 / (1.01 * limit), 1e-9));
        let pencil = mass.clone().scaled(2.0).plus(-expected, &diagonal);
        let residual = Simulated::times(&pencil, &mode.mode);
        let scale = expected * gains.iter().copied().fold(0.0, f64::max);
        for it in residual {
            assert!(it.abs() < 1e-4 * scale, "{n} {condition}: {it} of {scale}");
        }
    }
}

/// `T = min(2 M / kd, 2 kd / kp)` for one joint with exact motion; by hand for the others.
#[test]
fn the_limits_of_one_joint_have_closed_forms() {
    let (implicit, semi) = (
        Between::Implicit,
        Between::Explicit(Box::new(Pair::semi_implicit())),
    );
    let damped = |damping| Given {
        damping: vec![vec![damping]],
        between: implicit.clone(),
        ..joint(0.0, 5.0)
    };
    let with = |given: Given, between: &Between| Given {
        between: between.clone(),
        ..given
    };
    // The positive root of 4 - 2 T kd - T² kp, kp = 100, kd = 10.
    let root = (-20.0 + 2000_f64.sqrt()) / 200.0;
    let cases = [
        (joint(100.0, 20.0), 0.1),
        (joint(100.0, 2.0), 0.04),
        (with(joint(100.0, 10.0), &semi), root),
        (with(joint(100.0, 10.0), &implicit), root),
        (with(joint(100.0, 10.0), &explicit(Method::Euler)), 0.1),
        // Implicit damping adds to the mass: T (kd - D) = 2 M.
        (damped(0.0), 0.4),
        (damped(1.0), 0.5),
        // A delay of one period and no spring: v ↦ v - T kd v₋ rings at a sixth of the sampling rate from T kd = 1 on.
        (
            Given {
                delay: 1,
                ..joint(0.0, 5.0)
            },
            0.2,
        ),
        // Of two periods: T kd = 2 sin(π / 10).
        (
            Given {
                delay: 2,
                ..joint(0.0, 5.0)
            },
            0.4 * (PI / 10.0).sin(),
        ),
    ];
    for (held, expected) in cases {
        let limit = answer(&held, None).period_limit.unwrap();
        assert!(
            is_near(limit, expected, 1e-8),
            "{held:?}: {limit} {expected}"
        );
    }
    assert_eq!(answer(&joint(0.0, 0.0), None).period_limit, None);
    assert_eq!(answer(&joint(100.0, 0.0), None).period_limit, Some(0.0));
    // A negative damping gain.
    assert_eq!(answer(&joint(100.0, -1.0), None).period_limit, Some(0.0));
}

/// A light joint with much damping of its own is fast, and stable at long periods. It does not hide the limit of a slow
/// joint, nor its own.
#[test]
fn a_fast_joint_that_limits_nothing_ends_no_search() {
    let light = |kp: f64, kd: f64| Given {
        damping: vec![vec![10.0]],
        kp: vec![vec![kp]],
        kd: vec![vec![kd]],
        ..given(vec![vec![1e-4]])
    };
    let (slow, own) = (joint(25.0, 10.0), light(10.0, 0.0));
    let both = Given {
        kp: vec![vec![25.0, 10.0]],
        kd: vec![vec![10.0, 0.0]],
        damping: vec![vec![0.0, 10.0]],
        ..given(vec![vec![1.0, 0.0], vec![0.0, 1e-4]])
    };
    let limit = |given: &Given| answer(given, None).period_limit.unwrap();
    for between in [Between::Exact, Between::Implicit] {
        let of = |one: &Given| Given {
            between: between.clone(),
            ..one.clone()
        };
        let (alone, both) = (limit(&of(&slow)), limit(&of(&both)));
        assert!(is_near(both, alone, 1e-9), "{both} {alone}");
        // The velocity is that of the effort at once: x ↦ (1 - T kp / D) x.
        let own = limit(&of(&own));
        assert!(is_near(own, 2.0, 1e-4), "{own}");
    }
    // Each of many short steps is stable up to 2.7853 time constants of the joint's own damping.
    let many = Given {
        between: explicit(Method::Rk4),
        steps: 1000,
        ..light(1e-6, 0.0)
    };
    let end = limit(&many);
    assert!(is_near(end, 2.7853e-5 * 1000.0, 1e-4), "{end}");
}

/// The first message of isaac-sim/IsaacLab 2497: kd 0.5 at 4 ms needs an inertia of 0.001 kg m².
#[test]
fn a_gain_that_is_too_large_is_named_with_the_inertia_that_it_needs() {
    let held = Given {
        kp: vec![vec![20.0]],
        kd: vec![vec![0.5]],
        ..given(vec![vec![0.1, 0.0], vec![0.0, 0.0004]])
    };
    let found = answer(&held, Some(0.004));
    let at = found.at.unwrap();
    assert!(!at.is_stable && at.growth_per_period > 1.0);
    assert!(is_near(at.armature.unwrap(), 0.0006, 1e-9), "{at:?}");
    assert!(is_near(at.kd_factor.unwrap(), 0.4, 1e-9), "{at:?}");
    assert!(
        found.explanation.contains(
            "joint[1]: kd 0.5 N m s/rad needs an effective inertia of at least 0.001 kg m^2 at 0.004 s"
        ),
        "{}",
        found.explanation
    );
    assert_eq!(found.critical.unwrap().joint, 1);
    // Both ways out are stable, and a little less of them is not.
    for (part, is_stable) in [(1.001, true), (0.999, false)] {
        let mut heavier = held.clone();
        heavier.mass[1][1] += part * 0.0006;
        assert_eq!(
            answer(&heavier, Some(0.004)).at.unwrap().is_stable,
            is_stable
        );
        let softer = Given {
            kd: vec![vec![0.2 / part]],
            ..held.clone()
        };
        assert_eq!(
            answer(&softer, Some(0.004)).at.unwrap().is_stable,
            is_stable
        );
    }
    // Stiffness without damping is no matter of inertia: it needs kd.
    let soft = answer(&joint(100.0, 0.1), Some(0.004));
    assert!(!soft.critical.unwrap().reverses && soft.at.unwrap().armature.is_none());
    assert!(
        soft.explanation
            .contains("kp 100 N m/rad, held, acts like a damping of -0.1 N m s/rad"),
        "{}",
        soft.explanation
    );
}

/// Euler's undamped swing grows by (ω h)² / 2 in a step; held kd damps it by T kd. A period of several steps needs fewer
/// of a better method.
#[test]
fn the_largest_timestep_divides_the_period() {
    let mut fewest = f64::INFINITY;
    for method in [Method::Euler, Method::Midpoint, Method::Rk4] {
        let held = Given {
            stiffness: vec![vec![400.0]],
            between: explicit(method),
            ..joint(0.0, 1.0)
        };
        let limit = answer(&held, Some(0.08))
            .at
            .unwrap()
            .timestep_limit
            .unwrap();
        let steps = (0.08 / limit).round();
        assert!(
            is_near(limit * steps, 0.08, 1e-12) && steps <= fewest,
            "{method}: {steps}"
        );
        fewest = steps;
        for (steps, is_stable) in [(steps as u64, true), (steps as u64 - 1, false)] {
            if steps > 0 {
                let at = answer(
                    &Given {
                        steps,
                        ..held.clone()
                    },
                    Some(0.08),
                )
                .at
                .unwrap();
                assert_eq!(at.is_stable, is_stable, "{method} {steps}");
            }
        }
    }
    assert!(fewest < 5.0, "{fewest}");
}

/// A joint without a spring and a controller drifts, which is no growth.
#[test]
fn a_joint_that_only_drifts_limits_nothing() {
    let held = Given {
        kp: vec![vec![0.0, 3.0, 2.0]],
        kd: vec![vec![0.0, 3.0, 2.0]],
        ..given(vec![
            vec![2.0, 0.7, 0.1],
            vec![0.7, 1.0, 0.2],
            vec![0.1, 0.2, 0.3],
        ])
    };
    let limit = answer(&held, None).period_limit.unwrap();
    let mass = Matrix::from_fn(3, |i, j| held.mass[i][j]);
    let kd = Matrix::from_fn(3, |i, j| if i == j { held.kd[0][i] } else { 0.0 });
    assert!(
        is_near(limit, 2.0 / largest_of_pencil(&mass, &kd), 1e-8),
        "{limit}"
    );
}

// ---- against a simulation, and against the arm ----------------------------------------------------------------------

/// A random robot with full gain matrices, integrals, damping, springs and delays.
fn random_robot(rng: &mut fastrand::Rng, case: usize) -> Simulated {
    let n = if case == 20 { 12 } else { 1 + case % 4 };
    let condition = [1e1, 1e3, 1e8][case % 3];
    let mut matrix = |scale: f64| definite(rng, n, 10.0).scaled(scale);
    let (kp, kd, ki) = (matrix(100.0), matrix(20.0), matrix(30.0));
    let (damping, stiffness) = (matrix(1.0), matrix(50.0));
    Simulated {
        mass: definite(rng, n, condition),
        delay: case / 5 % 3,
        steps: 1 + case / 7 % 3,
        ki: if case.is_multiple_of(2) {
            Matrix::zeros(n)
        } else {
            ki
        },
        kp,
        kd,
        damping,
        stiffness,
    }
}

/// The simulation grows 0.1 % beyond the limit and does not 0.1 % below it, for random robots and every motion between
/// two runs of the law.
#[test]
fn a_simulation_of_the_loop_grows_just_beyond_the_limit() {
    let mut rng = fastrand::Rng::with_seed(11);
    let semi = Between::Explicit(Box::new(Pair::semi_implicit()));
    let rk4 = explicit(Method::Rk4);
    let motions = [
        Between::Exact,
        semi,
        Between::Implicit,
        explicit(Method::Euler),
        rk4.clone(),
    ];
    let mut found = 0;
    for case in 0..60 {
        let simulated = random_robot(&mut rng, case);
        let between = motions[case % motions.len()].clone();
        let held = Given {
            kp: rows(&simulated.kp),
            kd: rows(&simulated.kd),
            ki: rows(&simulated.ki),
            damping: rows(&simulated.damping),
            stiffness: rows(&simulated.stiffness),
            delay: simulated.delay as u64,
            // In many steps Runge-Kutta 4 is exact, as the simulation is.
            steps: if between == rk4 {
                50
            } else {
                simulated.steps as u64
            },
            between: between.clone(),
            ..given(rows(&simulated.mass))
        };
        let limit = answer(&held, None).period_limit.unwrap();
        if limit == 0.0 {
            continue;
        }
        found += 1;
        let told = format!(
            "{case}: {} joints, {between:?}, limit {limit}",
            held.mass.len()
        );
        let beyond = radius(simulated.period(&between, 1.001 * limit));
        assert!(beyond > 1.0 + 1e-6, "{told}: {beyond}");
        let below = radius(simulated.period(&between, 0.999 * limit));
        assert!(below < 1.0 + 1e-9, "{told}: {below}");
    }
    assert!(found > 40, "{found}");
}

fn check_arm<const N: usize>(lengths: [f64; N], masses: [f64; N]) {
    let arm = Arm::new(lengths, masses, 9.81).unwrap();
    let pose: [f64; N] = std::array::from_fn(|i| 0.4 - 0.7 * i as f64);
    let gains = Gains {
        kp: [90.0; N],
        ki: [40.0; N],
        kd: [6.0; N],
    };
    let control = ControlLoop::new(arm, gains, Setpoint::at(pose));
    let linear = Linear::at_pose(&control, &pose);
    // The gradient of the gravity load, by differences.
    let stiffness: Rows = (0..N)
        .map(|i| {
            let load = |j: usize, by: f64| {
                gravity_load(
                    &arm,
                    &std::array::from_fn(|k| pose[k] + if k == j { by } else { 0.0 }),
                )[i]
            };
            (0..N)
                .map(|j| (load(j, 1e-4) - load(j, -1e-4)) / 2e-4)
                .collect()
        })
        .collect();
    for method in Method::ALL {
        for (steps, delay) in [(1, 0), (4, 0), (1, 1), (3, 1), (1, 2), (2, 3), (1, 8)] {
            let held = Given {
                kp: vec![gains.kp.to_vec()],
                ki: vec![gains.ki.to_vec()],
                kd: vec![gains.kd.to_vec()],
                stiffness: stiffness.clone(),
                delay,
                steps,
                between: explicit(method),
                ..given(mass_matrix(&arm, &pose).map(|row| row.to_vec()).to_vec())
            };
            let expected = Stepping::held(&linear, method, steps as u32, delay as u8)
                .limit()
                .unwrap();
            let limit = answer(&held, None).period_limit.unwrap();
            let told = format!("{N} {method} {steps} {delay}: {limit} {expected}");
            assert!(is_near(limit, expected, 1e-7), "{told}");
        }
    }
}

#[test]
fn the_limits_of_the_arm_are_those_of_its_own_study() {
    check_arm([0.8, 0.6], [2.0, 1.0]);
    check_arm([0.5, 0.4, 0.3], [1.5, 1.0, 0.5]);
}

/// The largest loop that is accepted has an answer.
#[test]
fn the_largest_loop_is_answered() {
    let mass = Matrix::zeros(64).plus_diagonal(0.1);
    let mut held = Given {
        kp: vec![vec![10.0]],
        kd: vec![vec![1.0]],
        ..given(rows(&mass))
    };
    held.mass[0][0] = 0.05;
    let found = answer(&held, None);
    assert!(is_near(found.period_limit.unwrap(), 0.1, 1e-9));
    assert_eq!(found.critical.unwrap().joint, 0);
}

// ---- faults ---------------------------------------------------------------------------------------------------------

fn assert_refused(cases: &[(Given, &str)]) {
    for (held, expected) in cases {
        let refused = HeldLoop::try_from(held).unwrap_err().to_string();
        assert!(refused.contains(expected), "{refused}");
    }
}

fn two_joints() -> Given {
    Given {
        kd: vec![vec![1.0]],
        ..given(vec![vec![1.0, 0.2], vec![0.2, 1.0]])
    }
}

fn joints(n: usize) -> Given {
    given(rows(&Matrix::zeros(n).plus_diagonal(1.0)))
}

#[test]
fn a_wrong_mass_matrix_is_refused_by_name() {
    let mass = |rows: [[f64; 2]; 2]| given(rows.map(|row| row.to_vec()).to_vec());
    assert_refused(&[
        (given(vec![]), "M must have 1 to 64 rows, got 0"),
        (joints(65), "M must have 1 to 64 rows, got 65"),
        (
            given(vec![vec![1.0, 0.0], vec![0.0]]),
            "M must have 2 rows of 2 numbers",
        ),
        (
            mass([[1.0, 0.2], [0.3, 1.0]]),
            "M must be symmetric: M[1][0] is 0.3, M[0][1] is 0.2",
        ),
        (
            mass([[1.0, 2.0], [2.0, 1.0]]),
            "M must be positive definite: it has no inertia left at joint[1]",
        ),
        (
            mass([[0.0, 0.0], [0.0, 1.0]]),
            "M must be positive definite: it has no inertia left at joint[0]",
        ),
        (
            mass([[1.0, f64::NAN], [0.2, 1.0]]),
            "M must be finite: M[0][1] is NaN",
        ),
    ]);
}

#[test]
fn a_wrong_gain_is_refused_by_name() {
    let two = two_joints;
    let three = vec![vec![1.0, 2.0, 3.0]];
    assert_refused(&[
        (
            Given { kd: three, ..two() },
            "kd must have 2 rows of 2 numbers, as M has rows, or one number",
        ),
        (
            Given {
                ki: vec![vec![1.0]; 2],
                ..two()
            },
            "ki must have 2 rows",
        ),
        (
            Given {
                kp: vec![vec![f64::INFINITY]],
                ..two()
            },
            "kp must be finite: kp[0][0] is inf",
        ),
        (
            Given {
                damping: vec![vec![1.0; 2]; 3],
                ..two()
            },
            "damping must have 2 rows",
        ),
        (
            Given {
                stiffness: vec![vec![1.0; 3]; 2],
                ..two()
            },
            "stiffness must have 2 rows",
        ),
        (
            Given { delay: 9, ..two() },
            "delay must be 0 to 8 periods, got 9",
        ),
        (
            Given { steps: 0, ..two() },
            "steps must be 1 to 1000000, got 0",
        ),
        (
            Given {
                delay: 3,
                ..joints(64)
            },
            "the loop must have at most 256 states, got 320",
        ),
    ]);
}

/// Heun's method by its tableau has the limit of the midpoint method, which has the same stability polynomial.
#[test]
fn a_method_of_ones_own_is_given_by_its_tableau() {
    let heun = Tableau::new(&[vec![0.0, 0.0], vec![1.0, 0.0]], &[0.5, 0.5]).unwrap();
    let with = |between| Given {
        stiffness: vec![vec![90.0]],
        damping: vec![vec![0.4]],
        between,
        steps: 3,
        ..joint(60.0, 4.0)
    };
    let found = answer(
        &with(Between::Explicit(Box::new(Pair::same(heun.clone())))),
        None,
    );
    let midpoint = answer(&with(explicit(Method::Midpoint)), None);
    let (one, other) = (found.period_limit.unwrap(), midpoint.period_limit.unwrap());
    assert!(is_near(one, other, 1e-9), "{one} {other}");
    let refused = |a: &[Vec<f64>], b: &[f64]| Tableau::new(a, b).unwrap_err().to_string();
    let implicit = refused(&[vec![0.0, 0.0], vec![0.5, 0.5]], &[0.5, 0.5]);
    assert!(
        implicit.contains("row 1 of a is implicit: a[1][1] is 0.5"),
        "{implicit}"
    );
    assert!(refused(&vec![vec![0.0; 13]; 13], &[1.0; 13]).contains("1 to 12 stages, got 13"));
    assert!(refused(&[vec![]], &[f64::NAN]).contains("got NaN"));
    assert!(refused(&[vec![]], &[0.5, 0.5]).contains("as many rows as b has entries, 2, got 1"));
    assert!(refused(&[vec![], vec![]], &[0.5, 0.5]).contains("row 1 of a must have 1 to 2"));
    let euler = Tableau::new(&[vec![]], &[1.0]).unwrap();
    assert!(Pair::new(heun, euler).is_err());
}

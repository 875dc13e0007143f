//! Nanoseconds per forward dynamics and per step.
use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::forward_dynamics;
use pendularm::math::integrator::{Method, increment};
use std::hint::black_box;
use std::time::Instant;

const REPEATS: usize = 25;

fn best(n: usize, mut f: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..REPEATS {
        let t = Instant::now();
        f();
        best = best.min(t.elapsed().as_secs_f64() * 1e9 / n as f64);
    }
    best
}

fn states<const N: usize>() -> Vec<State<N>> {
    let mut x = 0x9E37_79B9_7F4A_7C15_u64;
    let mut random = |scale: f64| {
        x ^= x << 13;
        x ^= x >> 7;
        x ^= x << 17;
        (x as f64 / u64::MAX as f64 - 0.5) * scale
    };
    (0..256)
        .map(|_| State {
            position: std::array::from_fn(|_| random(8.0)),
            velocity: std::array::from_fn(|_| random(6.0)),
        })
        .collect()
}

#[inline(never)]
fn throughput<const N: usize>(arm: &Arm<N>, states: &[State<N>], out: &mut [[f64; N]]) {
    for (s, out) in states.iter().zip(out) {
        *out = forward_dynamics(arm, &s.position, &s.velocity, &[0.3; N]);
    }
}

#[inline(never)]
fn steps<const N: usize>(arm: &Arm<N>, method: Method, state: &mut State<N>, steps: usize) {
    let tau = [0.3; N];
    for k in 0..steps {
        let (dq, dv) = increment(
            method,
            |_, q, v| forward_dynamics(arm, q, v, &tau),
            k as f64 * 1e-3,
            &state.position,
            &state.velocity,
            1e-3,
        );
        for i in 0..N {
            state.position[i] += dq[i];
            state.velocity[i] += dv[i];
        }
    }
}

fn report<const N: usize>() {
    for g in [9.81, 0.0] {
        let arm = black_box(Arm::<N>::new([1.0; N], [1.0; N], g).unwrap());
        let states = states::<N>();
        let mut out = vec![[0.0; N]; states.len()];
        let ns = best(states.len() * 100, || {
            for _ in 0..100 {
                throughput(black_box(&arm), black_box(&states), black_box(&mut out));
            }
        });
        println!("n={N} g={g} forward dynamics, throughput {ns:.1} ns");
        for method in Method::ALL {
            let ns = best(20_000, || {
                let mut state = State::rest();
                steps(black_box(&arm), black_box(method), &mut state, 20_000);
                black_box(state);
            });
            println!("n={N} g={g} {method:10} {ns:.1} ns");
        }
    }
}

fn main() {
    report::<2>();
    report::<3>();
}

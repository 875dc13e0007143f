use pendularm::math::trig::sin_cos;
use std::hint::black_box;
use std::time::Instant;
fn best(n: usize, mut f: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..25 { let t = Instant::now(); f(); best = best.min(t.elapsed().as_secs_f64() * 1e9 / n as f64); }
    best
}
#[inline(never)]
fn tp<const N: usize>(a: &[[f64; N]], o: &mut [([f64; N], [f64; N])]) { for (a, o) in a.iter().zip(o) { *o = sin_cos(a); } }
#[inline(never)]
fn tps<const N: usize>(a: &[[f64; N]], o: &mut [([f64; N], [f64; N])]) { for (a, o) in a.iter().zip(o) { *o = (a.map(f64::sin), a.map(f64::cos)); } }
#[inline(never)]
fn chain<const N: usize>(mut a: [f64; N], n: usize) -> [f64; N] { for _ in 0..n { let (s, c) = sin_cos(&a); for i in 0..N { a[i] = s[i] + c[i]; } } a }
#[inline(never)]
fn chains<const N: usize>(mut a: [f64; N], n: usize) -> [f64; N] { for _ in 0..n { for i in 0..N { let (s, c) = a[i].sin_cos(); a[i] = s + c; } } a }
fn go<const N: usize>() {
    let a: Vec<[f64; N]> = (0..256).map(|i| std::array::from_fn(|j| ((i * 7919 + j * 104729) % 1000) as f64 * 0.008 - 4.0)).collect();
    let mut o = vec![([0.0; N], [0.0; N]); 256];
    println!("N={N} own {:.1} std {:.1} chain own {:.1} std {:.1}",
      best(25600, || for _ in 0..100 { tp(black_box(&a), black_box(&mut o)) }),
      best(25600, || for _ in 0..100 { tps(black_box(&a), black_box(&mut o)) }),
      best(20000, || { black_box(chain(black_box([0.5; N]), 20000)); }),
      best(20000, || { black_box(chains(black_box([0.5; N]), 20000)); }));
}
fn main() { go::<1>(); go::<2>(); go::<3>(); go::<4>(); }

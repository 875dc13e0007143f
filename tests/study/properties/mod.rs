//! Claims of every answer of the study, tried on random arms, gains, poses and setpoints.
//!
//! A case is made from its number alone, which a failure names: `FROM=number COUNT=1` makes it again.
//! `make check-study` runs as many as `COUNT` says, in an optimised build; the tests here run dozens of each.

mod advice;
mod gains;
mod limits;
mod motions;
mod requests;
mod zero_gains;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::motion::Motion;
use pendularm::study::stability::{ADVISED_PART, limits};

/// The timestep that `/study/stability` advises.
pub(crate) fn advised<const N: usize>(control: &ControlLoop<N>, state: &State<N>) -> f64 {
    let motion = Motion::ahead(control, state).timestep;
    let limits = limits(control).advised.unwrap_or(f64::INFINITY);
    limits.min(ADVISED_PART * motion)
}

/// Random choices of one case.
struct Dice(fastrand::Rng);

impl Dice {
    fn of(case: u64) -> Self {
        Self(fastrand::Rng::with_seed(case))
    }

    /// Evenly between -1 and 1.
    fn any(&mut self) -> f64 {
        2.0 * self.0.f64() - 1.0
    }

    /// Within this many powers of ten around 1.
    fn size(&mut self, decades: f64) -> f64 {
        10_f64.powf(decades * self.any())
    }

    fn one_in(&mut self, count: u32) -> bool {
        self.0.u32(0..count) == 0
    }

    fn arm<const N: usize>(&mut self) -> Arm<N> {
        let lengths = std::array::from_fn(|_| self.size(0.7));
        let masses = std::array::from_fn(|_| self.size(1.0));
        let gravity = [0.0, 1.62, 9.81][self.0.usize(0..3)];
        Arm::new(lengths, masses, gravity).unwrap()
    }

    /// From springs that cannot hold the arm to stiff ones, from weak damping to strong; some gains are zero.
    fn gains<const N: usize>(&mut self, arm: &Arm<N>) -> Gains<N> {
        let (lengths, masses) = (arm.lengths(), arm.masses());
        let pace = 10.0 * self.size(1.0);
        let damping = self.size(1.0);
        let mut gains = Gains {
            kp: [0.0; N],
            ki: [0.0; N],
            kd: [0.0; N],
        };
        for i in 0..N {
            let reach: f64 = lengths[i..].iter().sum();
            let mass: f64 = masses[i..].iter().sum();
            let inertia = mass * reach * reach / 3.0;
            gains.kp[i] = inertia * pace * pace * self.size(0.5);
            gains.kd[i] = 2.0 * damping * (gains.kp[i] * inertia).sqrt() * self.size(0.3);
        }
        if self.one_in(2) {
            gains.ki = gains.kp.map(|kp| kp * self.size(0.5));
        }
        for i in 0..N {
            for gain in [&mut gains.kp[i], &mut gains.ki[i], &mut gains.kd[i]] {
                if self.one_in(12) {
                    *gain = 0.0;
                }
            }
        }
        gains
    }

    /// Anywhere within whole turns; now and then upright or hanging to the bit, where balances are.
    fn setpoint<const N: usize>(&mut self) -> [f64; N] {
        let mut position = std::array::from_fn(|_| TAU * self.any());
        if self.one_in(10) {
            position = std::array::from_fn(|i| {
                let turned = if self.one_in(2) { PI } else { 0.0 };
                if i == 0 { FRAC_PI_2 } else { turned }
            });
        }
        position
    }

    fn control<const N: usize>(&mut self) -> ControlLoop<N> {
        let arm = self.arm();
        let gains = self.gains(&arm);
        let setpoint = Setpoint::at(self.setpoint());
        let method = Method::ALL[self.0.usize(0..Method::ALL.len())];
        ControlLoop::new(arm, gains, setpoint).with_method(method)
    }
}

/// How often a claim was tested, and how often the case did not apply.
#[derive(Debug, Default, Clone, Copy)]
struct Tally {
    tried: u64,
    open: u64,
    /// Cases in which it did not hold.
    outside: u64,
    /// Cases that stayed bounded but did not come to rest, of claims about motions that should.
    unsettled: u64,
}

/// Runs cases, and prints how many applied.
fn run(claim: &str, cases: impl Iterator<Item = u64>, check: impl Fn(u64, &mut Tally)) -> Tally {
    let mut tally = Tally::default();
    for case in cases {
        check(case, &mut tally);
    }
    println!("{claim}: {tally:?}");
    tally
}

/// The cases of a test, or those of the environment: `per` of a million.
fn cases(few: u64, per: u64) -> std::ops::Range<u64> {
    let number = |name: &str| -> Option<u64> { std::env::var(name).ok()?.parse().ok() };
    let from = number("FROM").unwrap_or(0);
    let count = number("COUNT").map_or(few, |count| (count / (1_000_000 / per)).max(1));
    from..from + count
}

/// Runs a property for both numbers of links, in turn.
macro_rules! property {
    ($check:ident, $few:expr, $per:expr) => {
        run(stringify!($check), cases($few, $per), |case, tally| {
            if case.is_multiple_of(2) {
                $check::<2>(case, tally);
            } else {
                $check::<3>(case, tally);
            }
        })
    };
}

pub(crate) use property;

/// At least two of three cases must apply. A single case that is repeated by its number need not.
fn tells(tally: Tally) {
    let is_one = std::env::var("COUNT").is_ok_and(|count| count == "1");
    assert!(is_one || tally.tried > 2 * tally.open, "{tally:?}");
}

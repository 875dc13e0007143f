//! Resting poses of an arm, on random gains and setpoints: never a saddle.

use std::f64::consts::{FRAC_PI_2, PI};

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::{energy, gravity_load};
use pendularm::math::pid::{Gains, INTEGRAL_LIMIT, Setpoint};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::linear::{Equilibrium, equilibrium};
use pendularm::study::stability::{Rest, limit_held, limits};

use crate::stored::gains;

/// The largest effort that nothing balances at rest, of the joints that hold no load by their integral \[N m\]. An
/// integral at its limit has the sign of the position error, else it would leave the limit.
pub(crate) fn residual<const N: usize>(control: &ControlLoop<N>, rest: &Equilibrium<N>) -> f64 {
    let (gains, setpoint) = (&control.gains, &control.setpoint);
    let load = gravity_load(&control.arm, &rest.position);
    let free = (0..N).filter(|&i| !control.is_free() && !rest.integrating[i]);
    let left = free.map(|i| {
        let spring = gains.kp[i] * (setpoint.position[i] - rest.position[i]);
        let integral = rest.integral[i].abs().copysign(spring);
        (spring + gains.ki[i] * integral + gains.kd[i] * setpoint.velocity[i] - load[i]).abs()
    });
    left.fold(0.0, f64::max)
}

/// Gains that sag: a load of up to 19.6 N m (2 links) on springs and saturated integrals of the same size.
fn soft<const N: usize>(rng: &mut fastrand::Rng) -> (Gains<N>, Setpoint<N>) {
    let first = 3.0 + 27.0 * rng.f64();
    let mut part = 1.0;
    let kp = std::array::from_fn(|_| {
        let kp = first * part;
        part /= 3.0;
        kp
    });
    let ki = kp.map(|kp| 0.04 * kp * f64::from(rng.u8(0..3) / 2));
    let gains = gains(kp, ki, kp.map(|kp| 0.3 * kp + 0.5));
    let position = std::array::from_fn(|_| PI * (2.0 * rng.f64() - 1.0));
    (gains, Setpoint::at(position))
}

/// Newton steps alone would converge to a saddle here, and every timestep would count as unstable. The arm rests, and
/// its true limit, from an independent code, is 0.456 s. Without gravity a joint that has damping and no spring stays
/// where it is put: that is no running away.
#[test]
fn a_joint_without_a_restoring_torque_is_not_unstable() {
    let arm = Arm::<2>::new([0.6, 2.6], [0.3, 0.7], 0.0).unwrap();
    let gains = gains([0.0, 26_952.0], [0.0; 2], [280.0, 136.0]);
    let found = limits(&ControlLoop::new(arm, gains, Setpoint::at([-3.6, -1.9])));
    assert_eq!(found.rest, Rest::Setpoint, "{found:?}");
    assert!(found.held.unwrap() > 1e-3 && found.continuous.unwrap() > 1e-3);
}

/// Far below the setpoint an arm has a limit. Upright is an exact balance; a hair beside it the arm falls as far.
#[test]
fn an_arm_that_sags_far_has_the_limit_of_its_pose_and_an_exact_balance_is_named() {
    let soft = gains([8.0, 2.6667], [0.0; 2], [2.6667, 1.0]);
    let weak = gains([20.0, 5.0], [0.0; 2], [4.0, 1.0]);
    let far = [1.694_544_183_420_622_3, -2.503_024_457_368_377_8];
    let fallen = [0.0, 1e-6, -1e-6].map(|off| (weak, [FRAC_PI_2 + off, 0.0], off == 0.0, 0.243));
    for (gains, setpoint, balanced, expected) in
        fallen.into_iter().chain([(soft, far, false, 0.456)])
    {
        let control = ControlLoop::new(Arm::default(), gains, Setpoint::at(setpoint));
        let rest = equilibrium(&control);
        assert_eq!(rest.balanced, balanced, "{setpoint:?}");
        let residual = residual(&control, &rest);
        assert!(residual < 1e-12, "{residual:e}");
        let limit = limit_held(&control).unwrap();
        assert!((limit - expected).abs() < 5e-4, "{setpoint:?}: {limit}");
    }
}

/// `V(rest + x) - V(rest) > 0` in every direction, without another derivative: of the arm's energy and its springs'.
fn is_a_minimum<const N: usize>(
    arm: &Arm<N>,
    gains: &Gains<N>,
    setpoint: &Setpoint<N>,
    rest: &[f64; N],
    rng: &mut fastrand::Rng,
) -> bool {
    let potential = |q: &[f64; N]| {
        let held = |i: usize| {
            let off = (q[i] - setpoint.position[i]).abs();
            (0.5 * gains.kp[i] * off + INTEGRAL_LIMIT * gains.ki[i]) * off
        };
        (0..N).map(held).sum::<f64>() + energy(arm, &State::at_rest(*q))
    };
    let least = potential(rest);
    (0..50).all(|_| {
        let q: [f64; N] = std::array::from_fn(|i| rest[i] + 1e-3 * (2.0 * rng.f64() - 1.0));
        // Rounding of an energy of some 100 J; the smallest curvature seen raises it by 1e-9 J.
        potential(&q) >= least - 1e-12
    })
}

fn check_soft<const N: usize>(seed: u64, cases: usize) {
    let mut rng = fastrand::Rng::with_seed(seed);
    let arm = Arm::<N>::default();
    for case in 0..cases {
        let (gains, setpoint) = soft::<N>(&mut rng);
        let told = format!("seed {seed} case {case}: {gains:?} {setpoint:?}");
        let control = ControlLoop::new(arm, gains, setpoint);
        let rest = equilibrium(&control);
        let residual = residual(&control, &rest);
        assert!(residual < 1e-11, "{told}: {residual:e} N m");
        let is_stable = is_a_minimum(&arm, &gains, &setpoint, &rest.position, &mut rng);
        assert!(is_stable, "{told}: a saddle");
        let limit = limit_held(&control).filter(|_| rest.integrating == [false; N]);
        assert!(limit.is_none_or(|limit| limit > 1e-3), "{told}: {limit:?}");
    }
}

#[test]
fn the_pose_of_every_soft_loop_is_a_minimum_and_has_a_limit() {
    check_soft::<2>(11, 600);
    check_soft::<3>(12, 600);
}

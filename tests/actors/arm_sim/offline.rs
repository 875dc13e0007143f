//! The live arm is the offline simulation, in every bit.

use super::*;
use pendularm::actors::arm::sim::SetParams;

/// The live arm, whatever is done to it, is at every moment what the offline simulation is after as many steps, in
/// every bit of state, rounding carry, integral, effort and time.
fn assert_live_is_offline<const N: usize>(seed: u64)
where
    Gains<N>: Default,
{
    in_virtual_time(async move {
        let bench = ArmBench::<N>::new(Arm::default());
        let mut offline = Simulation::<N>::new(Arm::default(), Gains::default());
        let mut random = fastrand::Rng::with_seed(seed);
        for event in 0..60 {
            sleep(ms(random.u64(1..120))).await;
            let live = bench.snapshot().await;
            offline.advance(live.steps() - offline.steps());
            assert_eq!(live, offline, "seed {seed}, event {event}");
            match random.u8(0..8) {
                0 => {
                    let on = random.bool();
                    bench.ask(enable(on)).await;
                    offline.enable(on);
                }
                1 | 2 => {
                    let position: [f64; N] = std::array::from_fn(|_| random.f64() * 2.0 - 1.0);
                    let velocity: [f64; N] = std::array::from_fn(|_| random.f64() - 0.5);
                    bench.hold(position, velocity).await;
                    offline.set_setpoint(Setpoint { position, velocity });
                }
                3 => {
                    let lengths: [f64; N] = std::array::from_fn(|_| 0.5 + random.f64());
                    let masses: [f64; N] = std::array::from_fn(|_| 0.5 + random.f64());
                    let gravity = 10.0 * random.f64();
                    bench
                        .ask(SetParams {
                            lengths: Some(lengths),
                            masses: Some(masses),
                            gravity: Some(gravity),
                            ..SetParams::default()
                        })
                        .await;
                    offline.set_arm(Arm::new(lengths, masses, gravity).unwrap());
                }
                4 => {
                    let method_now = Method::ALL[random.usize(0..Method::ALL.len())];
                    bench.ask(method(method_now)).await;
                    offline.set_method(method_now);
                }
                5 => {
                    let timestep = [0.0005, 0.001, 0.0013, 0.002][random.usize(0..4)];
                    bench.ask(of_timestep(timestep)).await;
                    if timestep != offline.timestep() {
                        offline.set_timestep(timestep);
                    }
                }
                6 => {
                    let mut gains = *offline.pid().gains();
                    gains.kp = gains.kp.map(|kp| kp * (0.9 + 0.2 * random.f64()));
                    bench
                        .ask(SetGains {
                            kp: Some(gains.kp),
                            ..SetGains::default()
                        })
                        .await;
                    offline.set_gains(gains);
                }
                _ => {
                    bench.ask(Reset::default()).await;
                    offline.reset();
                }
            }
        }
    });
}

#[test]
fn the_live_arm_is_the_offline_simulation_bit_for_bit() {
    for seed in 0..6 {
        assert_live_is_offline::<2>(seed);
        assert_live_is_offline::<3>(100 + seed);
    }
}

/// Nobody looks in between: the request itself takes the arm to its step, not the tick before it.
#[test]
fn a_request_takes_effect_at_the_step_that_is_due_when_it_comes() {
    in_virtual_time(async {
        let bench = ArmBench::<2>::new(Arm::default());
        let mut offline = Simulation::<2>::new(Arm::default(), Gains::default());
        bench.ask(Reset::default()).await;
        let began = Instant::now();
        let step_due = || u64::try_from(began.elapsed().as_millis()).unwrap();
        for (pause, angle) in [(7, 0.3), (30, -0.4), (1, 0.5), (11, 0.6)] {
            sleep(ms(pause)).await;
            bench.ask(enable(angle > 0.0)).await;
            offline.advance(step_due() - offline.steps());
            offline.enable(angle > 0.0);
            sleep(ms(pause)).await;
            let positions = [angle, -angle];
            bench.hold(positions, [0.0; 2]).await;
            offline.advance(step_due() - offline.steps());
            offline.set_setpoint(Setpoint {
                position: positions,
                velocity: [0.0; 2],
            });
        }
        sleep(ms(5)).await;
        bench.ask(pause(true)).await;
        offline.advance(step_due() - offline.steps());
        assert_eq!(bench.snapshot().await, offline);
    });
}

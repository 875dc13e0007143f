//! Steps, counted exactly: running, after a change, paused and after a stall.

use super::*;
use pendularm::actors::arm::sim::WAKE_UP_BUDGET;
use pendularm::actors::resources::work_clock;
use tokio::time::advance;

#[test]
fn the_steps_after_a_time_are_the_whole_timesteps_in_it() {
    in_virtual_time(async {
        // Looks at the clock cost the same however busy the machine is, and no wake-up's budget runs out.
        work_clock::count(Duration::from_micros(1));
        // Each timestep as a fraction of a second, so that the expected count is exact.
        for (numerator, denominator) in [
            (1, 1000),
            (2, 1000),
            (3, 1000),
            (1, 10_000),
            (7, 1000),
            (1, 60),
            (1, 3),
            (1, 10),
            (3, 10),
            (37, 100),
            (1, 1),
            (2, 1),
            (7, 2),
        ] {
            let timestep = numerator as f64 / denominator as f64;
            let bench = ArmBench::<2>::weightless();
            bench
                .ask(SetIntegrator {
                    timestep: Some(timestep),
                    ..method(Method::Euler)
                })
                .await;
            bench.ask(Reset::default()).await;
            let began = Instant::now();
            for pause in [300, 700, 1, 999, 50, 2950, 5000] {
                sleep(ms(pause)).await;
                let elapsed = began.elapsed();
                let expected = elapsed.as_nanos() * denominator / (numerator * 1_000_000_000);
                let simulation = bench.snapshot().await;
                assert_eq!(
                    u128::from(simulation.steps()),
                    expected,
                    "{timestep} s after {elapsed:?}"
                );
                assert_eq!(simulation.time(), simulation.steps() as f64 * timestep);
            }
        }
    });
}

/// With a timestep that no machine can follow every wake-up works for its 5 ms of real time. With the 12 ticks of 0.2 s
/// alone that is 0.06 s in all. With a wake-up after every pause of a millisecond (two, by the timer) it is 0.5 s or
/// more.
#[test]
fn what_one_wake_up_leaves_owed_is_taken_up_before_the_next_tick() {
    in_virtual_time(async {
        let bench = ArmBench::<3>::weightless();
        bench.ask(of_timestep(1e-12)).await;
        let began = std::time::Instant::now();
        sleep(ms(200)).await;
        let worked = began.elapsed();
        let ticks_alone = 12 * WAKE_UP_BUDGET;
        assert!(worked > 4 * ticks_alone, "{worked:?}");
    });
}

#[test]
fn a_new_timestep_a_resume_and_a_reset_discard_the_unfinished_step() {
    in_virtual_time(async {
        for change in 0..3 {
            let bench = ArmBench::<2>::weightless();

            bench.ask(of_timestep(1.0)).await;
            sleep(ms(1600)).await;
            let before = bench.steps().await;
            assert_eq!(before, 1);
            match change {
                0 => drop(bench.ask(of_timestep(0.9)).await),
                1 => {
                    bench.ask(pause(true)).await;
                    bench.ask(pause(false)).await;
                }
                _ => drop(bench.ask(Reset::default()).await),
            }
            let before = bench.steps().await;
            sleep(ms(800)).await;
            assert_eq!(
                bench.steps().await,
                before,
                "change {change}: 0.6 s before it are gone"
            );
            sleep(ms(210)).await;
            assert_eq!(bench.steps().await, before + 1, "change {change}");
        }
    });
}

#[test]
fn requests_that_change_nothing_keep_the_unfinished_step() {
    in_virtual_time(async {
        let bench = ArmBench::<2>::weightless();
        bench.ask(of_timestep(1.0)).await;
        let before = bench.steps().await;
        let began = Instant::now();
        let requests = [
            (Service::SetIntegrator, json!({})),
            (Service::SetIntegrator, json!({"timestep": 1.0})),
            (
                Service::SetIntegrator,
                json!({"timestep": 1, "method": "rk4"}),
            ),
            (Service::SetIntegrator, json!({"timestep": -1})),
            (Service::SetIntegrator, json!({"method": "euler"})),
            (Service::SetIntegrator, json!([1, 2, 3])),
            (Service::SetParams, json!({})),
            (
                Service::SetParams,
                json!({"gravity": 0, "masses": [1, 1], "lengths": [1, 1]}),
            ),
            (Service::Pause, json!({})),
            (Service::Pause, json!({"data": false})),
            (Service::Pause, json!({"data": 1})),
            (Service::Reset, json!([1])),
            (Service::Enable, json!({"data": false})),
            (Service::SetGains, json!({"kp": [1, 1]})),
        ];
        for (service, args) in requests {
            sleep(ms(70)).await;
            bench.call(service, args).await;
        }
        bench.hold([1.0; 2], [0.0; 2]).await;
        assert!(began.elapsed() < ms(990));
        assert_eq!(bench.steps().await, before);
        sleep(ms(1000) - began.elapsed()).await;
        assert_eq!(bench.steps().await, before + 1);
    });
}

#[test]
fn a_paused_arm_takes_no_step_and_owes_none() {
    in_virtual_time(async {
        let bench = ArmBench::<2>::new(Arm::default());
        sleep(ms(500)).await;
        bench.ask(enable(true)).await;
        sleep(ms(500)).await;
        bench.ask(pause(true)).await;
        let frozen = bench.snapshot().await;
        sleep(ms(5000)).await;
        assert_eq!(
            bench.snapshot().await,
            frozen,
            "state, integral, effort and clock"
        );
        bench.ask(pause(false)).await;
        assert_eq!(bench.snapshot().await, frozen);
        sleep(ms(100)).await;
        assert_eq!(bench.steps().await, frozen.steps() + 100);
    });
}

#[test]
fn missed_ticks_are_skipped_and_at_most_a_quarter_of_a_second_is_caught_up() {
    in_virtual_time(async {
        let bench = ArmBench::<2>::new(Arm::default());
        bench.want(Topic::JointStates, true).await;
        for stall in [3, 1000, 60_000] {
            sleep(ms(100)).await;
            let before = bench.steps().await;
            bench.heard.take();
            // Nobody runs while the clock jumps: a stalled process.
            advance(Duration::from_secs(stall)).await;
            sleep(ms(1)).await;
            let steps = bench.steps().await - before;
            // 250 ms, the step in progress, and the millisecond since.
            assert!(
                (250..=252).contains(&steps),
                "{steps} steps after {stall} s"
            );
            let messages = bench.heard.messages(Topic::JointStates).len();
            assert!(messages <= 1, "{messages} messages after {stall} s");
        }
    });
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

//! Clients that step the arm at the same time, and the events that end their steps.

use super::*;
use pendularm::actors::arm::sim::{STEPS_IN_A_ROW, StepsEnd};
use pendularm::actors::node::ShutDown;

#[test]
fn clients_that_step_the_arm_take_turns_and_delay_neither_the_tick_nor_a_light_call() {
    in_virtual_time(async {
        let bench = TurnsBench::paused().await;
        for connection in 1..=9 {
            bench.step(connection, MAX_STEPS);
        }
        bench.step(10, 3 * STEPS_IN_A_ROW);
        bench.step(11, 1);
        bench.ask(12, SetGains::default());
        let turns = bench.until_answers(12).await;
        let order: Vec<u64> = bench.answers().iter().map(|(of, _)| *of).collect();
        assert_eq!(order, [11, 12, 10, 1, 2, 3, 4, 5, 6, 7, 8, 9]);
        bench.assert_ticks(turns, "steps");
        let all = 9 * MAX_STEPS + 3 * STEPS_IN_A_ROW + 1;
        let mut offline = Simulation::<3>::new(Arm::default(), Gains::default());
        offline.advance(all);
        assert_eq!(
            bench.snapshot().await,
            offline,
            "each step once, to the bit"
        );
        for (client, answer) in bench.answers() {
            let steps = match client {
                1..=9 => MAX_STEPS,
                10 => 3 * STEPS_IN_A_ROW,
                11 => 1,
                _ => continue,
            };
            let stepped = stepped(&answer);
            assert_eq!((stepped.steps, stepped.end), (steps, StepsEnd::AllTaken));
        }
    });
}

#[test]
fn a_resume_ends_the_steps_that_are_left_and_says_so() {
    in_virtual_time(async {
        let bench = TurnsBench::paused().await;
        bench.step(1, MAX_STEPS);
        bench.ask(2, pause(false));
        bench.until_answers(2).await;
        let answers = bench.answers();
        let (_, answer) = answers.iter().find(|(of, _)| *of == 1).unwrap();
        let stepped = stepped(answer);
        assert_eq!(
            (stepped.steps, stepped.end),
            (STEPS_IN_A_ROW, StepsEnd::Resumed)
        );
    });
}

/// Requests between the steps take effect between them, as if each step had been requested alone.
#[test]
fn a_reset_in_between_takes_effect_in_between() {
    in_virtual_time(async {
        let bench = TurnsBench::paused().await;
        bench.step(1, MAX_STEPS);
        bench.ask(2, Reset::default());
        bench.until_answers(2).await;
        let mut offline = Simulation::<3>::new(Arm::default(), Gains::default());
        offline.advance(MAX_STEPS - STEPS_IN_A_ROW);
        assert_eq!(bench.snapshot().await, offline);
        let (of, answer) = bench.answers().pop().unwrap();
        let stepped = stepped(&answer);
        assert_eq!((of, stepped.steps), (1, MAX_STEPS));
        assert_eq!(stepped.time, offline.time());
    });
}

/// Euler at one-second steps: the free arm overflows within some hundred steps. A request that is waiting for its turn
/// then takes no step.
#[test]
fn a_divergence_ends_the_steps_of_all_clients() {
    in_virtual_time(async {
        let bench = TurnsBench::paused().await;
        let integrator = |timestep: f64| SetIntegrator {
            method: Some(Method::Euler),
            timestep: Some(timestep),
            rejected: Rejections::default(),
        };
        bench.ask(3, integrator(1e-3));
        for connection in 1..=2 {
            bench.step(connection, MAX_STEPS);
        }
        bench.ask(3, integrator(1.0));
        bench.until_answers(4).await;
        for (of, answer) in bench.answers().iter().filter(|(of, _)| *of != 3) {
            let stepped = stepped(answer);
            assert_eq!(stepped.end, StepsEnd::Diverged, "{of}");
            assert!(stepped.steps >= STEPS_IN_A_ROW);
        }
    });
}

#[test]
fn steps_of_a_client_that_is_gone_are_not_taken() {
    in_virtual_time(async {
        let bench = TurnsBench::paused().await;
        let gone = bench.step(1, MAX_STEPS);
        gone.store(true, Ordering::Relaxed);
        bench.step(2, 2 * STEPS_IN_A_ROW);
        bench.until_answers(2).await;
        let taken = bench.snapshot().await.steps();
        assert!(taken <= 3 * STEPS_IN_A_ROW, "{taken}");
    });
}

#[test]
fn at_the_end_the_steps_that_are_left_are_refused() {
    in_virtual_time(async {
        let bench = TurnsBench::paused().await;
        for connection in 1..=3 {
            bench.step(connection, MAX_STEPS);
        }
        bench.arm.do_send(ShutDown("shutting down"));
        bench.until_answers(3).await;
        assert_eq!(bench.snapshot().await.steps(), 3 * STEPS_IN_A_ROW);
        for (_, answer) in bench.answers() {
            assert_eq!(answer, Answer::Unserved(Unserved("shutting down")));
        }
    });
}

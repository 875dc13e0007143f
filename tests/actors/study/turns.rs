//! Light requests among heavy ones, on the pool.

use std::pin::pin;
use std::task::{Context, Waker};

use super::*;
use crate::system::in_real_time;

/// Minutes of work in an unoptimised build; no test waits for its end.
fn heavy() -> RunOffline<2> {
    RunOffline {
        duration: Some(10.0),
        reference: Some(true),
        changed: Changed {
            timestep: Some(1e-6),
            gains: Some(SetGains {
                kp: Some([1.0; 2]),
                ..SetGains::default()
            }),
            ..Changed::default()
        },
        ..RunOffline::default()
    }
}

/// Ten steps.
fn short<const N: usize>() -> RunOffline<N> {
    RunOffline {
        duration: Some(0.01),
        changed: Changed {
            timestep: Some(0.001),
            ..Changed::default()
        },
        ..RunOffline::default()
    }
}

#[test]
fn light_requests_are_answered_between_slices_of_heavy_ones() {
    in_real_time(async {
        let mut bench = study::<2>();
        let heavy = bench.ask_as(1, heavy());
        bench.ask_as(2, short());
        bench.ask_as(3, short());
        let mut light = [bench.next().await, bench.next().await];
        light.sort_unstable();
        assert_eq!(light, [2, 3]);
        // A prediction is cut into slices too.
        let mut three = study::<3>();
        three.ask_as(1, PredictStability::default());
        three.ask_as(2, short());
        assert_eq!(three.next().await, 2);
        assert_eq!(three.next().await, 1);
        heavy.answer.abort();
        assert!(timeout(PATIENCE, heavy.completion.wait()).await.is_ok());
    });
}

/// Turns of one worker until a client has its million steps, while this number of other clients run heavy rollouts.
async fn turns_until_integrated(others: u64) -> u32 {
    let (answered, mut order) = mpsc::unbounded_channel();
    let pool = WorkerPool::without_threads();
    let node = Study::new(settled_arm::<2>(), pool.clone()).start();
    let (study, integration) = (node.clone().recipient(), node.recipient());
    for connection in 1..=others {
        ask_as(&study, connection, &answered, heavy());
    }
    // The study first queries the arm. Some virtual time passes when all tasks wait.
    sleep(ms(1)).await;
    for _ in 0..10 * others {
        assert!(pool.turn());
    }
    let step = IntegrationStep {
        function: Some("sin(t)".to_owned()),
        x0: Some(0.5),
        dt: Some(1e-3),
        steps: Some(1_000_000),
        method: Some(Method::Rk4),
        ..IntegrationStep::default()
    };
    let honest = ask_as(&integration, 100, &answered, step);
    sleep(ms(1)).await;
    let mut turns = 0;
    let mut completed = pin!(honest.completion.wait());
    let mut context = Context::from_waker(Waker::noop());
    while completed.as_mut().poll(&mut context).is_pending() {
        assert!(pool.turn());
        turns += 1;
    }
    assert_eq!(order.recv().await, Some(100));
    assert!(matches!(honest.answer.await, Ok(Ok(Ok(_)))));
    pool.close("the test is over");
    turns
}

/// Each query of the clock costs the same here, so turns can be counted on any machine.
#[test]
fn heavy_rollouts_delay_an_integration_by_its_fair_share_and_no_more() {
    in_virtual_time(async {
        work_clock::count(Duration::from_micros(100));
        let alone = turns_until_integrated(0).await;
        let among_six = turns_until_integrated(5).await;
        assert!(alone > 10, "{alone} turns: too few to be shared");
        let fair = 5 * alone..=6 * (alone + 1);
        assert!(
            fair.contains(&among_six),
            "{among_six} turns instead of {alone}"
        );
    });
}

//! Attacks on the pool: computations that are long, many, unread, or abandoned.

use super::Attack;
use super::script::{Client, LONG, call};

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "deaf-computing",
        "40 clients ask for a million steps each (60 MB) and read nothing",
        || {
            Client::tcp()
                .says_each(0..8, |_| steps("sin(t)", 1_000_000))
                .deaf()
                .times(40)
        },
    ),
    Attack::new(
        "rollouts",
        "20 clients ask for rollouts of 10,000,000 steps and 100,000 samples",
        || {
            let ask = rollout(r#","samples":100000,"integrator":"rk4""#);
            Client::tcp().repeats(&ask).times(20)
        },
    ),
    Attack::new(
        "stability",
        "20 clients ask for limits of stability, of other gains each time",
        || {
            let ask = |k: usize| {
                let gains = format!(r#"{{"gains":{{"kp":[{k},{k}]}}}}"#);
                call("/study/stability", "1", &gains)
            };
            Client::tcp().repeats_each(1..200, ask).times(20)
        },
    ),
    Attack::new(
        "overflowing-plans",
        "100 clients ask for plans of loops whose numbers overflow",
        || {
            let gains = r#""gains":{"kp":[1e300,1e300],"kd":[1e300,1e300]},"setpoint":[1,1]"#;
            let args = format!(r#"{{"error":1e-6,"duration":10,{gains}}}"#);
            Client::tcp()
                .repeats(&call("/study/plan", "1", &args))
                .times(100)
        },
    ),
    Attack::new(
        "expressions",
        "20 clients ask for functions of 4 MiB: parentheses, powers, sums",
        || {
            let functions =
                ["(", "-", "2^", "t+", "sin("].map(|part| part.repeat(LONG / part.len()) + "1");
            let client = |function: &String| Client::tcp().repeats(&steps(function, 10)).times(4);
            functions.iter().flat_map(client).collect()
        },
    ),
    Attack::new(
        "left-behind",
        "20 clients ask for much, leave at once and return",
        || {
            Client::tcp()
                .says_each(0..16, |_| steps("exp(sin(t))", 1_000_000))
                .leaves_after(5)
                .returns()
                .times(20)
        },
    ),
    Attack::new(
        "busy",
        "200 clients ask for a computation without end",
        || {
            Client::tcp()
                .says_each(0..2, |_| rollout(r#","reference":true"#))
                .times(200)
        },
    )
    .fills(),
];

pub(super) fn steps(function: &str, steps: usize) -> String {
    let rest = format!(r#""x0":0.3333333333333333,"dt":1e-3,"steps":{steps},"integrator":"rk4""#);
    let args = format!(r#"{{"function":"{function}",{rest}}}"#);
    call("/arm_sim/integration_step", "1", &args)
}

/// Ten seconds of motion in steps of a microsecond.
pub(super) fn rollout(further: &str) -> String {
    let args = format!(r#"{{"q0":[0.4,-0.3],"duration":10,"timestep":1e-6{further}}}"#);
    call("/study/rollout", "1", &args)
}

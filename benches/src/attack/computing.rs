//! Aimed at the pool: computations that are long, many, unread, or left behind.

use super::Attack;
use super::script::{Client, call};

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "deaf-computing",
        "40 clients ask for a million steps each (60 MB) and read nothing",
        deaf,
    ),
    Attack::new(
        "references",
        "20 clients ask for rollouts with a reference, 10 s at 1e-5 s",
        references,
    ),
    Attack::new(
        "rollouts",
        "20 clients ask for rollouts of 10,000,000 steps and 100,000 samples",
        rollouts,
    ),
    Attack::new(
        "stability",
        "20 clients ask for limits of stability, of other gains each time",
        stability,
    ),
    Attack::new(
        "overflowing-plans",
        "100 clients ask for plans of loops whose numbers overflow",
        || {
            let further = r#""gains":{"kp":[1e300,1e300],"kd":[1e300,1e300]},"setpoint":[1,1]"#;
            let ask = call(
                "/study/plan",
                "1",
                &format!(r#"{{"error":1e-6,"duration":10,{further}}}"#),
            );
            Client::tcp().repeats(&ask).times(100)
        },
    ),
    Attack::new(
        "expressions",
        "20 clients ask for functions of 4 MiB: parentheses, powers, sums",
        expressions,
    ),
    Attack::new(
        "heavy-steps",
        "20 clients ask for the most work that a computation may be",
        heavy,
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
        busy,
    )
    .fills(),
];

const STEP: &str = "/arm_sim/integration_step";

fn steps(function: &str, steps: usize) -> String {
    let rest = format!(r#""x0":0.3333333333333333,"dt":1e-3,"steps":{steps},"integrator":"rk4""#);
    call(STEP, "1", &format!(r#"{{"function":"{function}",{rest}}}"#))
}

fn deaf() -> Vec<Client> {
    Client::tcp()
        .says_each(0..8, |_| steps("sin(t)", 1_000_000))
        .deaf()
        .times(40)
}

fn rollout(further: &str) -> String {
    call(
        "/study/rollout",
        "1",
        &format!(r#"{{"q0":[0.4,-0.3],"duration":10{further}}}"#),
    )
}

fn references() -> Vec<Client> {
    Client::tcp()
        .repeats(&rollout(r#","timestep":1e-5,"reference":true"#))
        .times(20)
}

fn rollouts() -> Vec<Client> {
    Client::tcp()
        .repeats(&rollout(
            r#","timestep":1e-6,"samples":100000,"integrator":"rk4""#,
        ))
        .times(20)
}

fn stability() -> Vec<Client> {
    let ask = |k: usize| {
        call(
            "/study/stability",
            "1",
            &format!(r#"{{"gains":{{"kp":[{k},{k}]}}}}"#),
        )
    };
    Client::tcp().repeats_each(1..200, ask).times(20)
}

fn expressions() -> Vec<Client> {
    const MOST: usize = 4 * 1024 * 1024 - 1024;
    let functions = [
        "(".repeat(MOST),
        "-".repeat(MOST),
        "2^".repeat(MOST / 2),
        "t+".repeat(MOST / 2) + "1",
        "sin(".repeat(MOST / 4),
    ];
    let client = |function: &String| Client::tcp().repeats(&steps(function, 10)).times(4);
    functions.iter().flat_map(client).collect()
}

fn heavy() -> Vec<Client> {
    let function = "sin(t)+".repeat(120) + "1";
    Client::tcp()
        .says_each(0..16, |_| steps(&function, 1_000_000))
        .times(20)
}

fn busy() -> Vec<Client> {
    Client::tcp()
        .says_each(0..2, |_| rollout(r#","timestep":1e-6,"reference":true"#))
        .times(200)
}

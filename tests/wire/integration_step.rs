//! `/arm_sim/integration_step` from outside: what it computes, what it refuses, and that it hinders nobody.

use std::time::Duration;

use crate::arm::{in_one_of_three_tries, numbers, stamp, state};
use crate::common::{Client, Runtime};
use pendularm::math::expression::Expression;
use pendularm::math::integrator::Method;
use pendularm::math::particle::Particle;
use serde_json::{Value, json};

const SERVICE: &str = "/arm_sim/integration_step";

/// A good request with one field replaced.
fn with(field: &str, value: Value) -> Value {
    let mut request = json!({"function": "t", "x0": 0.0, "xdot0": 0.0, "dt": 0.1, "steps": 10, "integrator": "rk4"});
    request[field] = value;
    request
}

fn without(field: &str) -> Value {
    let mut request = with("x0", json!(0));
    request.as_object_mut().unwrap().remove(field);
    request
}

/// A request of seconds of work and a small answer: a sum of 2001 terms (4001 nodes), 4 times in each of 100,000 steps.
/// A test that sends it does not wait for its end.
fn heavy() -> Value {
    let sum = vec!["t"; 2001].join("+");
    json!({"function": sum, "x0": 0, "dt": 1e-3, "steps": 100_000, "integrator": "rk4"})
}

/// The same for some hundred milliseconds.
fn lighter() -> Value {
    let mut request = heavy();
    request["steps"] = json!(10_000);
    request
}

/// A call, as a line.
fn call(id: &str, args: &Value) -> String {
    let frame = json!({"op": "call_service", "service": SERVICE, "id": id, "args": args});
    format!("{frame}\n")
}

/// A call that is answered at once, as a line.
const LIGHT: &str =
    "{\"op\":\"call_service\",\"service\":\"/arm_sim/set_params\",\"id\":\"light\"}\n";

fn send_call(client: &mut Client, id: &str, args: &Value) {
    client.send_bytes(call(id, args).as_bytes());
}

fn response(client: &mut Client) -> Value {
    client.receive_where("response", |frame| frame["op"] == "service_response")
}

#[test]
fn each_method_gives_what_fifty_digits_give() {
    let oracle: Value = serde_json::from_str(include_str!("../data/integrators.json")).unwrap();
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let mut compared = 0;
    for case in oracle["cases"].as_array().unwrap() {
        if case["depends_on"] != "t" {
            continue;
        }
        let function = case["acceleration"]
            .as_str()
            .unwrap()
            .replace(" (the float64)", "");
        let number = |field: &str| case[field].as_f64().unwrap();
        let values = client.ask(
            SERVICE,
            json!({"function": function, "x0": number("x0"), "xdot0": number("v0"), "dt": number("dt"),
                "steps": case["steps"], "integrator": case["method"]}),
        );
        // The sum is compensated, so half an ulp of the result and some roundings in the last step remain: 3 units of
        // 2^-53 max(|x|, |v|, 1), as in the test of the particle itself. Nothing may get lost on the way through JSON.
        let scale = number("x").abs().max(number("v").abs()).max(1.0);
        let tolerance = 1.5 * f64::EPSILON * scale;
        for (array, wanted) in [("positions", "x"), ("velocities", "v")] {
            let last = *numbers(&values[array]).last().unwrap();
            assert!((last - number(wanted)).abs() <= tolerance, "{last} {case}");
        }
        compared += 1;
    }
    assert_eq!(compared, 7 * 4 * 11, "7 forces, 4 methods, 11 grids");
}

/// `f(t) = t` from rest is `x = t³/6`, `v = t²/2`. Summing each method's increments over `n` steps of `h`:
/// Euler `x = h³ n(n-1)(n-2)/6`, `v = h² n(n-1)/2`; those of order 2 are exact in `v` and miss `h³/6` of `x` in every
/// step; Runge-Kutta is exact. A method that freezes `t` over the step has Euler's `v`.
#[test]
fn every_stage_is_evaluated_at_its_own_time() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let (n, h): (f64, f64) = (10.0, 0.1);
    let t = n * h;
    let euler = (
        h.powi(3) * n * (n - 1.0) * (n - 2.0) / 6.0,
        h * h * n * (n - 1.0) / 2.0,
    );
    let second = (t.powi(3) / 6.0 - t * h * h / 6.0, t * t / 2.0);
    let exact = (t.powi(3) / 6.0, t * t / 2.0);
    for method in Method::ALL {
        let (x, v) = match method.order() {
            1 => euler,
            2 => second,
            _ => exact,
        };
        let values = client.ask(SERVICE, with("integrator", json!(method.name())));
        let last = |array: &str| *numbers(&values[array]).last().unwrap();
        // Ten steps of numbers up to 1, and the roundings of the formula above: some ulp of 1.
        assert!((last("positions") - x).abs() < 1e-15, "{method}");
        assert!((last("velocities") - v).abs() < 1e-15, "{method}");
    }
}

#[test]
fn the_answer_starts_at_the_start_and_has_one_entry_more_than_steps() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let values = client.ask(
        SERVICE,
        json!({"function": "0", "x0": 0.25, "xdot0": -2, "dt": 0.1, "steps": 30, "integrator": "euler"}),
    );
    assert_eq!(values.as_object().unwrap().len(), 3, "{values}");
    let times = numbers(&values["times"]);
    let expected: Vec<f64> = (0..=30).map(|k| f64::from(k) * 0.1).collect();
    assert_eq!(times, expected, "products, not a running sum");
    assert_eq!(numbers(&values["positions"]).len(), 31);
    assert_eq!(numbers(&values["velocities"]), vec![-2.0; 31]);
    assert_eq!(values["positions"][0], 0.25);
}

#[test]
fn what_is_printed_reads_back_as_the_same_bits() {
    let runtime = Runtime::start();
    let args = json!({"function": "sin(5*t)*exp(-t)", "x0": 1, "xdot0": -1, "dt": 0.001, "steps": 5000,
        "integrator": "rk4"});
    let values = runtime.connect().ask(SERVICE, args);
    let function = Expression::parse("sin(5*t)*exp(-t)").unwrap();
    let mut particle = Particle::new(function, 1.0, -1.0, 0.001, 5000, Method::Rk4).unwrap();
    particle.advance(5000);
    let times: Vec<f64> = particle.times().collect();
    let expected = json!({"times": times, "positions": particle.positions(),
        "velocities": particle.velocities()});
    assert_eq!(values, expected);
}

#[test]
fn the_starting_velocity_is_zero_where_it_is_absent_or_null() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for request in [without("xdot0"), with("xdot0", Value::Null)] {
        let values = client.ask(SERVICE, request);
        assert_eq!(values["velocities"][0], 0.0);
    }
}

#[test]
fn whole_floats_count_as_steps() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for text in ["10", "10.0", "1e1", "100e-1"] {
        let frame = format!(
            r#"{{"op":"call_service","service":"{SERVICE}","id":"{text}","args":{{"function":"t","x0":0,"dt":1,"steps":{text},"integrator":"rk4"}}}}"#
        );
        client.send_bytes(format!("{frame}\n").as_bytes());
        let response = response(&mut client);
        assert_eq!(response["id"], text);
        assert_eq!(numbers(&response["values"]["times"]).len(), 11, "{text}");
    }
}

#[test]
fn arguments_may_come_by_position() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let named = client.ask(SERVICE, with("xdot0", json!(2.5)));
    let positional = client.ask(SERVICE, json!(["t", 0.0, 2.5, 0.1, 10, "rk4"]));
    assert_eq!(named, positional);
    let why = client.refusal(SERVICE, json!(["t", 0.0, 2.5, 0.1, 10, "rk4", 1]));
    assert!(why.contains("args"), "{why}");
}

#[test]
fn every_bad_field_is_refused_by_name_with_empty_values() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let cases = [
        (
            "function",
            vec![json!(null), json!(5), json!(["t"]), json!("")],
        ),
        ("x0", vec![json!(null), json!("1"), json!(true), json!([1])]),
        ("xdot0", vec![json!("1"), json!(false), json!({})]),
        (
            "dt",
            vec![
                json!(0),
                json!(0.0),
                json!(-0.1),
                json!(null),
                json!("0.1"),
                json!(true),
            ],
        ),
        (
            "steps",
            vec![
                json!(0),
                json!(-3),
                json!(2.5),
                json!(null),
                json!("10"),
                json!(true),
            ],
        ),
        (
            "integrator",
            vec![json!("rk5"), json!("RK4"), json!(""), json!(4), json!(null)],
        ),
    ];
    for (field, values) in cases {
        for value in values {
            let request = with(field, value.clone());
            let response = client.call(SERVICE, request);
            assert_eq!(response["result"], false, "{field} {value}");
            assert_eq!(response["values"], json!({}), "{field} {value}");
            let status = response["status"].as_str().unwrap();
            assert!(status.contains(field), "{field} {value}: {status}");
        }
    }
    for field in ["function", "x0", "dt", "steps", "integrator"] {
        let why = client.refusal(SERVICE, without(field));
        assert!(why.contains(field), "{why}");
    }
    client.ask(SERVICE, with("x0", json!(1)));
}

#[test]
fn numbers_that_are_not_finite_are_refused_by_name() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for field in ["x0", "xdot0", "dt", "steps"] {
        for literal in ["NaN", "Infinity", "-Infinity", "1e999"] {
            let args = with(field, json!("LITERAL"))
                .to_string()
                .replace("\"LITERAL\"", literal);
            client.send_bytes(
                format!("{{\"op\":\"call_service\",\"service\":\"{SERVICE}\",\"id\":1,\"args\":{args}}}\n")
                    .as_bytes(),
            );
            let response = response(&mut client);
            assert_eq!(response["result"], false, "{field} {literal}");
            let status = response["status"].as_str().unwrap();
            assert!(status.contains(field), "{field} {literal}: {status}");
        }
    }
}

#[test]
fn all_that_is_wrong_is_listed_at_once() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let why = client.refusal(
        SERVICE,
        json!({"function": "1 2", "x0": "a", "xdot0": [], "dt": -1, "steps": 0, "integrator": "leapfrog"}),
    );
    for field in ["function", "x0", "xdot0", "dt", "steps", "integrator"] {
        assert!(why.contains(field), "{field} is missing in {why}");
    }
    let why = client.refusal(SERVICE, json!({}));
    for field in ["function", "x0", "dt", "steps", "integrator"] {
        assert!(why.contains(field), "{field} is missing in {why}");
    }
}

#[test]
fn what_does_not_parse_is_refused_and_later_calls_work() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for function in [
        "",
        "   ",
        "(",
        ")",
        "(t",
        "t)",
        "()",
        "1 2",
        "t t",
        "2t",
        "t(1)",
        "sin",
        "sin t",
        "sin()",
        "sin(t",
        "sin(t,t)",
        "foo(t)",
        "x",
        "pi",
        "e",
        "T",
        "t +",
        "* t",
        "t ** 2",
        "+t",
        "t + +1",
        "1..2",
        ".",
        "1e",
        "1e+",
        "t # 1",
        "t; t",
        "t$",
        "0x10",
        "é",
        "t\u{0}",
        "∞",
        "1,5",
        "t=1",
        "tan",
        "sqrt4",
        "--",
        "t-",
        "((((((t)))))",
        "\"t\"",
        "t\n\n)",
    ] {
        let why = client.refusal(SERVICE, with("function", json!(function)));
        assert!(why.contains("function"), "{function:?}: {why}");
    }
    client.ask(SERVICE, with("function", json!("t^2 + 3*t - 1")));
}

#[test]
fn the_grammar_is_the_specifications() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    // With dt = 1 one step of Euler from rest ends with v = f(0).
    for (function, value) in [
        ("2^3^2", 512.0),
        ("2-3-4", -5.0),
        ("16/4/2", 2.0),
        ("-2^2", 4.0),
        ("2+3*4", 14.0),
        ("--3", 3.0),
        ("2^-1", 0.5),
        ("(2+3)*4", 20.0),
        (".5 + 5. + 1e3 + 2.5E-2", 1005.525),
        (
            "cos (t) + exp(t) + sqrt(4) + ln(1) + abs(-3) + tan(0) + sin(0)",
            7.0,
        ),
    ] {
        let values = client.ask(
            SERVICE,
            json!({"function": function, "x0": 0, "dt": 1, "steps": 1, "integrator": "euler"}),
        );
        assert_eq!(values["velocities"][1], json!(value), "{function}");
    }
}

#[test]
fn results_that_are_not_finite_are_null() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for function in ["sqrt(-1)", "1/t", "ln(t)", "exp(1000)", "0/0", "1e308*10"] {
        let values = client.ask(
            SERVICE,
            json!({"function": function, "x0": 3, "xdot0": 0, "dt": 1, "steps": 2, "integrator": "euler"}),
        );
        assert_eq!(values["times"], json!([0.0, 1.0, 2.0]), "{function}");
        assert_eq!(values["velocities"], json!([0.0, null, null]), "{function}");
        assert_eq!(values["positions"], json!([3.0, 3.0, null]), "{function}");
    }
    // Times beyond the largest number are no number either.
    let values = client.ask(
        SERVICE,
        json!({"function": "0", "x0": 3, "dt": 1e308, "steps": 2, "integrator": "euler"}),
    );
    assert_eq!(values["times"], json!([0.0, 1e308, null]));
}

#[test]
fn a_million_steps_are_taken_and_one_more_is_refused_with_the_limit() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for steps in [json!(1_000_001), json!(1e300), json!(u64::MAX)] {
        let why = client.refusal(SERVICE, with("steps", steps));
        assert!(why.contains("steps") && why.contains("1000000"), "{why}");
    }
    let values = client.ask(
        SERVICE,
        json!({"function": "t", "x0": 0, "dt": 1e-6, "steps": 1_000_000, "integrator": "verlet"}),
    );
    let positions = values["positions"].as_array().unwrap();
    assert_eq!(positions.len(), 1_000_001);
    assert_eq!(values["times"].as_array().unwrap().len(), 1_000_001);
    // Only h²/6 of the closed form above is missing: 1.7e-13.
    let last = positions.last().unwrap().as_f64().unwrap();
    assert!((last - 1.0 / 6.0).abs() < 2e-13, "{last}");
}

#[test]
fn too_much_work_is_refused_with_the_limit() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    // 1001 terms and 1000 sums are 2001 nodes; 250,000 steps of 4 evaluations make 2.001e9.
    let sum = vec!["t"; 1001].join("+");
    let request = |method: &str| json!({"function": sum, "x0": 0, "dt": 1e-3, "steps": 250_000, "integrator": method});
    let why = client.refusal(SERVICE, request("rk4"));
    assert!(
        why.contains("function") && why.contains("2000000000"),
        "{why}"
    );
}

#[test]
fn an_expression_of_a_megabyte_is_no_trouble() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    let request = |function: String| json!({"function": function, "x0": 0, "dt": 1, "steps": 1, "integrator": "euler"});
    let sum = vec!["1"; 524_288].join("+");
    assert!(sum.len() > 1_000_000);
    let values = client.ask(SERVICE, request(sum));
    assert_eq!(values["velocities"][1], 524_288.0);
    for deep in [
        format!("{}1{}", "(".repeat(500_000), ")".repeat(500_000)),
        format!("{}1", "-".repeat(1_000_000)),
        format!("{}1{}", "sin(".repeat(200_000), ")".repeat(200_000)),
        vec!["1"; 500_000].join("^"),
    ] {
        // Taken or refused by a limit, but answered.
        client.call(SERVICE, request(deep));
    }
    for bad in [
        "(".repeat(1_000_000),
        ")".repeat(1_000_000),
        "1 ".repeat(500_000),
    ] {
        let why = client.refusal(SERVICE, request(bad));
        assert!(
            why.len() < 4096,
            "an error quotes an excerpt: {}",
            why.len()
        );
    }
    client.ask(SERVICE, with("x0", json!(1)));
}

#[test]
fn the_live_arm_neither_helps_nor_hears_of_it() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/joint_states");
    client.ask("/pid_controller/enable", json!({"data": true}));
    client.ask("/arm_sim/pause", json!({"data": true}));
    let settings = |client: &mut Client| {
        [
            "/arm_sim/set_integrator",
            "/arm_sim/set_params",
            "/arm_sim/pause",
            "/pid_controller/enable",
            "/pid_controller/set_gains",
        ]
        .map(|service| client.ask(service, json!({})))
    };
    let (before, settings_before) = (state(&mut client), settings(&mut client));
    let paused = client.ask(SERVICE, with("integrator", json!("euler")));
    assert_eq!(
        (before, settings_before),
        (state(&mut client), settings(&mut client))
    );

    client.ask(
        "/arm_sim/set_params",
        json!({"gravity": 3, "lengths": [2, 2]}),
    );
    client.ask(
        "/arm_sim/set_integrator",
        json!({"method": "verlet", "timestep": 0.01}),
    );
    client.ask("/arm_sim/pause", json!({"data": false}));
    assert_eq!(
        client.ask(SERVICE, with("integrator", json!("euler"))),
        paused
    );
}

#[test]
fn light_requests_overtake_a_heavy_one_on_the_same_connection() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.send_bytes((call("heavy", &lighter()) + LIGHT).as_bytes());
    assert_eq!(response(&mut client)["id"], "light");
    assert_eq!(response(&mut client)["id"], "heavy");
}

#[test]
fn the_computations_of_a_connection_are_done_one_after_another_and_none_is_refused() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    // The first is the longest: were two done at a time, the second would be answered before it.
    send_call(&mut client, "0", &lighter());
    for id in 1..60 {
        send_call(&mut client, &id.to_string(), &with("x0", json!(id)));
    }
    for id in 0..60 {
        let response = response(&mut client);
        assert_eq!(response["id"], id.to_string());
        assert_eq!(response["result"], true);
    }
}

#[test]
fn a_connection_with_sixteen_computations_waiting_is_not_read() {
    let runtime = Runtime::start();
    for (computations, overtaken) in [(17, false), (16, true)] {
        let mut client = runtime.connect();
        let later = call("later", &heavy()).repeat(computations - 1);
        // At once, so that all have come before the first is done.
        client.send_bytes((call("first", &lighter()) + &later + LIGHT).as_bytes());
        // One runs. Behind it 16 may wait before the connection is no longer read, until the first is done.
        let first = response(&mut client);
        assert_eq!(first["id"], if overtaken { "light" } else { "first" });
        let second = response(&mut client);
        assert_eq!(second["id"], if overtaken { "first" } else { "light" });
    }
}

#[test]
fn connections_take_turns() {
    let runtime = Runtime::start();
    let mut patient = runtime.connect();
    send_call(&mut patient, "heavy", &heavy());
    patient.settle();
    // Order is what is asserted, not time: ten small requests of another client are done before the large one.
    let mut other = runtime.connect();
    for _ in 0..10 {
        other.ask(SERVICE, with("integrator", json!("verlet")));
    }
    let early = patient.receive_for(Duration::from_millis(1));
    assert!(
        early.is_empty(),
        "the heavy request was done first: make it heavier"
    );
}

#[test]
fn the_arm_and_its_messages_go_on_while_somebody_computes() {
    in_one_of_three_tries("a third of the time and a sixth of the messages", || {
        let runtime = Runtime::start();
        let mut busy: Vec<Client> = (0..3).map(|_| runtime.connect()).collect();
        for client in &mut busy {
            send_call(client, "heavy", &heavy());
            client.settle();
        }
        let mut watcher = runtime.connect();
        watcher.subscribe("/joint_states");
        let seen = watcher.receive_for(Duration::from_secs(2));
        let stamps: Vec<f64> = seen.iter().map(|frame| stamp(&frame["msg"])).collect();
        // 120 and 2 s on an idle machine.
        let simulated = stamps.last().unwrap_or(&0.0) - stamps.first().unwrap_or(&0.0);
        (stamps.len() > 20 && simulated > 0.7)
            .then_some(())
            .ok_or(format!("{} and {simulated} s in 2 s", stamps.len()))
    });
}

#[test]
fn a_client_that_leaves_takes_its_computations_along() {
    let runtime = Runtime::start();
    let mut gone = runtime.connect();
    for _ in 0..17 {
        send_call(&mut gone, "heavy", &heavy());
    }
    drop(gone);
    // Were they finished first, this would wait for a minute or so.
    let mut client = runtime.connect();
    client.ask(SERVICE, lighter());
}

//! `param get` and `param set`.

use super::{json_of, refusal, said};
use crate::common::Runtime;

#[test]
fn parameters_are_told_as_they_can_be_set_again() {
    let runtime = Runtime::start();
    let get = |name: &str| said(&runtime, &["param", "get", "/arm_sim", name]);
    assert_eq!(get("gravity"), "9.81\n");
    for (name, value, printed) in [
        ("gravity", "3.7", "3.7\n"),
        ("masses", "[2, 0.5]", "- 2.0\n- 0.5\n"),
        ("integrator", "verlet", "verlet\n"),
        ("timestep", "1e-4", "0.0001\n"),
    ] {
        assert_eq!(
            said(&runtime, &["param", "set", "arm_sim", name, value]),
            ""
        );
        assert_eq!(get(name), printed);
        assert_eq!(
            said(
                &runtime,
                &["param", "set", "arm_sim", name, "--", get(name).trim_end()]
            ),
            ""
        );
        assert_eq!(get(name), printed);
    }
    assert!(get("robot_description").starts_with("<?xml"));
    assert_eq!(
        json_of(&runtime, &["param", "get", "/arm_sim", "integrator"]),
        "verlet"
    );
    for (node, name) in [("/arm_sim", "colour"), ("/nope", "gravity")] {
        let full = format!("{node}:{name}");
        let expected = format!("there is no parameter {full:?}; `pendularm param list` has all");
        let get = ["param", "get", node, name];
        assert_eq!(refusal(&runtime, &get, 1), expected);
        let set = ["param", "set", node, name, "1"];
        assert_eq!(refusal(&runtime, &set, 1), expected);
    }
    let wrong = refusal(
        &runtime,
        &["param", "set", "/arm_sim", "gravity", "heavy"],
        1,
    );
    assert!(wrong.contains("gravity must be"), "{wrong}");
    let negative = ["param", "set", "/arm_sim", "gravity", "-3.7"];
    let wrong = refusal(&runtime, &negative, 1);
    assert!(wrong.ends_with("got -3.7"), "{wrong}");
}
